"""The altimeter of ``fti reference make``, by its arguments and by the daemon's configuration."""

import argparse
from pathlib import Path

import pytest

from fti.cli._reference_altimeter import check_alert_limit, load, model_of
from fti.cli._reference_arguments import add_make
from fti.cli.main import main
from fti.errors import ConfigError
from fti.nav.integrity.reference import ApproachReference
from tests.cli.test_check import BENCH
from tests.helpers import ROOT

DEMO = ROOT / "configs" / "profiles" / "demo.csv"


def arguments(*options: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_make(parser)
    return parser.parse_args(["--airfield", "a", "--terrain", "demo", "--out", "o", *options])


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """Its radar has a beam of 25 deg."""
    file = tmp_path / "bench.toml"
    file.write_text(BENCH.replace("[0, 800]", "[0, 800], beam_deg = 25"))
    return file


@pytest.mark.parametrize(("options", "beam"), [([], 40.0), (["--beam", "60"], 60.0)])
def test_without_a_configuration_it_is_an_ra4500(options: list[str], beam: float) -> None:
    assert model_of(arguments(*options), None).sensor.model_dump() == {"kind": "radar", "beam_deg": beam}


@pytest.mark.parametrize(("options", "beam"), [([], 25.0), (["--beam", "60"], 60.0)])
def test_the_beam_is_that_of_the_configured_altimeter(config: Path, options: list[str], beam: float) -> None:
    assert model_of(arguments(*options), load(config)).sensor.beam_deg == beam


def test_an_alert_limit_below_the_protection_level_is_refused(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As the default of 5 m is with the reference of the demonstration; the level is printed whatever the limit is."""
    reference = ApproachReference.parse(DEMO.read_text(), str(DEMO))
    approach = f'[nav]\napproach = {{ profile = "{DEMO}", alert_v_m = LIMIT }}'
    text = config.read_text().replace("[nav]", approach, 1)
    config.write_text(text.replace("LIMIT", "50.0"))
    check_alert_limit(reference, load(config), Path("x.csv"))
    assert "nav.approach.alert_v_m must be at least " in capsys.readouterr().out
    config.write_text(text.replace("LIMIT", "5.0"))
    with pytest.raises(ConfigError, match=r"alert_v_m: 5 m is below the minimum protection level .* x\.csv; must be"):
        check_alert_limit(reference, load(config), Path("x.csv"))


@pytest.mark.parametrize("value", ["0", "wide", "nan", "200"])
def test_a_beam_that_no_antenna_has_is_refused(capsys: pytest.CaptureFixture[str], value: str) -> None:
    with pytest.raises(SystemExit) as end:
        main(["reference", "make", "--airfield", "a", "--terrain", "demo", "--out", "o", "--beam", value])
    assert end.value.code == 2
    assert "must be 0.1 to 120 deg" in capsys.readouterr().err
