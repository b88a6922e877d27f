"""Reading scenario files, and checking them against their configuration."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fti import config as configuration
from fti.config import Config
from fti.errors import ConfigError, MissingError, did_you_mean
from fti.example_files import SCENARIOS
from fti.hil.scenario.config_check import check
from fti.hil.scenario.fault_table import read as read_profile
from fti.hil.tables.fault_types import OffTrack, WholeFlightFault
from fti.hil.tables.flights import ApproachFlight, RecordedFlight
from fti.hil.tables.schema import Scenario


def load(path: Path) -> Scenario:
    """Read and check a scenario.  Raises ConfigError or MissingError."""
    table, text = configuration.read_toml(path)
    return parse(table, text, path)


def parse(table: Mapping[str, Any], text: str, path: Path) -> Scenario:
    """The scenario in a TOML table.  Raises ConfigError.

    text, path : of its file, for the lines of errors, and for relative paths
    """
    with configuration.error_lines(str(path), text):
        return _parse(table, path)


def _parse(table: Mapping[str, Any], path: Path) -> Scenario:
    scenario = configuration.bind(Scenario, table, str(path)).with_file(str(path))
    for i, fault in enumerate(scenario.fault):
        if not isinstance(fault, WholeFlightFault) and fault.from_s >= fault.to_s:
            raise ConfigError(f"{path}: fault[{i}].to_s = {fault.to_s}: must be after from_s = {fault.from_s}")
        if isinstance(fault, OffTrack) and not isinstance(scenario.flight, ApproachFlight):
            raise ConfigError(f"{path}: fault[{i}].kind = 'off_track': needs flight.kind = 'approach'")
    update: dict[str, Any] = {"config": _resolve_path(path, scenario.config)}
    if isinstance(flight := scenario.flight, RecordedFlight):
        update["flight"] = flight.model_copy(update={"file": _resolve_path(path, flight.file)})
    if scenario.profile is not None:
        file = _resolve_path(path, scenario.profile)
        profile = read_profile(Path(file))
        update |= {"fault": scenario.fault + profile.faults, "expect": scenario.expect + profile.expectations}
        update["profile"] = file
    return scenario.model_copy(update=update)


def _resolve_path(path: Path, name: str) -> str:
    if "\0" in name:
        raise ConfigError(f"{path}: {name!r}: is not a file name")
    return str((path.parent / name).resolve())


def load_config(scenario: Scenario, path: Path | None = None) -> Config:
    """The daemon's configuration of a scenario, or the one in path.  Raises ConfigError if they do not fit."""
    config = configuration.load(path or scenario.config)
    check(scenario, config)
    return config


def find(name_or_path: str) -> Path:
    """The file of a scenario given by path or by the name of a shipped one.  Raises MissingError."""
    for candidate in (Path(name_or_path), SCENARIOS / f"{name_or_path}.toml"):
        if candidate.is_file():
            return candidate
    names = shipped_names()
    hint = did_you_mean(name_or_path, names)
    raise MissingError(f"unknown scenario {name_or_path!r}; allowed: a file, or one of {', '.join(names)}{hint}")


def shipped_names() -> list[str]:
    """Names of the shipped scenarios."""
    return sorted(p.stem for p in SCENARIOS.glob("*.toml"))
