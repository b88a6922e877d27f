"""Manual pages of the commands from their parsers, in roff with the macros of man(7)."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from importlib.metadata import version

from fti.cli._parser import GROUPS, fold_text

WIDTH = 10_000  # man wraps the paragraphs


def pages(parser: argparse.ArgumentParser) -> dict[str, str]:
    """The text of each page by its file name: fti.1, and fti-COMMAND.1 of each command."""
    commands = _sub_parsers(parser)
    titles = {name: (command.description or "").partition("\n")[0].rstrip(".") for name, command in commands.items()}
    page = [*_head("fti", "flight-test data service"), *_description(parser), *_options(parser)]
    for group, names in GROUPS.items():
        page.append(f".SS {_escape(group)}")
        for name in names:
            page += [".TP", rf"\fBfti\-{_escape(name)}\fR(1)", _escape(titles[name])]
    files = {"fti.1": page}
    for name, command in commands.items():
        body = [*_description(command), *_options(command)]
        for action, sub in _sub_parsers(command).items():
            body += [f".SH {_escape(f'{name} {action}'.upper())}", *_description(sub), *_options(sub)]
        files[f"fti-{name}.1"] = [*_head(f"fti-{name}", titles[name]), *body, ".SH SEE ALSO", r"\fBfti\fR(1)"]
    return {name: "\n".join(lines) + "\n" for name, lines in files.items()}


def _sub_parsers(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    found = (action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return dict(next(found, {}))


def _head(name: str, title: str) -> Iterator[str]:
    yield f'.TH {_escape(name.upper())} 1 "" "fti {version("fti")}" "fti"'
    yield ".SH NAME"
    yield f"{_escape(name)} \\- {_escape(title[:1].lower() + title[1:])}"


def _description(parser: argparse.ArgumentParser) -> Iterator[str]:
    """Synopsis, and description: paragraphs are filled, indented lines are kept."""
    yield ".SH SYNOPSIS"
    yield _escape(" ".join(parser.format_usage().removeprefix("usage: ").split()))
    yield ".SH DESCRIPTION"
    filled = True
    for line in fold_text(parser.description or "", WIDTH):
        if line and line.startswith(" ") == filled:
            filled = not filled
            yield ".fi" if filled else ".nf"
        yield _escape(line) if line else ".PP" if filled else ""


def _options(parser: argparse.ArgumentParser) -> Iterator[str]:
    formatter = parser._get_formatter()
    actions = [action for action in parser._actions if not isinstance(action, argparse._SubParsersAction)]
    yield from (".fi", ".SH OPTIONS")
    for action in actions:
        yield ".TP"
        yield rf"\fB{_escape(formatter._format_action_invocation(action))}\fR"
        yield _escape(formatter._expand_help(action))


def _escape(text: str) -> str:
    """Text without meaning for roff, and without the colours that argparse of Python 3.14 adds on a terminal."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", text)
    return re.sub(r"^(?=[.'])", r"\\&", plain.replace("\\", r"\e").replace("-", r"\-"))
