"""``fti reference``: make, info, mistakes."""

import json
from pathlib import Path

import pytest

from fti.cli.main import main
from fti.nav.integrity.reference import Reference
from fti.terrain.scenes import DEMO_AIRFIELD
from tests.helpers import ROOT

DEMO = str(ROOT / "configs" / "profiles" / "demo.csv")


def test_make_writes_a_reference_that_info_shows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new" / "x.csv"
    made = ["reference", "make", "--airfield", str(DEMO_AIRFIELD), "--terrain", "demo", "--out", str(out)]
    assert main([*made, "--runs", "20", "--draws", "5", "--beside-runs", "2", "--s-max", "1000", "--seed", "3"]) == 0
    reference = Reference.parse(out.read_text(), str(out))
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


def test_info_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reference", "info", DEMO, "--json"]) == 0
    table = json.loads(capsys.readouterr().out)
    assert table["sensor"] == {"kind": "radar", "beam_deg": 40.0}
    assert table["hash"] == Reference.parse(Path(DEMO).read_text(), DEMO).hash


def test_mistakes_are_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reference", "info", str(tmp_path / "none.csv")]) == 2
    assert "none.csv: cannot be read" in capsys.readouterr().err
    (tmp_path / "field.toml").write_text("name = 3\n")
    made = ["reference", "make", "--terrain", "demo", "--out", str(tmp_path / "x.csv")]
    assert main([*made, "--airfield", str(tmp_path / "field.toml")]) == 2
    assert "name = 3" in capsys.readouterr().err


@pytest.mark.parametrize(("option", "value"), [("--runs", "19"), ("--draws", "few"), ("--s-max", "10")])
def test_senseless_numbers_are_refused(option: str, value: str, capsys: pytest.CaptureFixture[str]) -> None:
    made = ["reference", "make", "--airfield", "a", "--terrain", "demo", "--out", "o"]
    with pytest.raises(SystemExit) as caught:
        main([*made, option, value])
    assert caught.value.code == 2
    assert value in capsys.readouterr().err
