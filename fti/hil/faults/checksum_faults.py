"""Position of the checksum in a message, and how it is corrupted; the rest of the message is unchanged.

A function returns None if messages have no checksum with these options.  A change returns a single message without a
checksum unchanged (the answer "OK" of a device whose data have one).
"""

from __future__ import annotations

import re
from collections.abc import Callable

from fti.drivers import arinc429, ascii_line, binary_struct, freeflight_ra4500
from fti.drivers.arinc429 import apmp
from fti.drivers.freeflight_ra4500 import DLE, HEADER, TRAILER
from fti.drivers.mavlink.wire import HEADER_V1, HEADER_V2, V2
from fti.drivers.novatel_oem6.framing import CRC_SIZE
from fti.drivers.ublox_ubx.frames import SYNC as UBX

MessageChange = Callable[[bytes], bytes]
_HEX = re.compile(rb"(?<=\*)[0-9A-Fa-f]+(?=\r?\n\Z)")


def flip_byte(message: bytes, at: int) -> bytes:
    """The message with every bit of one byte inverted.  at : index, negative from the end"""
    data = bytearray(message)
    data[at] ^= 0xFF
    return bytes(data)


def change_text_checksum(message: bytes) -> bytes:
    """Invert the hexadecimal checksum after the asterisk: NMEA 0183, ASCII of NovAtel."""
    found = _HEX.search(message)
    if found is None:
        return message
    size = len(found[0])
    wrong = int(found[0], 16) ^ (1 << 4 * size) - 1
    return message[: found.start()] + b"%0*X" % (size, wrong) + message[found.end() :]


def nmea_change(options: object) -> MessageChange:
    """Two digits after the asterisk."""
    return change_text_checksum


def ublox_change(options: object) -> MessageChange:
    """CK_B, the last byte of a UBX message; the checksum of an NMEA sentence."""
    return lambda message: flip_byte(message, -1) if message.startswith(UBX) else change_text_checksum(message)


def novatel_change(options: object) -> MessageChange:
    """The last four bytes of a binary message (CRC); the eight digits of an ASCII message."""
    return lambda message: flip_byte(message, -CRC_SIZE) if message[:1] == b"\xaa" else change_text_checksum(message)


def trailing_crc_change(options: object) -> MessageChange:
    """CRC in the last bytes: iXCOM, LWNX, multi-beam altimeter."""
    return lambda message: flip_byte(message, -1)


def mavlink_change(options: object) -> MessageChange:
    """The CRC after the payload; a signature may follow it."""

    def change(message: bytes) -> bytes:
        start = HEADER_V2 if message[0] == V2 else HEADER_V1
        return flip_byte(message, start + message[1])

    return change


def radar_altimeter_change(options: freeflight_ra4500.Options) -> MessageChange | None:
    """Byte 6, if its rule is known; byte stuffing is applied again."""
    if options.checksum == "none":
        return None
    stuffed = bytes([DLE, DLE])

    def change(message: bytes) -> bytes:
        body = message[len(HEADER) : -len(TRAILER)]
        plain = body.replace(stuffed, stuffed[:1]) if options.dle_stuffing else body
        wrong = flip_byte(plain, -1)
        return HEADER + (wrong.replace(stuffed[:1], stuffed) if options.dle_stuffing else wrong) + TRAILER

    return change


def arinc_change(options: arinc429.Options) -> MessageChange | None:
    """The parity, bit 32 of a word; in APMP of each word; in chapter 10 the checksum after the body."""
    if options.packets == "chapter10":
        return lambda message: flip_byte(message, -1)
    if options.parity == "none":
        return None
    top = 0 if options.byte_order == "big" or options.packets == "apmp" else 3
    if options.packets == "apmp":
        return lambda message: _flip_parity(message, apmp.HEADER.size + apmp.TIMES.size + 12, apmp.RECORD.size)
    return lambda message: _flip_parity(message, top, 4)


def _flip_parity(message: bytes, first: int, step: int) -> bytes:
    data = bytearray(message)
    for at in range(first, len(data), step):
        data[at] ^= 0x80
    return bytes(data)


def line_change(options: ascii_line.Options) -> MessageChange | None:
    """The last digit of the field {checksum}."""
    if options.checksum is None:
        return None
    line, ends = ascii_line.LineCodec(options), options.terminator.encode("latin-1")

    def change(message: bytes) -> bytes:
        found = line.template.match(message.rstrip(ends))
        if found is None:
            return message
        begin, end = found.span("checksum")
        digit = b"1" if message[end - 1 : end] == b"0" else b"0"
        return message[: end - 1] + digit + message[end:] if begin < end else message

    return change


def frame_change(options: binary_struct.Options) -> MessageChange | None:
    """The first byte of the checksum, at its configured position."""
    rule = binary_struct.make_frame_codec(options).checksum
    return None if rule is None else lambda message: flip_byte(message, rule.position(len(message)))
