"""Framing of a u-blox line: UBX, NMEA 0183 and RTCM 3 messages on one port.

A corrupted length must not block the stream, so an impossible length is rejected before its bytes arrive: a message
with repeated parts must have the length of its count, a known one of fixed length may have a small extension, and
others have at most ``MAX_MESSAGE_BYTES`` bytes.
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
#: Maximum size of a message; a RXM-RAWX with a matching count of signals may be larger.
MAX_MESSAGE_BYTES, MAX_HELD_BYTES = 4096, 8192
#: A later revision may append this much to a message of fixed length.
GROWTH = 64

_NO_START = re.compile(rb"[^$!#\xb5\xd3]+")
_COMMENT = re.compile(rb"[^$!\xb5\xd3\n]*\n?")


class PayloadShape(NamedTuple):
    """Length of a payload: ``size`` and, if it repeats, ``step`` bytes times the byte at ``count_at``."""

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
    """Size of a UBX message at the start, or a Skip."""
    if len(buffer) > 1 and buffer[1] != SYNC[1]:
        return Skip(1, "no_sync")
    if len(buffer) < HEADER:
        return 0
    size = buffer[4] | buffer[5] << 8
    if not _may_be(buffer, size, shapes.get((buffer[2], buffer[3]))):
        return Skip(2, "bad_length")
    length = size + OVERHEAD
    if len(buffer) < length:
        return 0
    if checksum(buffer[2 : length - 2]) != buffer[length - 2 : length]:
        return Skip(2, "bad_checksum")
    return length


def _may_be(buffer: bytearray, size: int, shape: PayloadShape | None) -> bool:
    if shape is None:
        return size <= MAX_MESSAGE_BYTES - OVERHEAD
    if size < shape.size:  # too short for its fields; the checksum decides
        return True
    if not shape.step:
        return size <= shape.size + GROWTH
    at = HEADER + shape.count_at
    if len(buffer) <= at:
        return (size - shape.size) % shape.step == 0 and size <= MAX_HELD_BYTES - OVERHEAD
    return size == shape.size + shape.step * buffer[at] and size <= MAX_HELD_BYTES - OVERHEAD


# ---------------------------------------------------------------------------------------------------------- RTCM 3


def _crc24q_entry(byte: int) -> int:
    value = byte << 16
    for _ in range(8):
        value = value << 1 ^ (0x1864CFB if value & 0x800000 else 0)
    return value


_CRC24Q = tuple(map(_crc24q_entry, range(256)))


def crc24q(data: bytes | bytearray) -> int:
    """CRC-24Q of RTCM 3 (polynomial 0x1864CFB, initial value 0)."""
    value = 0
    for byte in data:
        value = (value << 8 & 0xFFFFFF) ^ _CRC24Q[value >> 16 ^ byte]
    return value


def measure_rtcm(buffer: bytearray) -> int | Skip:
    """Size of an RTCM 3 frame at the start: 0xD3, six bits of zero, ten of length, payload, CRC-24Q."""
    if len(buffer) > 1 and buffer[1] & 0xFC:
        return Skip(1, "no_sync")
    if len(buffer) < 3:
        return 0
    length = (buffer[1] << 8 | buffer[2]) + 6
    if len(buffer) < length:
        return 0
    if crc24q(buffer[: length - 3]) != int.from_bytes(buffer[length - 3 : length], "big"):
        return Skip(1, "bad_checksum")
    return length


def rtcm_name(frame: bytes) -> str:
    """The name of an RTCM 3 frame, from the first 12 bits of its payload."""
    return f"RTCM {frame[3] << 4 | frame[4] >> 4}" if len(frame) >= 8 else "RTCM"


# ------------------------------------------------------------------------------------------------------------ line


class PortFraming:
    """The three kinds of message; see ``fti.drivers._framing``.  Stateful: a comment may continue."""

    def __init__(self, shapes: dict[tuple[int, int], PayloadShape]) -> None:
        self._shapes = shapes
        self._comment = False

    def measure(self, buffer: bytearray) -> int | Skip:
        """Size of the message at the start of the buffer, or a Skip."""
        first = buffer[0]
        if first == SYNC[0]:
            return measure_ubx(buffer, self._shapes)
        if first in b"$!":
            self._comment = False
            return measure_sentence(buffer)
        if first == RTCM_START:
            return measure_rtcm(buffer)
        self._comment = self._comment or buffer[0] == ord("#")
        match = (_COMMENT if self._comment else _NO_START).match(buffer)
        assert match is not None
        reason = "comment" if self._comment else "no_sync"
        self._comment = self._comment and buffer[match.end() - 1] != ord("\n")
        return Skip(match.end(), reason)
