"""Checksums by name, for drivers whose frames the configuration describes.

The names of the CRCs and their parameters are those of the catalogue of parametrised CRC algorithms (G. Cook); the
tests contain the value of each over "123456789".
"""

from __future__ import annotations

import binascii
import functools
import operator
import zlib
from collections.abc import Callable
from functools import cache
from typing import Literal, NamedTuple

ChecksumKind = Literal[
    "xor8",
    "sum8",
    "sum16",
    "crc16_arc",
    "crc16_modbus",
    "crc16_xmodem",
    "crc16_ibm_3740",
    "crc16_kermit",
    "crc16_ibm_sdlc",
    "crc32",
]


class Checksum(NamedTuple):
    """An algorithm: size on the wire [bytes] and function."""

    size: int
    compute: Callable[[bytes], int]


@cache
def _reflected_table(polynomial: int) -> tuple[int, ...]:
    table = []
    for byte in range(256):
        value = byte
        for _ in range(8):
            value = value >> 1 ^ (polynomial if value & 1 else 0)
        table.append(value)
    return tuple(table)


def _reflected_crc16(polynomial: int, start: int, final: int) -> Callable[[bytes], int]:
    """A reflected CRC (least significant bit first); polynomial : reflected."""

    def crc(data: bytes) -> int:
        table, value = _reflected_table(polynomial), start
        for byte in data:
            value = value >> 8 ^ table[(value ^ byte) & 0xFF]
        return value ^ final

    return crc


CHECKSUMS: dict[str, Checksum] = {
    "xor8": Checksum(1, lambda data: functools.reduce(operator.xor, data, 0)),
    "sum8": Checksum(1, lambda data: sum(data) & 0xFF),
    "sum16": Checksum(2, lambda data: sum(data) & 0xFFFF),
    "crc16_arc": Checksum(2, _reflected_crc16(0xA001, 0, 0)),
    "crc16_modbus": Checksum(2, _reflected_crc16(0xA001, 0xFFFF, 0)),
    "crc16_xmodem": Checksum(2, lambda data: binascii.crc_hqx(data, 0)),
    "crc16_ibm_3740": Checksum(2, lambda data: binascii.crc_hqx(data, 0xFFFF)),
    "crc16_kermit": Checksum(2, _reflected_crc16(0x8408, 0, 0)),
    "crc16_ibm_sdlc": Checksum(2, _reflected_crc16(0x8408, 0xFFFF, 0xFFFF)),
    "crc32": Checksum(4, zlib.crc32),
}
