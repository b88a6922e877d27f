"""Compress session files, or restore the originals.

Rewrites each finished file with zstd chunks, index and summary, reads it back, and replaces the original only after
the restored bytes are verified equal to it.  Every command, and every MCAP reader, reads packed files.  --undo restores
the originals: the same bytes, checked by SHA-256.  Use it after landing.

Files that are unfinished, damaged or being written are left unchanged, and so are all files when the disk is full or
the command is interrupted.  The disk needs free space for the largest packed file.  Exit code 0: done; 3: a file was
left unchanged.

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
    parser.add_argument("--undo", action="store_true", help="restore the original files")
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Pack or unpack every file; 3 when a file was left unchanged."""
    from fti.cli._progress import show_progress
    from fti.errors import RecordingError
    from fti.logger.packing.pack import pack, unpack
    from fti.logger.recovery.extract import session_files

    work = unpack if args.undo else pack
    results: list[PackResult] = []
    refused: list[str] = []
    paths = session_files(Path(args.session))
    with show_progress("packing") as show:
        for path in paths:
            total = path.stat().st_size * (1 if args.undo else 2)
            try:
                packed = work(path, lambda done, path=path, total=total: show(path.name, done / total))  # type: ignore[misc]
            except RecordingError as error:
                refused.append(str(error))
                continue
            if packed:
                results.append(packed)
    for text in refused:
        print_line(f"fti: {text}", error=True)
    print_json(as_json(results, refused)) if args.json else print_lines(as_text(results, len(paths)))
    return 3 if refused else 0


def as_json(results: list[PackResult], refused: list[str]) -> dict[str, Any]:
    """The result as JSON."""
    files = [{"file": str(packed.path), "before": packed.before, "after": packed.after} for packed in results]
    return {"files": files, "refused": refused}


def as_text(results: list[PackResult], files: int) -> Iterator[str]:
    """The result as lines of text."""
    for packed in results:
        yield f"{packed.path.name}: {_change(packed.before, packed.after)}"
    before, after = sum(packed.before for packed in results), sum(packed.after for packed in results)
    yield f"{len(results)} of {files} files rewritten: {_change(before, after)}" if results else "nothing was rewritten"


def _change(before: int, after: int) -> str:
    times = max(before, after) / max(min(before, after), 1)
    return f"{before} bytes are now {after} ({times:.2f} times {'less' if after <= before else 'more'})"
