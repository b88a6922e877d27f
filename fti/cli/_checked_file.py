"""The file that ``fti check`` reads; its keys decide whether it is a configuration or a scenario."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """A TOML file, read once: it may be a pipe.  table, text : its content"""

    path: Path
    table: dict[str, Any]
    text: str
    is_scenario: bool


def read_file(name_or_path: str) -> CheckedFile:
    """A file, or the shipped scenario of that name.  Raises MissingError; ConfigError where it is neither."""
    from fti.config import read_toml

    path = _find(name_or_path)
    table, text = read_toml(path)
    return CheckedFile(path, table, text, _is_scenario(path, table))


def _find(name_or_path: str) -> Path:
    """The path itself; a word that is not a path is the name of a shipped scenario.  Raises MissingError."""
    path = Path(name_or_path)
    if path.suffix or path.name != name_or_path or path.is_file():
        return path
    from fti.errors import MissingError
    from fti.hil import scenario as scenarios

    if name_or_path not in scenarios.shipped_names():
        raise MissingError(
            f"{name_or_path}: not a file and not a shipped scenario; shipped: {', '.join(scenarios.shipped_names())}"
        )
    return scenarios.find(name_or_path)


def _is_scenario(path: Path, table: dict[str, Any]) -> bool:
    """Does the file have more keys of a scenario than of a configuration?  No key belongs to both."""
    from fti.config import Config

    config_keys = table.keys() & Config.model_fields.keys()
    if table and len(config_keys) == len(table):
        return False
    from fti.errors import ConfigError
    from fti.hil.scenario import Scenario

    scenario_keys = table.keys() & Scenario.model_fields.keys()
    if not config_keys and not scenario_keys:
        raise ConfigError(
            f"{path}: is neither a configuration nor a scenario: a configuration has [session] and [[link]], "
            "a scenario has title, description, config and [flight]"
        )
    return len(scenario_keys) > len(config_keys)
