"""Which file ``fti check`` was given, and whether it is a configuration or a scenario: decided by its keys."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """A TOML file, read once: it may be a pipe.  table, text : what is in it"""

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
    """A path as it is; a word that is not a path is the name of a shipped scenario.  Raises MissingError."""
    path = Path(name_or_path)
    if path.suffix or path.name != name_or_path or path.is_file():
        return path
    from fti.errors import MissingError
    from fti.hil import scenario as scenarios

    if name_or_path not in scenarios.shipped_names():
        raise MissingError(
            f"{name_or_path}: is neither a file nor a shipped scenario; shipped are {', '.join(scenarios.shipped_names())}"
        )
    return scenarios.find(name_or_path)


def _is_scenario(path: Path, table: dict[str, Any]) -> bool:
    """The one of whose keys the file has more.  No key belongs to both."""
    from fti.config import Config

    of_config = table.keys() & Config.model_fields.keys()
    if table and len(of_config) == len(table):
        return False
    from fti.errors import ConfigError
    from fti.hil.scenario import Scenario

    of_scenario = table.keys() & Scenario.model_fields.keys()
    if not of_config and not of_scenario:
        raise ConfigError(
            f"{path}: is neither a configuration nor a scenario: a configuration has [session] and [[link]], "
            "a scenario has title, description, config and [flight]"
        )
    return len(of_scenario) > len(of_config)
