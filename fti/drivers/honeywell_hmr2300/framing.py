r"""Message boundaries of an HMR2300: no checksum, no header, and the end character may occur inside.

Text      The pattern of an answer or of an ASCII sample identifies it.  It has priority over a sample of the same
          bytes: a field that begins 4F 4B 0D ("OK\r": X = 1.353 G, Y = 0.22 to 0.24 G) is taken for an answer, and the
          sample is lost.
Boundary  After a binary sample, and after "BINARY ON", the next sample is expected: seven bytes, the last one 0D.  An
          additional or missing byte shifts the samples; if the last byte is then not 0D, the boundary is lost.
Check     A sample at a wrong boundary contains the true end.  A sample with a 0D inside is held until the next
          13 bytes have arrived, one that differs from the last by more than ``MAX_JUMP_COUNTS`` until the next 21.  The
          boundary is lost if neither sample nor text follows, or if the bytes after another 0D are samples as well and
          change much less.  At the true phase a constant field changes by its noise (some counts); at a shifted phase
          low bytes become high bytes, and the change is 256 times as large.
Lock      Without a boundary no sample is released before four ends are found at distances of seven bytes: 22 to 28
          bytes, 0.2 s at 20 Hz; the three samples between them are then released as well.  Of several such phases the
          smoothest one is used, and none if it is not much smoother than all others.

False lock: 2^-32 (2.3e-10) for each byte of noise.  In a true stream a wrong phase has four ends when a high byte stays
0D (an axis between 0.222 and 0.239 G: one in 25 fields of the Earth's magnitude), and smoothness decides.  It fails
only when that axis changes by less than two counts from sample to sample; then no sample is released, or the previous
boundary is kept, which may be wrong just after a connect (therefore the device is stopped first, and "BINARY ON"
precedes its first sample).  An additional byte gives one wrong sample when Z lo is 0D and the sample differs by
less than ``MAX_JUMP_COUNTS``, and two when X hi is 0D, whose column then continues as the end.  A flipped bit in a
sample is not detectable.
"""

from __future__ import annotations

import itertools
import math
import re
import struct
from collections.abc import Iterator

from fti.drivers._framing import Skip

CR = 0x0D
SAMPLE = 7
FULL_SCALE = 30_000
MAX_JUMP_COUNTS, MAX_STILL_COUNTS = 1500, 128  # counts, all axes together: 0.1 G, 8.5 mG
ENDS = 4
LIMIT = 256
#: Bytes that decide a lock: four ends at any of the seven phases.
LOCK_WINDOW = ENDS * SAMPLE
INSIDE_WINDOW, JUMP_WINDOW = 3 * SAMPLE - 1, 4 * SAMPLE - 1
MAX_TEXT_LENGTH = 80

_VALUE = rb"[ +-](?:\d\d,\d{3}| \d,\d{3}|   \d{3}|    \d\d|     \d)  "
TEXT = re.compile(
    rb"(?:(?P<sample>(?:" + _VALUE + rb"){3})"
    rb"|(?P<ascii>ASCII ON)|(?P<binary>BINARY ON)"
    rb"|OK|SET|RST|DONE|WE OFF|Re-enter|(?:S/R|ZERO|AVG) (?:ON|OFF)|ID= ?\d\d|BAUD(?:= ?| )(?:9600|19,200)"
    rb"|SER# [ -~]{1,20}|[SH]/W vers:[ -~]{1,20}|(?:ASCII|BINARY), [ -~]{20,64})\r"
)
LOCK = re.compile(rb"\r(?=" + rb".{6}\r" * (ENDS - 1) + rb")", re.DOTALL)
_COUNTS = struct.Struct(">hhh")


def counts_at(data: bytes | bytearray, at: int) -> tuple[int, int, int]:
    """The three counts of the binary sample at this offset."""
    x, y, z = _COUNTS.unpack_from(data, at)
    return x, y, z


def change(before: tuple[int, int, int], after: tuple[int, int, int]) -> int:
    """Difference of two samples [counts, sum over the axes]."""
    return sum(abs(a - b) for a, b in zip(after, before, strict=True))


def roughness(buffer: bytearray, start: int, count: int) -> float:
    """Sum of the changes of ``count`` samples after an end; infinite if they are not samples."""
    starts = range(start, start + count * SAMPLE, SAMPLE)
    if any(buffer[at - 1] != CR for at in starts if at) or buffer[starts.stop - 1] != CR:
        return math.inf
    return sum(itertools.starmap(change, itertools.pairwise(counts_at(buffer, at) for at in starts)))


def is_smoother(one: float, other: float) -> bool:
    """Is ``one`` smoother by more than the noise of a constant field?"""
    return 4 * one + MAX_STILL_COUNTS < other


def is_in_range(buffer: bytearray, start: int, count: int) -> bool:
    """Are all axes of ``count`` samples within the range of the device?"""
    return all(abs(c) <= FULL_SCALE for k in range(count) for c in counts_at(buffer, start + k * SAMPLE))


def _is_elsewhere(buffer: bytearray, window: int) -> bool:
    """Is the boundary wrong: nothing follows the sample, or samples after another end are smoother?"""
    own = roughness(buffer, 0, 2)
    if own == math.inf and not TEXT.match(buffer[SAMPLE:INSIDE_WINDOW]):
        return True
    ends = (at for at in range(window - 2 * SAMPLE) if buffer[at] == CR and at != SAMPLE - 1)
    return any(is_smoother(roughness(buffer, end + 1, 2), own) for end in ends)


class Boundaries:
    """Finds the messages; ``measure`` as in ``fti.drivers._framing``."""

    def __init__(self) -> None:
        self._is_locked = True  # the first bytes count as the beginning of a message; later checks may reject it
        self._last: tuple[int, int, int] | None = None

    def measure(self, buffer: bytearray) -> int | Skip:
        if self._is_locked:
            size = self._at_boundary(buffer)
            if size is not None:
                return size
        return self._search(buffer)

    def _at_boundary(self, buffer: bytearray) -> int | None:
        """Size of the message, 0 if more bytes are needed, None if the boundary is wrong."""
        if text := TEXT.match(buffer):
            return self._accept_text(text)
        if len(buffer) < SAMPLE:
            return 0
        if buffer[SAMPLE - 1] != CR:
            return None
        window = self._bytes_to_confirm(buffer)
        if len(buffer) < window:
            return 0
        if window and _is_elsewhere(buffer, window):
            return None
        self._last = counts_at(buffer, 0)
        return SAMPLE

    def _bytes_to_confirm(self, buffer: bytearray) -> int:
        """Bytes needed to confirm the sample at the start; 0 if no confirmation is needed."""
        if self._last is not None and change(self._last, counts_at(buffer, 0)) > MAX_JUMP_COUNTS:
            return JUMP_WINDOW
        return INSIDE_WINDOW if CR in buffer[: SAMPLE - 1] else 0

    def _search(self, buffer: bytearray) -> int | Skip:
        """The first complete one: a text, or the bytes that decide a lock."""
        text, lock = TEXT.search(buffer), LOCK.search(buffer)
        if text and (lock is None or text.end() <= lock.start() + LOCK_WINDOW):
            return self._skip(text.start()) or self._accept_text(text)
        if lock is None:
            return self._skip(max(0, len(buffer) - MAX_TEXT_LENGTH)) or 0
        if lock.start():
            return self._skip(lock.start()) or 0
        return self._lock(buffer) if len(buffer) >= LOCK_WINDOW else 0

    def _lock(self, buffer: bytearray) -> int | Skip:
        rated = sorted(self._phases(buffer))
        if not rated or (len(rated) > 1 and not is_smoother(rated[0][0], rated[1][0])):
            self._is_locked = False
            return Skip(1, "ambiguous")
        start = rated[0][1]
        self._is_locked, self._last = True, None
        return Skip(start, "no_boundary")

    def _phases(self, buffer: bytearray) -> Iterator[tuple[float, int]]:
        """Roughness and start of every phase with all ends."""
        for start in range(1, SAMPLE + 1):
            rough = roughness(buffer, start, ENDS - 1)
            if rough < math.inf and is_in_range(buffer, start, ENDS - 1):
                yield rough, start

    def _skip(self, size: int) -> Skip | None:
        if not size:
            return None
        self._is_locked = False
        return Skip(size, "no_boundary")

    def _accept_text(self, text: re.Match[bytes]) -> int:
        if text["sample"] or text["ascii"]:
            self._is_locked = False
        elif text["binary"]:
            self._is_locked, self._last = True, None
        return text.end()
