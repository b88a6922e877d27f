"""Correction of one flipped bit by a CRC-32.

A CRC is linear: the difference between the expected and the actual value depends on the error alone, and differs for
each of up to 2^32 - 33 bits.  One flipped bit, in the data or in the checksum itself, can therefore be corrected.  The
CRC cannot prove that only one bit was flipped: a share of n / 2^32 of other damage to n bits gives the same difference,
1 in 128 for 4 MiB.

The search runs backwards from the end of the data in strides (baby steps and giant steps; Shanks 1971).
Source: Peterson and Brown 1961, theorem 3 (a cyclic code of minimum distance 3 corrects one error).
Checked against: zlib's CRC of every flip, tests/logger/recovery/test_flipped_bit.py.
"""

from __future__ import annotations

import zlib
from functools import cache

STRIDE = 4096


def correct_bit(data: bytearray, crc: int, before: int = 0) -> int | None:
    """Correct one bit so that the CRC-32 of the data is ``crc``.

    before : CRC-32 of preceding data that ``crc`` covers too.
    Returns the offset of the byte, the length of the data for a bit of the checksum, None when it is not one bit.
    """
    difference = zlib.crc32(data, before) ^ crc
    if difference.bit_count() == 1:
        return len(data)
    for stride in range(len(data) // STRIDE + 1):
        at, mask = _near_end().get(difference, (0, 0))
        byte = len(data) - 1 - stride * STRIDE - at
        if mask and byte >= 0:
            data[byte] ^= mask
            return byte
        difference = _stride_back(difference)
    return None


def _stride_back(difference: int) -> int:
    """The difference if the data ended one stride earlier."""
    low, second, third, high = _strides()
    parts = low[difference & 0xFF], second[difference >> 8 & 0xFF], third[difference >> 16 & 0xFF]
    return parts[0] ^ parts[1] ^ parts[2] ^ high[difference >> 24]


@cache
def _table() -> tuple[int, ...]:
    """CRC table: effect of each byte on a zero register, from the CRCs of zlib."""
    return tuple(zlib.crc32(bytes([value])) ^ zlib.crc32(b"\0") for value in range(256))


@cache
def _near_end() -> dict[int, tuple[int, int]]:
    """Difference caused by a bit of the last stride -> bytes after its byte, its mask."""
    table, found = _table(), {}
    for mask in (1 << bit for bit in range(8)):
        difference = table[mask]
        for at in range(STRIDE):
            found[difference] = at, mask
            difference = table[difference & 0xFF] ^ difference >> 8
    return found


@cache
def _strides() -> tuple[list[int], ...]:
    """Effect of one stride back on each byte of a difference; the result is the sum over its bytes."""
    table = _table()
    entry = {value >> 24: index for index, value in enumerate(table)}

    def back(difference: int) -> int:
        for _ in range(STRIDE):
            index = entry[difference >> 24]
            difference = (difference ^ table[index]) << 8 & 0xFFFF_FFFF | index
        return difference

    bits = [back(1 << bit) for bit in range(32)]
    return tuple([_sum(bits[first : first + 8], value) for value in range(256)] for first in range(0, 32, 8))


def _sum(shares: list[int], value: int) -> int:
    """Sum of the shares of the set bits."""
    total = 0
    for bit, share in enumerate(shares):
        total ^= share if value >> bit & 1 else 0
    return total
