"""Single-key input from the terminal of a foreground command."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import termios
import tty
from collections.abc import Callable, Iterator, Mapping


def in_foreground(descriptor: int) -> bool:
    """Is it a terminal that this process may read?  The kernel stops a background job that reads."""
    try:
        return os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError:
        return False


@contextlib.contextmanager
def handle_keys(actions: Mapping[str, Callable[[], None]], descriptor: int | None = None) -> Iterator[bool]:
    """Call the action of each key that is pressed while the block runs; yields False where no keys can be read.

    descriptor : of the terminal; None : standard input
    """
    fd = sys.stdin.fileno() if descriptor is None else descriptor
    if not in_foreground(fd):
        yield False
        return

    def on_input() -> None:
        for key in os.read(fd, 64).decode("ascii", "ignore"):
            if key in actions:
                actions[key]()

    before = termios.tcgetattr(fd)
    tty.setcbreak(fd, termios.TCSANOW)
    loop = asyncio.get_running_loop()
    loop.add_reader(fd, on_input)
    try:
        yield True
    finally:
        loop.remove_reader(fd)
        termios.tcsetattr(fd, termios.TCSANOW, before)
