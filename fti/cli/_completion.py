"""Completion in the shell of names that are no files: scenarios, drivers, topics, studies."""

from __future__ import annotations

import argparse
from collections.abc import Callable

#: Set by the completion scripts: print completions, run nothing.
COMPLETE = "_ARGCOMPLETE"


def complete(parser: argparse.ArgumentParser) -> None:
    """Print the completions of the command line that the shell passes in the environment, and end the process."""
    import argcomplete

    completers: dict[tuple[str, str], Callable[..., list[str]]] = {
        ("check", "file"): _scenarios,
        ("demo", "scenario"): _scenarios,
        ("hil", "scenario"): _scenarios,
        ("score", "files"): _scenarios,
        ("drivers", "name"): _drivers,
        ("decode", "driver"): _drivers,
        ("topics", "name"): _topics,
        ("study", "name"): _studies,
    }
    (commands,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    for (name, dest), completer in completers.items():
        (action,) = (action for action in commands.choices[name]._actions if action.dest == dest)
        action.completer = completer
    argcomplete.autocomplete(parser)


def _scenarios(prefix: str, **_: object) -> list[str]:
    from argcomplete.completers import FilesCompleter

    from fti.hil import scenario as scenarios

    return [*scenarios.shipped_names(), *FilesCompleter()(prefix)]


def _drivers(**_: object) -> list[str]:
    from fti import drivers

    return list(drivers.names())


def _topics(**_: object) -> list[str]:
    from fti.messages.topics import topics

    return [topic.name for topic in topics()]


def _studies(**_: object) -> list[str]:
    from fti import study

    return study.names()
