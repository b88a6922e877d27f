"""Checks the names of command arguments against the ``COMMANDS`` of a driver, and reads numbers.

The driver checks the values.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from fti.drivers import Command


def check_names(commands: Mapping[str, Command], name: str, args: Mapping[str, str]) -> None:
    """Check the names of a command and its arguments.  Raises ValueError with the known names."""
    if name not in commands:
        raise ValueError(f"no command {name!r}; there are {', '.join(commands)}")
    arguments = commands[name].arguments
    for key in args:
        if key not in arguments:
            raise ValueError(f"{name}: no argument {key!r}; there are {', '.join(arguments) or 'none'}")


def check_complete(commands: Mapping[str, Command], name: str, args: Mapping[str, str]) -> None:
    """``check_names``, and all arguments are required.  Raises ValueError with the meaning of a missing one."""
    check_names(commands, name, args)
    for key, meaning in commands[name].arguments.items():
        if key not in args:
            raise ValueError(f"{name}: {key} is missing: {meaning}")


def number_or_nan(text: str) -> float:
    """The number in a text; NaN, which is outside every range, if it has none."""
    try:
        return float(text)
    except ValueError:
        return math.nan
