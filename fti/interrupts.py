"""An interrupt (SIGINT, Ctrl-C) that is not lost while libraries are loaded.

Python raises KeyboardInterrupt wherever it happens to be.  While a compiled library is being imported, that may be in
code which clears the exception: the program goes on as if nothing had happened.
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
    """Have SIGINT remembered; nothing changes where somebody else handles it, or in a thread."""
    handler, before = InterruptHandler(), signal.getsignal(signal.SIGINT)
    is_ours = before is signal.default_int_handler and threading.current_thread() is threading.main_thread()
    if is_ours:
        signal.signal(signal.SIGINT, handler)
    try:
        yield handler
    finally:
        if is_ours:
            signal.signal(signal.SIGINT, before)
