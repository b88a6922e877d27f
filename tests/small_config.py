"""The smallest configurations: a serial line and one device on it.  They are text, as in a session."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

from fti import config as configuration
from fti.config import Config

LINE = """
[session]
name = "small"

[[link]]
name = "line"
kind = "serial"
port = "/dev/unused"
"""


def device(name: str, driver: str, **keys: float | bool) -> str:
    """The table of a device on the line, with more of its keys."""
    table: dict[str, object] = {"name": name, "link": "line", "driver": driver, **keys}
    return "\n[[device]]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in table.items())


def radar_altimeter(max_age_ms: int) -> str:
    """The table of a radar altimeter on the line."""
    limits = '\n[device.altimeter]\nkind = "radar"\nrange_m = [0.5, 762]\n'
    return device("altimeter", "freeflight_ra4500", max_age_ms=max_age_ms) + limits


def parsed(text: str) -> Config:
    """As it is after it was read from a file."""
    return configuration.parse(tomllib.loads(text), text, Path("small.toml"))
