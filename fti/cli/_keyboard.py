"""Keys of a terminal, while a command runs in its foreground; elsewhere there are none."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import termios
import tty
from collections.abc import Callable, Iterator, Mapping


def in_foreground(descriptor: int) -> bool:
    """Is it a terminal that we may read?  A job in the background would be stopped by trying."""
    try:
        return os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError:
        return False


@contextlib.contextmanager
def handle_keys(actions: Mapping[str, Callable[[], None]], descriptor: int | None = None) -> Iterator[bool]:
    """Let each key of ``actions`` do something while the block runs; gives whether there are keys.

    descriptor : of the terminal; none : standard input
    """
    fd = sys.stdin.fileno() if descriptor is None else descriptor
    if not in_foreground(fd):
        yield False
        return

    def pressed() -> None:
        for key in os.read(fd, 64).decode("ascii", "ignore"):
            actions.get(key, _ignore_key)()

    before = termios.tcgetattr(fd)
    tty.setcbreak(fd, termios.TCSANOW)
    loop = asyncio.get_running_loop()
    loop.add_reader(fd, pressed)
    try:
        yield True
    finally:
        loop.remove_reader(fd)
        termios.tcsetattr(fd, termios.TCSANOW, before)


def _ignore_key() -> None:
    """Any other key."""
