"""Line errors that a UART driver counts: bytes that were lost or damaged before they were read.

``TIOCGICOUNT`` (Linux, ``include/uapi/linux/serial.h``, ``struct serial_icounter_struct``) reads the counters of a
serial driver since it was loaded.  The first reading after the port was opened is the baseline.  Drivers without it (a
pty, some adapters) refuse; then there are no counts, which is not the same as zero.

    uart_overrun         the receiver's FIFO was full: bytes lost        uart_framing   no stop bit: wrong rate, noise
    uart_buffer_overrun  the kernel's buffer was full: bytes lost        uart_parity    uart_break
"""

from __future__ import annotations

import fcntl
import struct
from collections.abc import Callable
from typing import NamedTuple

from fti.constants import SECOND_NS

TIOCGICOUNT = 0x545D
_ICOUNTER = struct.Struct("@11i36x")  # cts dsr rng dcd rx tx frame overrun parity brk buf_overrun, reserved[9]
_FRAME, _OVERRUN, _PARITY, _BREAK, _BUFFER = 6, 7, 8, 9, 10
_MASK, _HALF = 0xFFFF_FFFF, 2**31
PERIOD_NS = SECOND_NS

#: As ``fcntl.ioctl`` with a buffer.
Ioctl = Callable[[int, int, bytes], bytes]


class LineErrors(NamedTuple):
    """Counters of a driver."""

    uart_overrun: int
    uart_framing: int
    uart_parity: int
    uart_break: int
    uart_buffer_overrun: int


def read_line_errors(fd: int, ioctl: Ioctl = fcntl.ioctl) -> LineErrors | None:
    """The counters of the driver; None if it has none."""
    try:
        counts = _ICOUNTER.unpack(ioctl(fd, TIOCGICOUNT, bytes(_ICOUNTER.size)))
    except OSError:
        return None
    return LineErrors(counts[_OVERRUN], counts[_FRAME], counts[_PARITY], counts[_BREAK], counts[_BUFFER])


class LineWatch:
    """Adds the counters of a driver to the errors of a link, once a second, over all connections.

    errors : of ``LinkStatus``; gets a key for each counter after the first successful reading
    """

    def __init__(self, errors: dict[str, int], ioctl: Ioctl = fcntl.ioctl) -> None:
        self._errors = errors
        self._ioctl = ioctl
        self._last: LineErrors | None = None
        self._due_ns = 0

    def begin(self, fd: int, now_ns: int) -> None:
        """A port was opened: earlier counts are the baseline."""
        self._last = read_line_errors(fd, self._ioctl)
        self._due_ns = now_ns + PERIOD_NS
        for name in LineErrors._fields if self._last else ():
            self._errors.setdefault(name, 0)

    def read_if_due(self, fd: int, now_ns: int) -> None:
        """Read when a second has passed."""
        if now_ns >= self._due_ns:
            self.read(fd)
            self._due_ns = now_ns + PERIOD_NS

    def read(self, fd: int) -> None:
        """Read now, before the port is closed."""
        errors = read_line_errors(fd, self._ioctl) if self._last else None
        if errors is None or self._last is None:
            return
        for name, before, after in zip(LineErrors._fields, self._last, errors, strict=True):
            increment = (after - before) & _MASK
            self._errors[name] += increment if increment < _HALF else after & _MASK  # the counter was reset
        self._last = errors
