"""Lawicel (slcan) adapter: the ASCII protocol between a host and a CAN adapter on a serial line.

Document: Lawicel AB, CAN232 manual, version 3 (2013), ASCII commands.

    host -> adapter   S0..S8 sxxyy   bit rate        O  L  C   open, listen only, close
                      V N F          version, serial number, status flags
                      tiiildd..      standard frame: 3 hex digits id, length, data
                      Tiiiiiiiildd.. extended frame; r, R remote frames
    adapter -> host   CR ok, BEL error; ``z``/``Z`` CR after a frame taken; frames as above while open

A frame here is a ``can_frame`` of 16 bytes, see ``fti.canframe``.
"""

from __future__ import annotations

from collections.abc import Callable

from fti.canframe import pack_can, unpack_can

OK, ERROR = b"\r", b"\a"
#: Answers that do not depend on the rest of the command.
ANSWERS = {b"V": b"V1013\r", b"N": b"NF001\r", b"F": b"F00\r", b"S": OK, b"s": OK, b"Z": OK, b"": OK}
FRAME_LETTERS = (b"t", b"T", b"r", b"R")
MAX_LINE = 64


def to_lawicel(frame: bytes) -> bytes:
    """A ``can_frame`` as the adapter sends it; empty for an error frame, which it does not pass on.

    Raises ValueError for a CAN FD frame: the protocol has none.
    """
    found = unpack_can(frame)
    if found.fd:
        raise ValueError("a Lawicel adapter carries classic CAN frames, not CAN FD")
    if found.error:
        return b""
    letter = "r" if found.remote else "t"
    shown = f"{letter.upper()}{found.can_id:08X}" if found.extended else f"{letter}{found.can_id:03X}"
    body = "" if found.remote else found.data.hex().upper()
    return f"{shown}{len(found.data)}{body}\r".encode()


def from_lawicel(line: bytes) -> bytes:
    """A ``t``, ``T``, ``r`` or ``R`` line (without CR) as a 16-byte ``can_frame``.  ValueError when malformed."""
    extended, remote = line[:1] in b"TR", line[:1] in b"rR"
    digits = 8 if extended else 3
    can_id, length = int(line[1 : 1 + digits], 16), int(line[1 + digits : 2 + digits])
    data = bytes(length) if remote else bytes.fromhex(line[2 + digits :].decode("ascii"))
    if len(data) != length:
        raise ValueError(f"a frame that says {length} bytes has {len(data)}")
    return pack_can(can_id, data, extended=extended, remote=remote)


class Adapter:
    """The adapter's state.  ``feed`` host bytes, get the answers; ``on_frame`` gets the frames that the host sends."""

    def __init__(self, on_frame: Callable[[bytes], None]) -> None:
        self.is_open = False
        self._on_frame = on_frame
        self._line = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """Answers to the commands that are complete with these bytes."""
        *lines, rest = (bytes(self._line) + data).split(b"\r")
        self._line[:] = rest[-MAX_LINE:]
        return [self._command(line) for line in lines]

    def _command(self, line: bytes) -> bytes:
        letter = line[:1]
        if letter in (b"O", b"L", b"C"):
            self.is_open = letter != b"C"
            return OK
        if letter in FRAME_LETTERS:
            return self._take_frame(line)
        return ANSWERS.get(letter, ERROR)

    def _take_frame(self, line: bytes) -> bytes:
        if not self.is_open:
            return ERROR
        try:
            frame = from_lawicel(line)
        except ValueError:
            return ERROR
        self._on_frame(frame)
        return b"z\r" if line[:1] in (b"t", b"r") else b"Z\r"
