"""The parser of the command line: the commands in groups, the help, the versions."""

from __future__ import annotations

import argparse
import importlib
import inspect
import shutil
import textwrap
from collections.abc import Iterator
from itertools import groupby
from typing import Any

from fti.cli._printing import fold_line, print_lines

#: The commands by task, each in the order of its use.  A command is the module of that name in this package.
GROUPS: dict[str, tuple[str, ...]] = {
    "first steps": ("demo", "examples"),
    "before the flight": ("ports", "listen", "new", "check", "preflight", "drivers", "topics", "decode"),
    "record and navigate": ("run",),
    "during the flight": ("watch", "page", "ground", "mark", "acknowledge", "readmit", "send"),
    "after the flight": ("info", "verify", "recover", "pack", "sync", "latency", "export", "reprocess"),
    "laboratory": ("hil", "score", "replay", "publish", "compare"),
    "terrain, references, studies": ("terrain", "reference", "study"),
    "shell": ("completion",),
}
#: Packages that matter for a report of an error.
PACKAGES = ("numpy", "numba", "mcap", "eclipse-zenoh", "python-can", "pyserial", "pymavlink")
#: Help is not wider, also on a wider terminal.
MAX_WIDTH = 120


class HelpText(argparse.HelpFormatter):
    """Fits the terminal: joins and wraps paragraphs, keeps indented lines, and lists the commands by group."""

    def __init__(self, prog: str, **options: Any) -> None:
        width = min(shutil.get_terminal_size().columns, MAX_WIDTH)
        super().__init__(prog, **{"width": width - 1, **options})

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "\n".join(fold_text(text, width))

    def _format_action(self, action: argparse.Action) -> str:
        if not isinstance(action, argparse._SubParsersAction) or action.dest != "command":
            return super()._format_action(action)
        commands = {command.dest: command for command in action._choices_actions}
        self._indent()
        self._action_max_length = self._current_indent + max(map(len, commands))
        lines = []
        for title, names in GROUPS.items():
            lines.append(f"\n  {title}\n")
            lines += [super(HelpText, self)._format_action(commands[name]) for name in names]
        self._dedent()
        return "".join(lines)


def fold_text(text: str, width: int) -> Iterator[str]:
    """The lines of a help text: a paragraph is wrapped, an indented line stays a line and is folded."""
    for is_paragraph, lines in groupby(text.splitlines(), lambda line: line[:1].strip() != ""):
        if is_paragraph:
            yield from textwrap.wrap(" ".join(lines), width, break_long_words=False, break_on_hyphens=False)
        else:
            for line in lines:
                yield from fold_line(line, width)


class _ShowVersions(argparse.Action):
    """Prints the versions and ends the command."""

    def __call__(self, parser: argparse.ArgumentParser, *arguments: object) -> None:
        print_lines(versions())
        parser.exit()


def versions() -> Iterator[str]:
    """Versions of fti, Python, the system and ``PACKAGES``, without importing them."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    yield f"fti {version('fti')}"
    yield f"Python {platform.python_version()}, {platform.platform()}"
    for name in PACKAGES:
        try:
            yield f"{name} {version(name)}"
        except PackageNotFoundError:
            yield f"{name} is not installed"


def make_parser() -> argparse.ArgumentParser:
    """The parser with every command."""
    parser = argparse.ArgumentParser(
        prog="fti",
        description="Flight-test data service: records every byte, navigates live, emulates the sensors.",
        epilog="fti COMMAND --help describes a command, with examples.",
        formatter_class=HelpText,
    )
    parser.add_argument("--version", action=_ShowVersions, nargs=0, help="print the versions of fti and its packages")
    sub = parser.add_subparsers(title="commands", dest="command", required=True, metavar="COMMAND")
    for name in (name for names in GROUPS.values() for name in names):
        module = importlib.import_module(f"fti.cli.{name.replace('-', '_')}")
        text = inspect.getdoc(module) or ""
        command = sub.add_parser(
            name, help=text.partition("\n")[0].rstrip("."), description=text, formatter_class=HelpText
        )
        module.add_arguments(command)
        command.set_defaults(run=module.run, parser=command)
    return parser
