"""Output on standard error while a recording is read: remarks, progress, file faults."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from fti.cli._printing import print_line
from fti.cli._progress import show_progress
from fti.logger.reading.file_statistics import file_statistics
from fti.logger.reading.recording import Recording


@contextmanager
def show_read_progress(
    recording: Recording, title: str, passes: int = 1, files: Sequence[Path] | None = None
) -> Iterator[None]:
    """Show the read position.  passes : how often the files are read; files : that are read (default: all)"""
    total = passes * sum(path.stat().st_size for path in (recording.files if files is None else files))
    done, last = 0, (Path(), 0)

    def advance(path: Path, position: int) -> None:
        nonlocal done, last
        done += position - (last[1] if path == last[0] and position >= last[1] else 0)
        last = path, position
        show(title, done / max(total, 1))

    with show_progress(title) as show:
        recording.on_read = advance
        try:
            yield
        finally:
            recording.on_read = None


@contextmanager
def show_frame_progress(recording: Recording, title: str) -> Iterator[Callable[[int], None]]:
    """Yield the function that shows the number of frames done; their total is known from the summaries of the files."""
    total = sum(statistics.message_count for statistics in file_statistics(recording.frame_files))
    with show_progress(title) as show:
        yield lambda done: show(title, done / total if total else None)


def report_remarks(recording: Recording, known: str = "") -> None:
    """Print the remarks on a recording: it is a snapshot, more of it lies elsewhere.

    known : remark that the result contains itself
    """
    from fti.logger.reading.session_metadata import remarks

    for text in (text for text in remarks(recording) if text != known):
        print_line(f"note: {text}", error=True)


def report_faults(recording: Recording) -> None:
    """Print which files could not be read to their end."""
    for fault in recording.faults.values():
        print_line(f"fti: {fault.path}: {fault.text}", error=True)
