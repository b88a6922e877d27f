"""Frames of MAVLink: framing, checksum, signature, and the fields of a payload."""

from __future__ import annotations

import binascii
import hashlib
import importlib
import re
import struct
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from msgspec import Struct, defstruct

from fti.drivers._bits import REVERSED
from fti.drivers._framing import Skip

V1, V2 = 0xFE, 0xFD
HEADER_V1, HEADER_V2 = 6, 10
SIGNED = 0x01
SIGNATURE = 13
MAX_CLOCK_LAG_10US = 6_000_000  # [10 us]: a new source or link may be a minute behind the others
FRAME_MAX = HEADER_V2 + 255 + 2 + SIGNATURE
_START = re.compile(rb"[\xfd\xfe]")
#: Length of the payload in version 1, which has no extensions, of the messages that are decoded.
BASE_LENGTH = {
    0: 9, 1: 31, 2: 12, 24: 30, 26: 22, 27: 26, 29: 14, 30: 28, 31: 32, 32: 28, 33: 28, 74: 20, 77: 3, 105: 62, 107: 64,
    111: 16, 113: 36, 116: 22, 129: 22, 132: 14, 136: 22, 137: 14, 143: 14, 251: 18,
    253: 51,
}  # fmt: skip


class MavlinkHeader(Struct, frozen=True, gc=False):
    """Header of a frame: sequence, system, component and message number."""

    sequence: int
    system: int
    component: int
    message: int
    signed: bool


class MessageLayout(NamedTuple):
    """A message of the dialect.

    seed : last byte of the CRC; size : of the payload with all extensions; fields : converts a payload to an object
    """

    name: str
    seed: bytes
    size: int
    fields: Callable[[bytes], Any]


@cache
def dialect_map(dialect: str) -> dict[int, Any]:
    """The messages of a dialect by number, from ``pymavlink``."""
    messages: dict[int, Any] = importlib.import_module(f"pymavlink.dialects.v20.{dialect}").mavlink_map
    return messages


@cache
def layout(dialect: str, number: int) -> MessageLayout | None:
    """A message by number; None if the dialect does not have it."""
    message = dialect_map(dialect).get(number)
    if message is None:
        return None
    return MessageLayout(message.msgname, bytes([message.crc_extra]), message.unpacker.size, _reader(message))


def _reader(message: Any) -> Callable[[bytes], Any]:
    """Function payload -> fields; a short payload is padded with zeros, the excess of a longer one is ignored."""
    names = message.ordered_fieldnames
    kind = defstruct("Fields", names, gc=False)
    unpack, size = struct.Struct(message.unpacker.format).unpack_from, message.unpacker.size
    text = {at for at, code in enumerate(re.findall(r"\d*[a-zA-Z]", message.unpacker.format)) if code.endswith("s")}
    widths = [1 if at in text else max(1, message.array_lengths[at]) for at in range(len(names))]

    def read(payload: bytes) -> Any:
        values = unpack(payload.ljust(size, b"\x00"))
        return kind(*(values if len(values) == len(names) else _grouped(values, widths)))

    return read


def _grouped(values: tuple[Any, ...], widths: list[int]) -> list[Any]:
    groups, at = [], 0
    for width in widths:
        groups.append(values[at] if width == 1 else values[at : at + width])
        at += width
    return groups


def crc(data: bytes) -> int:
    """CRC-16/MCRF4XX: the CCITT polynomial with everything reflected."""
    mirrored = binascii.crc_hqx(data.translate(REVERSED), 0xFFFF)
    return REVERSED[mirrored & 0xFF] << 8 | REVERSED[mirrored >> 8]


def message_id(frame: bytes | bytearray) -> int:
    """Number of the message in a frame."""
    return int.from_bytes(frame[7:10], "little") if frame[0] == V2 else frame[5]


def header(frame: bytes) -> MavlinkHeader:
    """Header of a whole frame."""
    if frame[0] == V2:
        return MavlinkHeader(frame[4], frame[5], frame[6], message_id(frame), bool(frame[2] & SIGNED))
    return MavlinkHeader(frame[2], frame[3], frame[4], frame[5], signed=False)


def payload(frame: bytes) -> bytes:
    """Payload of a whole frame."""
    start = HEADER_V2 if frame[0] == V2 else HEADER_V1
    return frame[start : start + frame[1]]


def signature(key: bytes, frame: bytes | bytearray) -> bytes:
    """Last six bytes of a signed frame: first bytes of SHA-256 over key and all bytes before."""
    return hashlib.sha256(key + frame[:-6]).digest()[:6]


class Frames:
    """Framing with all checks; ``measure`` as in ``fti.drivers._framing``.

    key : 32-byte key of the required signature; None: signatures are not checked
    """

    def __init__(self, dialect: str, key: bytes | None) -> None:
        self._dialect, self._key = dialect, key
        self._signed_at: dict[bytes, int] = {}  # (system, component, link) -> time of the last signature
        self._newest = 0  # of all

    def measure(self, buffer: bytearray) -> int | Skip:
        if buffer[0] not in (V1, V2):
            start = _START.search(buffer)
            return Skip(start.start() if start else len(buffer), "no_sync")
        return self._measure_frame(buffer, HEADER_V2 if buffer[0] == V2 else HEADER_V1)

    def _measure_frame(self, buffer: bytearray, start: int) -> int | Skip:
        if len(buffer) < start:
            return 0
        message = self._expect(buffer, start)
        if isinstance(message, Skip):
            return message
        end = start + buffer[1]
        size = end + 2 + (SIGNATURE if start == HEADER_V2 and buffer[2] & SIGNED else 0)
        if len(buffer) < size:
            return 0
        if crc(bytes(buffer[1:end]) + message.seed) != buffer[end] | buffer[end + 1] << 8:
            return Skip(1, "bad_checksum")
        return size if self._key is None else self._is_authentic(buffer[:size], self._key)

    def _expect(self, buffer: bytearray, start: int) -> MessageLayout | Skip:
        """The message of a header, or why it is rejected."""
        if start == HEADER_V2 and buffer[2] & ~SIGNED:
            return Skip(1, "bad_flags")
        number = message_id(buffer)
        message = layout(self._dialect, number)
        if message is None:
            return Skip(1, "unknown_message")
        if start == HEADER_V1 and buffer[1] != BASE_LENGTH.get(number, min(buffer[1], message.size)):
            return Skip(1, "bad_length")
        return message

    def _is_authentic(self, frame: bytearray, key: bytes) -> int | Skip:
        """Check signature and time: later than the last of its source and link, or of a new one within a minute."""
        if frame[0] == V1 or not frame[2] & SIGNED:
            return Skip(len(frame), "unsigned")
        if frame[-6:] != signature(key, frame):
            return Skip(len(frame), "bad_signature")
        source, time = bytes(frame[5:7] + frame[-13:-12]), int.from_bytes(frame[-12:-6], "little")
        if time <= self._signed_at.get(source, self._newest - MAX_CLOCK_LAG_10US):
            return Skip(len(frame), "replayed")
        self._newest = max(self._newest, time)
        self._signed_at[source] = time
        return len(frame)
