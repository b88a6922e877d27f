"""The names in a command, checked against the driver's ``COMMANDS``; the values are the driver's own affair."""

from __future__ import annotations

from collections.abc import Mapping

from fti.drivers import Command


def check_names(commands: Mapping[str, Command], name: str, args: Mapping[str, str]) -> None:
    """The command and its arguments are known.  Raises ValueError naming those that are."""
    if name not in commands:
        raise ValueError(f"no command {name!r}; there are {', '.join(commands)}")
    known = commands[name].arguments
    for key in args:
        if key not in known:
            raise ValueError(f"{name}: no argument {key!r}; there are {', '.join(known) or 'none'}")


def check_complete(commands: Mapping[str, Command], name: str, args: Mapping[str, str]) -> None:
    """The same, and none is missing, as none has a default.  Raises ValueError with its meaning."""
    check_names(commands, name, args)
    for key, meaning in commands[name].arguments.items():
        if key not in args:
            raise ValueError(f"{name}: {key} is missing: {meaning}")
