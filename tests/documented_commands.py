"""The ``fti`` commands that README, the documentation and the help print."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from fti.cli._parser import make_parser
from tests.helpers import ROOT

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
#: Code that is no console: its lines are neither commands nor their output.
NO_CONSOLE = {"toml", "python", "text", "json", "ini"}

#: A command in a sentence, a block of code or a help text.
MENTION = r"(?:`|\$ ?|^ *)(fti [a-z][a-z_]*(?![\w'])[^`\n;]*)"


@dataclass(frozen=True)
class Documented:
    """A command as a page prints it, without its comment."""

    page: str
    command: str


def printed_commands() -> list[Documented]:
    """The commands in blocks of code of all pages: lines that begin with ``fti``, also after a prompt."""
    return [
        Documented(str(page.relative_to(ROOT)), command)
        for page in PAGES
        for block in _code_blocks(page.read_text(encoding="utf-8"))
        for command in _commands_of(block)
    ]


def _code_blocks(text: str) -> list[str]:
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return [block.replace("\\\n", " ") for kind, block in blocks if kind not in NO_CONSOLE]


def _commands_of(block: str) -> Iterator[str]:
    for line in block.splitlines():
        if match := re.match(r"(?:\$ ?|sudo )?(fti [a-z]\S*(?: .*)?)$", line):
            command = re.split(r"\s+#\s|;|&&|\s[12&]?>", match[1])[0]
            yield re.sub(r"\s+", " ", command).strip(" &")


def mentions() -> Iterator[Documented]:
    """Each ``fti COMMAND ...`` of all pages and of the help, wherever it stands."""
    texts = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in PAGES}
    texts |= {f"fti {name} --help": parser.description or "" for name, parser in command_parsers().items()}
    for page, text in texts.items():
        for match in re.finditer(MENTION, text.replace("\\\n", " "), re.MULTILINE):
            yield Documented(page, re.split(r"\s+#\s|\s{3,}", match[1])[0])


@cache
def command_parsers() -> dict[str, argparse.ArgumentParser]:
    """The parser of each command."""
    (commands,) = (action for action in make_parser()._actions if isinstance(action, argparse._SubParsersAction))
    return dict(commands.choices)


def unknown_words(command: str) -> list[str]:
    """The command itself and its options as far as they do not exist."""
    name, *words = command.removeprefix("fti ").split()
    parsers = command_parsers()
    if name not in parsers:
        return [name]
    return [word for word in map(_option, words) if word and word not in _options(parsers[name])]


def _option(word: str) -> str:
    match = re.match(r"\[?(--?[a-z][a-z-]*)", word)
    return match[1] if match else ""


def _options(parser: argparse.ArgumentParser) -> set[str]:
    """Options of a command and of its own commands."""
    options = set(parser._option_string_actions)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            options |= {option for each in action.choices.values() for option in _options(each)}
    return options


def page_targets() -> set[str]:
    """The targets of every ``make TARGET`` on the pages."""
    pattern = r"(?:`|^)make ([a-z]+)"
    return {target for page in PAGES for target in re.findall(pattern, page.read_text("utf-8"), re.MULTILINE)}
