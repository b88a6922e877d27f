"""Output on standard error while a recording is read: remarks, a progress bar (in a terminal), file faults."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from fti.cli._printing import print_line
from fti.logger.reading.recording import Recording
from fti.terminal_text import escape_controls

if TYPE_CHECKING:
    from rich.progress import Progress

#: Period of the lines of progress without a terminal.
LINE_PERIOD_S = 10.0


def progress_bar() -> Progress:
    """A bar on standard error; nothing where that is not a terminal."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    return Progress(console=console, transient=True, disable=not console.is_terminal)


def bar_title(text: str) -> str:
    """A text from a file as the title of a bar; ``[...]`` is escaped, which rich takes for markup."""
    from rich.markup import escape

    return escape(escape_controls(text))


@contextmanager
def show_read_progress(recording: Recording, title: str, passes: int = 1) -> Iterator[None]:
    """Show the read position as a bar, without a terminal as a line every 10 s.

    title : before the bar; passes : how often all files are read
    """
    from rich.console import Console
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    total = passes * sum(path.stat().st_size for path in recording.files)
    columns = TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TimeRemainingColumn()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(title, total=total)
        last = Path(), 0
        due_s = time.monotonic() + LINE_PERIOD_S

        def advance(path: Path, position: int) -> None:
            nonlocal last, due_s
            same = path == last[0] and position >= last[1]
            bar.advance(task, position - (last[1] if same else 0))
            last = path, position
            if bar.disable and time.monotonic() > due_s:
                due_s = time.monotonic() + LINE_PERIOD_S
                print_line(f"{title}: {min(bar.tasks[task].percentage, 99):.0f} %", error=True)

        recording.on_read = advance
        try:
            yield
        finally:
            recording.on_read = None


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
