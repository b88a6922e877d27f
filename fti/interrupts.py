"""An interrupt (SIGINT, Ctrl-C) that is not lost during imports.

Python raises KeyboardInterrupt in whatever code is running.  During the import of a compiled library, that code may
clear the exception, and the program continues.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class InterruptHandler:
    """Raises KeyboardInterrupt as Python's own handler does; ``interrupted`` stays true."""

    def __init__(self) -> None:
        self.interrupted = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Called by the interpreter."""
        self.interrupted = True
        signal.default_int_handler(number, frame)


@contextmanager
def track_interrupts() -> Iterator[InterruptHandler]:
    """Record SIGINT; no effect where another handler is installed, or outside the main thread."""
    handler, previous = InterruptHandler(), signal.getsignal(signal.SIGINT)
    is_default = previous is signal.default_int_handler and threading.current_thread() is threading.main_thread()
    if is_default:
        signal.signal(signal.SIGINT, handler)
    try:
        yield handler
    finally:
        if is_default:
            signal.signal(signal.SIGINT, previous)
