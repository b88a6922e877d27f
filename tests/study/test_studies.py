"""Studies: every one holds in a small count (the full one with --scale full), and reports results in the same form."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from fti import study
from fti.cli.main import main
from fti.errors import MissingError, StorageError
from fti.plot_style import write_figure
from fti.study import StudyResult, device_clock, ranging, triple_buffer
from fti.study.device_clock import experiment as clock
from fti.study.device_clock.judge import judge_case
from fti.study.ranging.judge import pulses
from fti.study.triple_buffer.experiment import stall
from fti.study.triple_buffer.judge import closed_forms

#: Runs with --scale quick; twenty times as many with --scale full.
RUNS = {"device_clock": 5, "triple_buffer": 1}
#: Studies that take longer: their own tests judge parts of them, and the whole with --scale full.
LONG = {"approach", "clearance", "compensation", "faults", "filter", "matching", "ranging", "robust_altimeter"}
LONG |= {
    "bound",
    "dead_reckoning",
    "ground_watch",
    "ira_closest_point",
    "ira_particle_filter",
    "long_endurance",
    "multibeam",
    "ppsan",
    "ppsan_aiding",
    "scan_registration",
    "slant_range",
    "strapdown",
    "trajectory",
    "validity",
    "wdop",
}


def test_every_study_has_its_count_here() -> None:
    assert study.names() == sorted({*RUNS, *LONG})


@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", sorted(RUNS))
def test_a_study_holds(name: str, scale: int) -> None:
    chosen = study.load(name)
    shares: list[float] = []
    results = chosen.study(RUNS[name] * scale, chosen.SEED, shares.append)
    assert [result for result in results if not result.holds] == []
    assert len(results) == len({result.id for result in results})
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_a_study_repeats_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clock, "HOUR_S", 300)

    def values(seed: int) -> list[float]:
        return [result.value for result in device_clock.study(1, seed, lambda share: None)]

    assert values(1) == values(1)
    assert values(1) != values(2)


def test_a_drift_that_delays_pretend_is_found_out() -> None:
    """The judge can say no: delays that grow by 0.36 ms in the hour are a drift of 0.1 ppm to any clock model."""
    delays = clock.draw_one_sided_delays(np.random.default_rng(5)) + np.linspace(0.0, 0.36, clock.HOUR_S)
    found, _ = clock.estimate_drift(1.1, delays)
    results = judge_case("X", np.array([[found - 1.1, 1e-3]]))
    assert [result.holds for result in results] == [False, False]


def test_a_stall_that_is_survived_loses_nothing() -> None:
    assert stall(121.4).first_loss_s == 121.4
    assert stall(121.6).first_loss_s == pytest.approx(121.48, abs=0.01)


def test_the_command_prints_what_the_design_promises(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(triple_buffer, "study", lambda runs, seed, progress: closed_forms())
    assert main(["study", "triple_buffer", "--runs", "3", "--seed", "4", "--json"]) == 0
    table = json.loads(capsys.readouterr().out)
    assert set(table) == {"name", "runs", "seed", "results"}
    assert (table["name"], table["runs"], table["seed"]) == ("triple_buffer", 3, 4)
    assert set(table["results"][0]) == {"id", "quantity", "value", "target", "holds"}
    assert table["results"][2]["value"] == 36_175_872


def test_a_result_that_does_not_hold_is_exit_code_1(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    bad = StudyResult("T0", "something", 2.0, "1", holds=False)
    monkeypatch.setattr(triple_buffer, "study", lambda runs, seed, progress: [bad])
    assert main(["study", "triple_buffer"]) == 1
    assert "DOES NOT HOLD" in capsys.readouterr().out


def test_studies_are_listed_and_others_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "--list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == study.names()
    assert main(["study", "no_such"]) == 2
    assert main(["study"]) == 2
    assert f"there are {', '.join(study.names())}" in capsys.readouterr().err
    with pytest.raises(MissingError, match="no_such"):
        study.load("no_such")


def test_a_name_is_written_with_either_line() -> None:
    assert study.load("device-clock") is study.load("device_clock")
    assert study.name_of(study.load("device-clock")) == "device_clock"


def _one_result(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ranging, "study", lambda runs, seed, progress: pulses())


def test_pictures_are_written_and_named(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    _one_result(monkeypatch)
    monkeypatch.setattr(ranging, "drawings", lambda seed: {"first": Figure, "second": Figure})
    folder = tmp_path / "new" / "figures"
    assert main(["study", "ranging", "--plots", str(folder)]) == 0
    files = [folder / "ranging-first.png", folder / "ranging-second.png"]
    assert [line for line in capsys.readouterr().out.splitlines() if line.startswith("wrote")] == [
        f"wrote {file}" for file in files
    ]
    assert sorted(folder.iterdir()) == files
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in files)


def test_json_names_the_pictures(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    _one_result(monkeypatch)
    monkeypatch.setattr(ranging, "drawings", lambda seed: {"first": Figure})
    assert main(["study", "ranging", "--json", "--plots", str(tmp_path)]) == 0
    assert json.loads(capsys.readouterr().out)["plots"] == [str(tmp_path / "ranging-first.png")]


def test_a_picture_that_is_there_stays(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(ranging, "study", lambda *_: pytest.fail("found out before the work is done"))
    monkeypatch.setattr(ranging, "drawings", lambda seed: {"first": Figure, "second": Figure})
    (tmp_path / "ranging-second.png").write_bytes(b"mine")
    assert main(["study", "ranging", "--plots", str(tmp_path)]) == 2
    assert "ranging-second.png: already exists" in capsys.readouterr().err
    with pytest.raises(StorageError, match="File exists"):  # it has come meanwhile
        write_figure(Figure, tmp_path / "ranging-second.png")
    assert [(file.name, file.read_bytes()) for file in tmp_path.iterdir()] == [("ranging-second.png", b"mine")]


def test_a_folder_that_cannot_be_and_a_study_without_pictures_are_reported(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    _one_result(monkeypatch)
    monkeypatch.setattr(ranging, "drawings", lambda seed: {"first": Figure})
    (tmp_path / "file").touch()
    assert main(["study", "ranging", "--plots", str(tmp_path / "file")]) == 2
    assert "file: cannot be written: File exists" in capsys.readouterr().err
    assert main(["study", "triple_buffer", "--plots", str(tmp_path)]) == 2
    assert "the study triple_buffer has no plots" in capsys.readouterr().err


def test_every_package_is_a_study() -> None:
    folder = Path(study.__file__).parent
    assert {path.parent.name for path in folder.glob("*/__init__.py")} == set(study.names())
