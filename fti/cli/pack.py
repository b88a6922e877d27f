"""Compress the files of a session after landing, or make them again what they were.

Each finished file is rewritten with zstd chunks, index and summary, read back, and proved to give the original byte
for byte; only then it takes the place of the original.  Every command, and every MCAP reader, reads packed files.
--undo brings the originals back: the same bytes, by their SHA-256.

A file that is not finished, damaged or being written is left as it is, and so is every file when the medium is full
or the command is interrupted.  There must be room for the largest packed file beside it.  Exit code 0: done; 3: a
file was left as it is.

  fti pack data/da42_20260102T030405Z_0
  fti pack data/da42_20260102T030405Z_0 --undo
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fti.cli._printing import print_json, print_line, print_lines

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fti.logger.packing.pack import PackResult


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SESSION, --undo and --json."""
    parser.add_argument("session", metavar="SESSION", help="session folder or MCAP file")
    parser.add_argument("--undo", action="store_true", help="bring the original files back")
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Pack or unpack every file; 3 when one had to be left as it is."""
    from fti.cli._read_report import bar_title, progress_bar
    from fti.errors import RecordingError
    from fti.logger.packing.pack import pack, unpack
    from fti.logger.recovery.extract import session_files

    work = unpack if args.undo else pack
    done: list[PackResult] = []
    refused: list[str] = []
    paths = session_files(Path(args.session))
    with progress_bar() as bar:
        for path in paths:
            task = bar.add_task(bar_title(path.name), total=path.stat().st_size * (1 if args.undo else 2))
            try:
                packed = work(path, lambda n, task=task: bar.update(task, completed=n))  # type: ignore[misc]
            except RecordingError as error:
                refused.append(str(error))
                continue
            finally:
                bar.remove_task(task)
            if packed:
                done.append(packed)
    for text in refused:
        print_line(f"fti: {text}", error=True)
    print_json(as_json(done, refused)) if args.json else print_lines(as_text(done, len(paths)))
    return 3 if refused else 0


def as_json(done: list[PackResult], refused: list[str]) -> dict[str, Any]:
    """What was done, for programs."""
    files = [{"file": str(packed.path), "before": packed.before, "after": packed.after} for packed in done]
    return {"files": files, "refused": refused}


def as_text(done: list[PackResult], files: int) -> Iterator[str]:
    """Lines for a person."""
    for packed in done:
        yield f"{packed.path.name}: {_change(packed.before, packed.after)}"
    before, after = sum(packed.before for packed in done), sum(packed.after for packed in done)
    yield f"{len(done)} of {files} files rewritten: {_change(before, after)}" if done else "nothing was rewritten"


def _change(before: int, after: int) -> str:
    times = max(before, after) / max(min(before, after), 1)
    return f"{before} bytes are now {after} ({times:.2f} times {'less' if after <= before else 'more'})"
