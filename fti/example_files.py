"""The example files of the package: configurations, scenarios, the files that they name, udev rules, systemd unit."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from fti.errors import MissingError, StorageError, did_you_mean
from fti.new_file import write_new_file

FOLDER = Path(__file__).parent / "examples"
SCENARIOS = FOLDER / "scenarios"
#: Name of all files together.
ALL = "all"


def names() -> list[str]:
    """Names of all files, relative to the folder."""
    return sorted(str(file.relative_to(FOLDER)) for file in FOLDER.rglob("*") if file.is_file())


def title(name: str) -> str:
    """The title of a scenario; of another file its first comment line, to a colon or full stop."""
    text = (FOLDER / name).read_text()
    if name.endswith(".toml") and "title" in (table := tomllib.loads(text)):
        return str(table["title"])
    comment = next((line[2:] for line in text.splitlines() if line.startswith("# ")), "")
    return re.split(r"[:.] |[:.]$", comment)[0]


def copy(name: str, folder: Path) -> list[Path]:
    """Copy a file with all files that it names, a folder, or ``ALL``; returns the new files.

    They keep their places relative to each other.  Raises MissingError without such a file, StorageError when a file
    exists or cannot be written; then nothing is copied.
    """
    copies = {file: folder / file.relative_to(FOLDER) for file in sorted(set(_files_of(name)))}
    for target in copies.values():
        if target.exists():
            raise StorageError(f"{target}: already exists; choose another folder")
    for file, target in copies.items():
        write_new_file(target, file.read_bytes())
    return list(copies.values())


def _files_of(name: str) -> Iterable[Path]:
    known = names()
    if name == ALL:
        return [FOLDER / each for each in known]
    scenarios = [each for each in known if Path(each).stem == name and each.endswith(".toml")]
    for each in (name, f"{name}.toml", *scenarios):
        if each in known:
            return _with_named_files(FOLDER / each)
    if inside := [FOLDER / each for each in known if each.startswith(f"{name.rstrip('/')}/")]:
        return inside
    hint = did_you_mean(name, [*known, *(Path(each).stem for each in known)]) or "; fti examples lists them"
    raise MissingError(f"unknown example {name!r}{hint}")


def _with_named_files(file: Path) -> Iterator[Path]:
    """A file, and the files that its texts name, and theirs."""
    yield file
    if file.suffix == ".toml":
        for text in _texts(tomllib.loads(file.read_text())):
            named = Path(os.path.normpath(file.parent / text))
            if FOLDER in named.parents and named.is_file():
                yield from _with_named_files(named)


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _texts(item)
