"""Errors of a configuration: all of them at once, each with its line and the name of its device or link."""

from __future__ import annotations

import contextlib
import itertools
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, TypeVar

from fti.errors import ConfigError, MissingError

#: Key path at the begin of a sentence, such as ``device[2].options.rate_hz``.
KEY_PATH = re.compile(r"[\w-]+(?:\[\d+\])*(?:\.[\w-]+(?:\[\d+\])*)*(?=[: ])")
#: The end of a sentence that has its line.
PLACE = re.compile(r" \(line \d+(, \w+ '.*')?\)$")
_HEADER = re.compile(r"\s*(\[\[?)\s*([\w.-]+)\s*\]")
_KEY = re.compile(r"\s*([\w.-]+)\s*=")

Path = tuple[str | int, ...]
Result = TypeVar("Result")


@contextlib.contextmanager
def error_lines(file: str, text: str) -> Iterator[None]:
    """Complete a ConfigError or MissingError of the block; each of its sentences becomes a line.

    file, text : the configuration; errors of other files stay as they are
    """
    try:
        yield
    except (ConfigError, MissingError) as error:
        sentences = re.split(rf"(?:^|; |\n){re.escape(file)}: ", str(error))
        if len(sentences) < 2 or sentences[0]:
            raise
        raise type(error)("\n".join(f"{file}: {with_place(sentence, text)}" for sentence in sentences[1:])) from None


def check_all(checks: Iterable[Callable[[], Result]]) -> list[Result]:
    """The results of all checks; the errors of all, joined, as one.  Raises ConfigError."""
    results, errors = list[Result](), list[str]()
    for check in checks:
        try:
            results.append(check())
        except ConfigError as error:
            errors.append(str(error))
    if errors:
        raise ConfigError("; ".join(errors))
    return results


def with_place(sentence: str, text: str) -> str:
    """The sentence with the line, and the name of the device or link, of the key at its begin.

    text : the configuration.  A key that is not in it has the line of its table; other sentences are unchanged.
    """
    found = KEY_PATH.match(sentence)
    if not found or PLACE.search(sentence):
        return sentence
    path = tuple(int(part) if part.isdigit() else part for part in re.findall(r"[\w-]+", found[0]))
    line, known = _find_line(text, path)
    name = _name_of_table(text, path)
    place = f"line {line}" + (f", {path[0]} {name!r}" if name else "")
    return f"{sentence} ({place})" if known else sentence


def _find_line(text: str, path: Path) -> tuple[int, int]:
    """The first line with the longest begin of the path, and the length of that begin."""
    best, table, counts = (0, 0), Path(), dict[str, int]()
    for number, line in enumerate(text.splitlines(), 1):
        if header := _HEADER.match(line):
            table = _table_path(header[2], counts, is_new=header[1] == "[[")
            here = table
        elif key := _KEY.match(line):
            here = (*table, *key[1].split("."))
        else:
            continue
        common = len([*itertools.takewhile(lambda parts: parts[0] == parts[1], zip(here, path, strict=False))])
        if common > best[1]:
            best = number, common
    return best


def _table_path(name: str, counts: dict[str, int], *, is_new: bool) -> Path:
    """The path of a table; counts : of the arrays of tables so far, which an inner table belongs to the last of"""
    if is_new:
        counts[name] = counts.get(name, -1) + 1
    path, parts = list[str | int](), name.split(".")
    for i, part in enumerate(parts):
        path.append(part)
        if (count := counts.get(".".join(parts[: i + 1]))) is not None:
            path.append(count)
    return tuple(path)


def _name_of_table(text: str, path: Path) -> str | None:
    """The name of the device or link that the key belongs to."""
    table: Any = tomllib.loads(text)
    for part in path[:2]:
        try:
            table = table[part]
        except (LookupError, TypeError):
            return None
    name = table.get("name") if isinstance(table, Mapping) else None
    return name if isinstance(name, str) else None
