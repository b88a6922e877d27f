"""``fti reference``: make, info, mistakes."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fti.cli.main import main
from fti.cli.reference import _limit_warnings
from fti.hil.approach_reference.recorded_approaches import Pass
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.reference import ApproachReference, Obstacles
from fti.terrain.demo_scene import DEMO_AIRFIELD
from tests.helpers import ROOT
from tests.terrain.elevation_files import write_ground

DEMO = str(ROOT / "configs" / "profiles" / "demo.csv")


@pytest.fixture(autouse=True)
def _few_receivers(monkeypatch: pytest.MonkeyPatch) -> None:
    """A map of ranges for each of them is most of the time of a reference."""
    monkeypatch.setattr("fti.hil.approach_reference.options.RECEIVERS", 6)


def test_make_writes_a_reference_that_info_shows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fti.terrain.demo_scene.VEGETATION", (0.9, 1.1))  # each has its own map of ranges
    out = tmp_path / "new" / "x.csv"
    command = ["reference", "make", "--airfield", str(DEMO_AIRFIELD), "--terrain", "demo", "--out", str(out)]
    assert main([*command, "--runs", "20", "--draws", "5", "--beside-runs", "2", "--s-max", "1000", "--seed", "3"]) == 0
    reference = ApproachReference.parse(out.read_text(), str(out))
    assert (reference.header.profile.seed, reference.header.limits.runs) == (3, 20)
    assert reference.hash in capsys.readouterr().out
    assert main(["reference", "info", str(out)]) == 0
    assert "Jacksboro" in capsys.readouterr().out


def test_info_draws_the_path_above_the_terrain(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reference", "info", DEMO]) == 0
    rows = [line.partition("|")[2] for line in capsys.readouterr().out.splitlines() if " m |" in line]
    assert len(rows) == 16
    for column in range(10, 80):
        drawn = "".join(row[column] for row in rows).strip()
        assert drawn.startswith(".")
        assert drawn.endswith("#")


def test_info_has_limits_by_theory_beside_the_calibrated(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reference", "info", DEMO]) == 0
    lines = {line.split("  ")[0]: line for line in capsys.readouterr().out.splitlines()}
    assert "T1 25.452  T2 15.475  T3 3.689  T4 5.114" in lines["limits"]
    assert "T2 14.4" in lines["analytic"]


def test_info_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reference", "info", DEMO, "--json"]) == 0
    table = json.loads(capsys.readouterr().out)
    assert table["sensor"] == {"kind": "radar", "beam_deg": 40.0}
    assert table["hash"] == ApproachReference.parse(Path(DEMO).read_text(), DEMO).hash


def test_info_reports_obstacles_and_templates(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The smallest that is seen; none is a word for a person and null in JSON, which has no infinity."""
    shipped = ApproachReference.parse(Path(DEMO).read_text(), DEMO)
    table = Obstacles(
        pd=0.97, width_m=(30.0, 60.0), s_m=(2000.0, 1000.0), agl_m=(140.0, 60.0),
        height_m=((40.0, math.inf), (25.0, 15.0)), runs=100,
    )  # fmt: skip
    limits = shipped.header.limits.model_copy(update={"t4_widths_m": (5.0, 30.0, 100.0)})
    header = shipped.header.model_copy(update={"obstacles": table, "limits": limits})
    file = tmp_path / "x.csv"
    file.write_text(replace(shipped, header=header).to_text())
    assert main(["reference", "info", str(file)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:5] for line in lines if " m wide" in line] == [
        ["30", "m", "wide", "40", "none"],
        ["60", "m", "wide", "25", "15"],
    ]
    assert any(line.startswith("T4 is of") and "5, 30, 100 m" in line for line in lines)
    assert main(["reference", "info", str(file), "--json"]) == 0
    output = capsys.readouterr().out
    assert json.loads(output)["obstacles"]["height_m"] == [[40.0, None], [25.0, 15.0]]
    assert "Infinity" not in output
    single = shipped.header.limits.model_copy(update={"t4_widths_m": None})
    file.write_text(replace(shipped, header=shipped.header.model_copy(update={"limits": single})).to_text())
    assert main(["reference", "info", str(file)]) == 0
    assert "single bins" in capsys.readouterr().out


def test_mistakes_are_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reference", "info", str(tmp_path / "none.csv")]) == 2
    assert "none.csv: cannot be read" in capsys.readouterr().err
    (tmp_path / "field.toml").write_text("name = 3\n")
    command = ["reference", "make", "--terrain", "demo", "--out", str(tmp_path / "x.csv")]
    assert main([*command, "--airfield", str(tmp_path / "field.toml")]) == 2
    assert "name = 3" in capsys.readouterr().err


def hills(lat: np.ndarray, lon: np.ndarray) -> np.ndarray:
    """340 m above the ellipsoid, waves of 6 m and 300 m along and across."""
    wave = 2.0 * np.pi * 111_000.0 / 300.0
    return np.asarray(340.0 + 3.0 * np.sin(wave * lat) + 3.0 * np.sin(0.8 * wave * lon))


@pytest.mark.parametrize(("step_deg", "coarse"), [(1e-4, False), (3e-4, True)])
def test_elevation_files_become_a_reference_of_their_ground(
    step_deg: float, coarse: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A GeoTIFF above the ellipsoid.  Within 4 m: five draws that err by 1.5 m each; the nearest return lies higher."""
    size = round(0.075 / step_deg)
    at = (36.63, -84.1655)
    file, out = write_ground(tmp_path / "dsm.tif", hills, "EPSG:4979", size, step_deg, at), tmp_path / "x.csv"
    command = ["reference", "make", "--airfield", str(DEMO_AIRFIELD), "--terrain", file, "--out", str(out)]
    assert (
        main([*command, "--runs", "20", "--draws", "5", "--beside-runs", "2", "--s-max", "1000", "--pfa", "0.05"]) == 0
    )
    reference = ApproachReference.parse(out.read_text(), str(out))
    assert (reference.header.profile.surface, reference.header.limits.pfa) == ("dsm.tif", 0.05)
    below = hills(*np.degrees(ApproachPath(reference.header.airfield).to_geodetic(reference.s, 0.0)))
    assert np.ptp(below) > 8.0
    assert np.abs(reference.z_ref - below).max() < 4.0
    assert ("posts below the track" in capsys.readouterr().err) is coarse


def test_recorded_approaches_become_a_reference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Six ways over level ground, where no shift is ever observable; the last one begins at 1300 m."""
    rng = np.random.default_rng(3)
    s = np.arange(1500.0, 0.0, -2.4)
    passes = [
        Pass(
            10**18 + k * 10**11 + 4 * 10**7 * np.arange(len(far)),
            far,
            350.0 + 0.01 * far + rng.normal(0.0, 0.3, len(far)),
        )
        for k, far in enumerate([s] * 5 + [s[s < 1300.0]])
    ]
    monkeypatch.setattr("fti.hil.approach_reference.recorded_approaches.check_sensor", lambda *_: None)
    monkeypatch.setattr("fti.hil.approach_reference.recorded_approaches.read_passes", lambda *_: passes)
    out = tmp_path / "x.csv"
    command = [
        "reference",
        "make",
        "--airfield",
        str(DEMO_AIRFIELD),
        "--recorded",
        "a",
        "--out",
        str(out),
        "--runs",
        "20",
    ]
    assert main([*command, "--s-max", "1500"]) == 0
    profile = ApproachReference.parse(out.read_text(), str(out)).header.profile
    assert (profile.made_from, profile.draws, profile.surface, profile.date) == (
        "recordings",
        5,
        "altimeter",
        "2001-09-09",
    )
    assert main([*command, "--s-max", "3000"]) == 2
    assert "only 0 of 6 recorded passes" in (output := capsys.readouterr().err)
    assert "allowed: --s-max 1500 or less" in output


def test_where_nothing_can_be_written_is_known_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["reference", "make", "--airfield", str(DEMO_AIRFIELD), "--terrain", "no.tif", "--out"]
    assert main([*command, str(tmp_path)]) == 2
    assert "is a folder" in capsys.readouterr().err
    (tmp_path / "file").write_text("x")
    assert main([*command, str(tmp_path / "file" / "x.csv")]) == 2
    assert f"{tmp_path / 'file'} is not a folder" in capsys.readouterr().err


def test_limits_that_other_approaches_do_not_keep_are_remarked_upon() -> None:
    limits = ApproachReference.parse(Path(DEMO).read_text(), DEMO).header.limits  # 2 alarms on 500 at 1 %
    assert list(_limit_warnings(limits)) == []
    (output,) = _limit_warnings(limits.model_copy(update={"verified_alarms": 10}))
    assert "an ALERT on 10 of 500" in output
    assert "up to 9 by chance" in output


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--runs", "19"),
        ("--draws", "few"),
        ("--s-max", "10"),
        ("--pfa", "0.5"),
        ("--date", "2024-1-5"),
        ("--date", "5.1.2024"),
    ],
)
def test_senseless_numbers_are_refused(option: str, value: str, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["reference", "make", "--airfield", "a", "--terrain", "demo", "--out", "o"]
    with pytest.raises(SystemExit) as caught:
        main([*command, option, value])
    assert caught.value.code == 2
    assert value in capsys.readouterr().err
