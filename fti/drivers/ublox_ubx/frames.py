"""Framing of a u-blox line: UBX, NMEA 0183 and RTCM 3 after one another, as a receiver sends them on one port.

A corrupted length must not swallow what follows, so a length that the message cannot have is refused before its
bytes have come: a repeated message must have the length that its own count says, a fixed one that is known may have
grown by a little, and anything else is at most ``MAX_MESSAGE_BYTES`` bytes.
"""

from __future__ import annotations

import re
from itertools import accumulate
from typing import NamedTuple

from fti.drivers._framing import Skip
from fti.drivers._nmea_framing import measure_sentence

SYNC = b"\xb5\x62"
RTCM_START = 0xD3
HEADER, OVERHEAD = 6, 8
#: Most bytes of a message; a RXM-RAWX whose count of signals agrees may have more.
MAX_MESSAGE_BYTES, MAX_HELD_BYTES = 4096, 8192
#: A later revision may append this much to a message of fixed length.
GROWTH = 64

_NO_START = re.compile(rb"[^$!#\xb5\xd3]+")
_COMMENT = re.compile(rb"[^$!\xb5\xd3\n]*\n?")


class PayloadShape(NamedTuple):
    """Length of a payload: ``size`` and, if it repeats, ``step`` bytes as often as the byte at ``count_at`` says."""

    size: int
    step: int = 0
    count_at: int = 0


def checksum(body: bytes | bytearray) -> bytes:
    """The 8-bit Fletcher sums over class, id, length and payload (RFC 1145)."""
    return bytes((sum(body) & 0xFF, sum(accumulate(body)) & 0xFF))


def frame(class_id: int, message_id: int, payload: bytes) -> bytes:
    """A whole message."""
    body = bytes((class_id, message_id)) + len(payload).to_bytes(2, "little") + payload
    return SYNC + body + checksum(body)


def measure_ubx(buffer: bytearray, shapes: dict[tuple[int, int], PayloadShape]) -> int | Skip:
    """A UBX message that may begin here."""
    if len(buffer) > 1 and buffer[1] != SYNC[1]:
        return Skip(1, "no_sync")
    if len(buffer) < HEADER:
        return 0
    size = buffer[4] | buffer[5] << 8
    if not _may_be(buffer, size, shapes.get((buffer[2], buffer[3]))):
        return Skip(2, "bad_length")
    whole = size + OVERHEAD
    if len(buffer) < whole:
        return 0
    if checksum(buffer[2 : whole - 2]) != buffer[whole - 2 : whole]:
        return Skip(2, "bad_checksum")
    return whole


def _may_be(buffer: bytearray, size: int, shape: PayloadShape | None) -> bool:
    if shape is None:
        return size <= MAX_MESSAGE_BYTES - OVERHEAD
    if size < shape.size:  # too short for its fields; the checksum will tell whether it was sent so
        return True
    if not shape.step:
        return size <= shape.size + GROWTH
    at = HEADER + shape.count_at
    if len(buffer) <= at:
        return (size - shape.size) % shape.step == 0 and size <= MAX_HELD_BYTES - OVERHEAD
    return size == shape.size + shape.step * buffer[at] and size <= MAX_HELD_BYTES - OVERHEAD


# ---------------------------------------------------------------------------------------------------------- RTCM 3


def _crc24q_table() -> tuple[int, ...]:
    found = []
    for byte in range(256):
        value = byte << 16
        for _ in range(8):
            value = value << 1 ^ (0x1864CFB if value & 0x800000 else 0)
        found.append(value)
    return tuple(found)


_CRC24Q = _crc24q_table()


def crc24q(data: bytes | bytearray) -> int:
    """CRC-24Q of RTCM 3 (polynomial 0x1864CFB, initial value 0)."""
    value = 0
    for byte in data:
        value = (value << 8 & 0xFFFFFF) ^ _CRC24Q[value >> 16 ^ byte]
    return value


def measure_rtcm(buffer: bytearray) -> int | Skip:
    """An RTCM 3 frame that may begin here: 0xD3, six bits of zero, ten of length, payload, CRC-24Q."""
    if len(buffer) > 1 and buffer[1] & 0xFC:
        return Skip(1, "no_sync")
    if len(buffer) < 3:
        return 0
    whole = (buffer[1] << 8 | buffer[2]) + 6
    if len(buffer) < whole:
        return 0
    if crc24q(buffer[: whole - 3]) != int.from_bytes(buffer[whole - 3 : whole], "big"):
        return Skip(1, "bad_checksum")
    return whole


def rtcm_name(found: bytes) -> str:
    """The name of an RTCM 3 frame, after the 12 bits that its payload begins with."""
    return f"RTCM {found[3] << 4 | found[4] >> 4}" if len(found) >= 8 else "RTCM"


# ------------------------------------------------------------------------------------------------------------ line


class PortFraming:
    """The three kinds of message; see ``fti.drivers._framing``.  It remembers whether a comment goes on."""

    def __init__(self, shapes: dict[tuple[int, int], PayloadShape]) -> None:
        self._shapes = shapes
        self._comment = False

    def measure(self, buffer: bytearray) -> int | Skip:
        """What stands at the beginning."""
        first = buffer[0]
        if first == SYNC[0]:
            return measure_ubx(buffer, self._shapes)
        if first in b"$!":
            self._comment = False
            return measure_sentence(buffer)
        if first == RTCM_START:
            return measure_rtcm(buffer)
        return self._measure_gap(buffer)

    def _measure_gap(self, buffer: bytearray) -> Skip:
        self._comment = self._comment or buffer[0] == ord("#")
        found = (_COMMENT if self._comment else _NO_START).match(buffer)
        assert found is not None
        reason = "comment" if self._comment else "no_sync"
        self._comment = self._comment and buffer[found.end() - 1] != ord("\n")
        return Skip(found.end(), reason)
