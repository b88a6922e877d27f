"""Position of the identifier in a message, and how it becomes an unknown one with a correct checksum.

The new numbers and names are not assigned in any document.  A function returns None if messages have no identifier with
these options.  The drivers' own functions compute the checksums.
"""

from __future__ import annotations

import binascii
import struct
from collections.abc import Callable, Container
from itertools import chain
from typing import Literal

from fti.canframe import STANDARD_MASK
from fti.drivers import arinc429, canaerospace, dbc, deflection_pickups, lightware_ascii, mavlink, multibeam_altimeter
from fti.drivers.arinc429 import apmp, chapter10, word
from fti.drivers.arinc429.stream import WORD_BYTES
from fti.drivers.canaerospace.decoder import kind_of
from fti.drivers.canaerospace.parameters import read_parameters
from fti.drivers.deflection_pickups.layout import read_bus
from fti.drivers.lightware_binary import make_packet
from fti.drivers.mavlink.wire import HEADER_V1, HEADER_V2, V2, crc, layout
from fti.drivers.novatel_oem6.framing import CRC_SIZE, crc32
from fti.drivers.ublox_ubx.frames import HEADER as UBX_HEADER
from fti.drivers.ublox_ubx.frames import SYNC as UBX
from fti.drivers.ublox_ubx.frames import frame as ubx_frame
from fti.formats.nmea_fields import sentence

MessageChange = Callable[[bytes], bytes]

#: Not a formatter of NMEA 0183.
FORMATTER = "XXX"
IXCOM_NUMBER, LWNX_NUMBER, UBX_NUMBER, NOVATEL_NUMBER = 0xEE, 250, 0xEE, 0xFFFE
MULTIBEAM_NUMBER = 0xEE
#: DEBUG, a message of the common set that is not decoded.
MAVLINK_NUMBER = 254
#: Computer-generated data, format 1: not a packet of ARINC 429.
CHAPTER10_TYPE, CHAPTER10_TYPE_AT = 0x01, 15


def multibeam_change(options: object) -> MessageChange:
    """Byte 6, the message number."""

    def change(message: bytes) -> bytes:
        header = multibeam_altimeter.read_header(message)._replace(message=MULTIBEAM_NUMBER)
        body = message[multibeam_altimeter.HEADER.size : -multibeam_altimeter.CRC_SIZE]
        return multibeam_altimeter.make_frame(header, body)

    return change


def nmea_change(options: object) -> MessageChange:
    """The formatter after the talker; a message that is not a sentence is unchanged."""

    def change(message: bytes) -> bytes:
        if message[:1] != b"$" or b"*" not in message:
            return message
        body = message[1:].rpartition(b"*")[0].decode("latin-1")
        name, comma, rest = body.partition(",")
        return sentence(f"{name[:-3]}{FORMATTER}{comma}{rest}")

    return change


def power_unit_change(options: object) -> MessageChange:
    """The field after PFTI."""

    def change(message: bytes) -> bytes:
        fields = message[1:].rpartition(b"*")[0].decode("latin-1").split(",")
        return sentence(",".join([fields[0], FORMATTER, *fields[2:]]))

    return change


def ublox_change(options: object) -> MessageChange:
    """The message number of a UBX message; the formatter of an NMEA sentence."""

    def change(message: bytes) -> bytes:
        if message.startswith(UBX):
            return ubx_frame(message[2], UBX_NUMBER, message[UBX_HEADER:-2])
        return nmea_change(options)(message)

    return change


def novatel_change(options: object) -> MessageChange:
    """The message number of a binary message; a text answer has none."""

    def change(message: bytes) -> bytes:
        if message[:1] != b"\xaa":
            return message
        data = message[:4] + struct.pack("<H", NOVATEL_NUMBER) + message[6:-CRC_SIZE]
        return data + crc32(data).to_bytes(CRC_SIZE, "little")

    return change


def ixcom_change(options: object) -> MessageChange:
    """Byte 1, the message number."""

    def change(message: bytes) -> bytes:
        data = message[:1] + bytes([IXCOM_NUMBER]) + message[2:-2]
        return data + binascii.crc_hqx(data, 0).to_bytes(2, "little")

    return change


def lwnx_change(options: object) -> MessageChange:
    """Byte 3, the command number."""
    return lambda message: make_packet(LWNX_NUMBER, message[4:-2])


def lightware_change(options: lightware_ascii.Options) -> MessageChange | None:
    """The name in the answer of an LW20; a bare number has none."""
    if options.query != "ldf":
        return None
    return lambda message: message.replace(b"ldf,", b"zzz,", 1)


def mavlink_change(options: mavlink.Options) -> MessageChange:
    """The message number, and the checksum with the seed of that message."""

    def change(message: bytes) -> bytes:
        known = layout(options.dialect, MAVLINK_NUMBER)
        assert known is not None
        start = HEADER_V2 if message[0] == V2 else HEADER_V1
        end = start + message[1]
        number = MAVLINK_NUMBER.to_bytes(3, "little") if start == HEADER_V2 else bytes([MAVLINK_NUMBER])
        data = message[: start - len(number)] + number + message[start:end]
        return data + crc(data[1:] + known.seed).to_bytes(2, "little") + message[end + 2 :]

    return change


def arinc_change(options: arinc429.Options) -> MessageChange:
    """A label that is not enabled, with correct parity; in chapter 10 the packet type."""
    if options.packets == "chapter10":
        return _change_packet_type
    used = {word.label_byte(item.label) for item in arinc429.enabled_labels(options).labels}
    free = next(byte for byte in range(1, 256) if byte not in used)
    if options.packets == "apmp":
        first, step = apmp.HEADER.size + apmp.TIMES.size + apmp.RECORD.size - WORD_BYTES, apmp.RECORD.size
        return lambda message: _change_labels(message, range(first, len(message), step), free, options, "big")
    return lambda message: _change_labels(
        message, range(0, len(message), WORD_BYTES), free, options, options.byte_order
    )


def _change_labels(
    message: bytes, places: range, label: int, options: arinc429.Options, order: Literal["big", "little"]
) -> bytes:
    data = bytearray(message)
    for at in places:
        old = int.from_bytes(data[at : at + WORD_BYTES], order)
        new = old & ~0xFF | (label if options.label_reversed else word.reverse_label(label))
        if options.parity != "none":
            new = word.with_parity(new, options.parity)
        data[at : at + WORD_BYTES] = new.to_bytes(WORD_BYTES, order)
    return bytes(data)


def _change_packet_type(message: bytes) -> bytes:
    """The header checksum changes by the same amount as the type, which is the high byte of a word."""
    data = bytearray(message)
    added = (CHAPTER10_TYPE - data[CHAPTER10_TYPE_AT]) << 8
    data[CHAPTER10_TYPE_AT] = CHAPTER10_TYPE
    end = chapter10.HEADER.size
    checksum = int.from_bytes(data[end - 2 : end], "little")
    data[end - 2 : end] = (checksum + added & 0xFFFF).to_bytes(2, "little")
    return bytes(data)


def canaerospace_change(options: canaerospace.Options) -> MessageChange:
    """An identifier that CANaerospace does not assign."""
    used = {identifier for identifier in range(STANDARD_MASK + 1) if kind_of(identifier)}
    return _identifier_change(used | read_parameters(options.dbc).keys())


def dbc_change(options: dbc.Options) -> MessageChange:
    """An identifier that is not in the DBC."""
    return _identifier_change(dbc.read_plans(dbc.text_of(options), options.counter).keys())


def pickups_change(options: deflection_pickups.Options) -> MessageChange:
    """An identifier that is neither a message of the pickups nor a node service."""
    bus = read_bus(options.dbc, ())
    return _identifier_change(set(chain(bus.messages, filter(None, (bus.request, bus.response)))))


def _identifier_change(used: Container[int]) -> MessageChange:
    free = next(identifier for identifier in range(STANDARD_MASK, -1, -1) if identifier not in used)
    return lambda message: free.to_bytes(4, "little") + message[4:]
