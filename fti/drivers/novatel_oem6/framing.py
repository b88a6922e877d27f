"""Frames of NovAtel receivers: binary with long or short header, ASCII, answers to abbreviated commands.

The header of a binary frame has an unprotected length.  A length that contradicts the size of a known message, or the
count in its body, is rejected at once: a damaged length then delays only a few bytes.
"""

from __future__ import annotations

import re
import struct
import zlib
from typing import NamedTuple

from fti.drivers._framing import Skip

SYNC, SHORT_SYNC = b"\xaa\x44\x12", b"\xaa\x44\x13"
HEADER = struct.Struct("<3sBHBBHHBBHIIHH")
SHORT_HEADER = struct.Struct("<3sBHHI")
CRC_SIZE = 4
HEADER_MAX = 64
RESPONSE_BIT = 0x80
SOURCE_BITS, SECOND_ANTENNA = 0x1F, 1  # of the message type; OEM4 and OEMV leave other values there

#: Maximum size of a frame; one with a matching count of entries may be larger.
PLAIN_MAX, COUNTED_MAX = 4096, 24_576
TEXT_MAX, RESPONSE_MAX = 20_480, 220
NAME_MAX = 32
OK, ERROR = b"<OK", b"<ERROR:"
#: Permitted extension of a message in newer versions [bytes].
GROWTH = 64

_START = re.compile(rb"\xaa(?:\x44(?:[\x12\x13]|\Z)|\Z)|[#%<\[]")
_ASCII = re.compile(rb"[#%][A-Z][A-Z0-9_]+,[\x20-\x22\x24-\x29\x2b-\x7e]*\*[0-9A-Fa-f]{8}\r?\n")
_RESPONSE = re.compile(rb"<(?:OK|ERROR:[\x20-\x22\x24-\x7e]{1,200})\r?\n")
_PROMPT = re.compile(rb"\[[A-Z]{2,6}[0-9]{0,2}(?:_[0-9]{1,2})?\]")
_LINE = re.compile(rb"[\x20-\x22\x24-\x7e]*")  # a # begins the next message


class BodyShape(NamedTuple):
    """Size of a body: ``size`` bytes, and ``step`` for each entry; the count of entries (u32) is at ``at``."""

    size: int
    step: int = 0
    at: int = 0


#: Shapes by message number, of decoded messages and of others with many entries.
SHAPES = {
    5: BodyShape(4, 32), 16: BodyShape(132), 41: BodyShape(102), 42: BodyShape(72), 43: BodyShape(4, 44),
    48: BodyShape(12, 40, 8), 73: BodyShape(4, 112), 83: BodyShape(16, 40, 12), 93: BodyShape(8, 16, 4),
    99: BodyShape(44), 101: BodyShape(44), 140: BodyShape(4, 24), 174: BodyShape(28, 4, 24),
    1043: BodyShape(16, 40, 12), 1194: BodyShape(4, 16), 1451: BodyShape(4, 72),
}  # fmt: skip


class NovatelHeader(NamedTuple):
    """The long header, as on the wire."""

    sync: bytes
    length: int
    message_id: int
    message_type: int
    port: int
    body_length: int
    sequence: int
    idle_time: int
    time_status: int
    week: int
    milliseconds: int
    receiver_status: int
    reserved: int
    version: int


def crc32(data: bytes | bytearray) -> int:
    """CRC-32 of the document: reflected 0xEDB88320, begun at 0, not inverted at the end."""
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def encode_frame(header: NovatelHeader, body: bytes) -> bytes:
    """A binary frame; lengths and CRC are set here."""
    data = HEADER.pack(*header._replace(sync=SYNC, length=HEADER.size, body_length=len(body))) + body
    return data + crc32(data).to_bytes(CRC_SIZE, "little")


def encode_text(text: str) -> bytes:
    """An ASCII message; start, CRC and end of line are added here."""
    data = text.encode("ascii")
    return b"#%s*%08x\r\n" % (data, crc32(data))


def split(frame: bytes) -> tuple[NovatelHeader, bytes]:
    """Header and body of a binary frame with long header."""
    header = NovatelHeader._make(HEADER.unpack_from(frame))
    return header, frame[header.length : header.length + header.body_length]


def measure(buffer: bytearray) -> int | Skip:
    """Framing; see ``fti.drivers._framing``."""
    match = _START.search(buffer)
    if match is None or match.start():
        return Skip(match.start() if match else len(buffer), "no_sync")
    if buffer[0] == SYNC[0]:
        return _measure_binary(buffer)
    return measure_text(buffer)


def _measure_binary(buffer: bytearray) -> int | Skip:
    if len(buffer) < HEADER.size // 2:  # the length fields are in the first half of both headers
        return 0
    is_short = buffer[2] == SHORT_SYNC[2]
    length = SHORT_HEADER.size + buffer[3] + CRC_SIZE if is_short else _long_length(buffer)
    if isinstance(length, Skip) or len(buffer) < length:
        return length if isinstance(length, Skip) else 0
    good = crc32(buffer[: length - CRC_SIZE]) == int.from_bytes(buffer[length - CRC_SIZE : length], "little")
    return length if good else Skip(1, "bad_checksum")


def _long_length(buffer: bytearray) -> int | Skip:
    """Length of the whole frame, or a Skip."""
    header, body = buffer[3], buffer[8] | buffer[9] << 8
    if not HEADER.size <= header <= HEADER_MAX:
        return Skip(1, "bad_header")
    total = header + body + CRC_SIZE
    shape = None if buffer[6] & RESPONSE_BIT else SHAPES.get(buffer[4] | buffer[5] << 8)
    if shape is None:
        return total if total <= PLAIN_MAX else Skip(1, "bad_length")
    if not shape.step:
        return total if shape.size <= body <= shape.size + GROWTH else Skip(1, "bad_length")
    if body < shape.size or (body - shape.size) % shape.step or total > COUNTED_MAX:
        return Skip(1, "bad_length")
    at = header + shape.at
    if len(buffer) < at + 4:
        return total
    count = int.from_bytes(buffer[at : at + 4], "little")
    return total if body == shape.size + count * shape.step else Skip(1, "bad_length")


def measure_text(buffer: bytearray) -> int | Skip:
    """An ASCII message, an answer to an abbreviated command, or the prompt of a port."""
    if buffer[0] == ord("["):
        return _measure_prompt(buffer)
    is_response = buffer[0] == ord("<")
    match = _LINE.match(buffer, 1)
    assert match is not None
    end = match.end()
    head = buffer[: len(ERROR)]
    if is_response:
        named = OK.startswith(head) or ERROR.startswith(head) or head.startswith(OK)
    else:
        named = end < NAME_MAX or b"," in buffer[:NAME_MAX]
    if end > (RESPONSE_MAX if is_response else TEXT_MAX) or not named:
        return Skip(1, "bad_text")
    if end == len(buffer) or (buffer[end] == ord("\r") and end + 1 == len(buffer)):
        return 0
    match = (_RESPONSE if is_response else _ASCII).match(buffer)
    if match is None:
        return Skip(1, "bad_text")
    if is_response:
        return match.end()
    star = buffer.index(b"*")
    good = crc32(buffer[1:star]) == int(buffer[star + 1 : star + 9], 16)
    return match.end() if good else Skip(1, "bad_checksum")


def _measure_prompt(buffer: bytearray) -> int | Skip:
    """``[COM1]``: skipped."""
    match = _PROMPT.match(buffer)
    if match:
        return Skip(match.end(), "prompt")
    name = _LINE.match(buffer, 1)
    assert name is not None
    return 0 if name.end() == len(buffer) < 14 and b"]" not in buffer else Skip(1, "bad_text")
