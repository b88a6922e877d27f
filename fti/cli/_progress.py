"""Progress of long work on standard error: a bar in a terminal, elsewhere a line every ten seconds.

Both run in a thread, so that also a step that reports nothing is shown, with its time.
"""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Iterator
from typing import Protocol

from fti.cli._printing import print_line
from fti.terminal_text import escape_controls

PERIOD_S = 10.0


class ShowShare(Protocol):
    """Shows the completed share of a step, 0 to 1; None: unknown."""

    def __call__(self, step: str, share: float | None = None) -> None: ...


@contextlib.contextmanager
def show_progress(step: str) -> Iterator[ShowShare]:
    """Show progress while the block runs.  step : the first one"""
    with _show_bars() if sys.stderr.isatty() else _print_lines() as show:
        show(step)
        yield show


@contextlib.contextmanager
def _show_bars() -> Iterator[ShowShare]:
    """A bar for each step."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskID,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), TimeRemainingColumn()
    tasks: dict[str, TaskID] = {}
    with Progress(
        TextColumn("{task.description}", markup=False), *columns, console=Console(stderr=True), transient=True
    ) as bar:

        def show(step: str, share: float | None = None) -> None:
            if step not in tasks:
                tasks[step] = bar.add_task(escape_controls(step), total=None)
            if share is not None:
                bar.update(tasks[step], total=1.0, completed=min(share, 1.0))

        yield show


@contextlib.contextmanager
def _print_lines() -> Iterator[ShowShare]:
    """A line with the newest step, its share, and the time since the beginning of the work."""
    newest: tuple[str, float | None] = "", None
    begin_s, end = time.monotonic(), threading.Event()

    def show(step: str, share: float | None = None) -> None:
        nonlocal newest
        newest = step, share

    def print_newest() -> None:
        while not end.wait(PERIOD_S):
            step, share = newest
            done = "" if share is None else f" {100.0 * min(share, 1.0):.0f} %,"
            with contextlib.suppress(OSError):  # the reader of standard error has closed it
                print_line(f"{step}:{done} {time.monotonic() - begin_s:.0f} s", error=True, flush=True)

    thread = threading.Thread(target=print_newest, name="fti-progress", daemon=True)
    thread.start()
    try:
        yield show
    finally:
        end.set()
        thread.join()
