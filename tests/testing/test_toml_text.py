"""What is written as TOML is read again as it was."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti import config as configuration
from fti.hil import scenario as scenarios
from fti.testing.emulator import write_scenario
from fti.testing.ports import toml_text, write_config
from tests.helpers import ROOT

TEXTS = st.text(st.characters(exclude_categories=["Cs"]))
LEAVES = st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False) | TEXTS
TABLES = st.dictionaries(TEXTS, st.recursive(LEAVES, lambda of: st.lists(of) | st.dictionaries(TEXTS, of)))


@given(TABLES)
def test_every_table_comes_back(table: dict[str, object]) -> None:
    assert tomllib.loads(toml_text(table)) == table


def test_what_toml_cannot_say_is_refused() -> None:
    with pytest.raises(ValueError, match="None"):
        toml_text({"a": None})


@pytest.mark.parametrize("name", scenarios.shipped_names())
def test_every_scenario_comes_back(name: str, tmp_path: Path) -> None:
    scenario = scenarios.load(scenarios.find(name))
    write_scenario(scenario, tmp_path / "scenario.toml")
    read = scenarios.load(tmp_path / "scenario.toml")
    assert read.flight_key == scenario.flight_key
    assert (read.config, read.expect, read.port) == (scenario.config, scenario.expect, scenario.port)


@pytest.mark.parametrize("file", sorted((ROOT / "configs").glob("*.toml")), ids=lambda file: file.stem)
def test_every_configuration_comes_back(file: Path, tmp_path: Path) -> None:
    config = configuration.load(file)
    write_config(config, tmp_path / "config.toml")
    read = configuration.load(tmp_path / "config.toml")
    nothing = {"path": "", "text": ""}
    assert read.model_copy(update=nothing) == config.model_copy(update=nothing)
