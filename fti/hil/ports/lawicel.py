"""A Lawicel (slcan) adapter, the adapter's side: commands of the host and their answers.

Document: Lawicel AB, CAN232 manual, version 3 (2013), ASCII commands; the frames are those of ``fti.links.slcan``.

    S0..S8 sxxyy Zn  settings: CR        O L C  open, listen only, close: CR
    V N              version, serial number
    F                status flags (``fti.links.slcan_status``), then cleared: Fxx CR with an open channel, else BEL
    t T r R ...      a frame: z CR or Z CR when the channel is open, else BEL
    anything else    BEL
"""

from __future__ import annotations

from collections.abc import Callable

from fti.links.slcan import FORMS, MAX_LINE_BYTES, parse_line

OK, ERROR = b"\r", b"\a"
#: Answers that do not depend on the rest of the command.
ANSWERS = {b"V": b"V1013\r", b"N": b"NF001\r", b"S": OK, b"s": OK, b"Z": OK, b"": OK}


class Adapter:
    """State of an adapter.  ``feed`` takes host bytes and returns the answers; ``on_frame`` gets the host's frames.

    flags : status flags of the controller; faults add to them
    """

    def __init__(self, on_frame: Callable[[bytes], None]) -> None:
        self.is_open = False
        self.flags = 0
        self._on_frame = on_frame
        self._line = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """Answers to the commands that are complete with these bytes."""
        *lines, rest = (bytes(self._line) + data).split(b"\r")
        self._line[:] = rest[-MAX_LINE_BYTES:]
        return [self._command(line) for line in lines]

    def _command(self, line: bytes) -> bytes:
        letter = line[:1]
        if letter in (b"O", b"L", b"C"):
            self.is_open = letter != b"C"
            return OK
        if letter and letter[0] in FORMS:
            frame = parse_line(line)
            if frame is None or not self.is_open:
                return ERROR
            self._on_frame(frame)
            return b"Z\r" if letter.isupper() else b"z\r"
        if line == b"F" and self.is_open:
            flags, self.flags = self.flags, 0
            return b"F%02X\r" % flags
        return ANSWERS.get(letter, ERROR)
