"""One flipped bit, found by the CRC-32 that no longer holds.

A CRC is linear: the difference between what it should be and what it is depends on the error alone, and is another one
for each of up to 2^32 - 33 bits.  So one flipped bit, in the data or in the checksum itself, can be turned back.  What
it cannot tell is whether it was one bit: of other damage to n bits a share of n / 2^32 looks like that, 1 in 128 for
4 MiB.

The place is sought backwards from the end of the data, in strides (baby steps and giant steps; Shanks 1971).
Source: Peterson and Brown 1961, theorem 3 (a cyclic code of minimum distance 3 corrects one error).
Checked against: zlib's CRC of every flip, tests/logger/recovery/test_flipped_bit.py.
"""

from __future__ import annotations

import zlib
from functools import cache

STRIDE = 4096


def correct_bit(data: bytearray, crc: int, before: int = 0) -> int | None:
    """Turn the one bit back with which the CRC-32 of the data is ``crc``.

    before : CRC-32 of what comes before the data, where ``crc`` is of both.
    Returns the byte of the data, their length where the bit is one of the checksum, None when it is not one bit.
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
    """What the difference would be, had the data ended a stride earlier."""
    low, second, third, high = _strides()
    parts = low[difference & 0xFF], second[difference >> 8 & 0xFF], third[difference >> 16 & 0xFF]
    return parts[0] ^ parts[1] ^ parts[2] ^ high[difference >> 24]


@cache
def _table() -> tuple[int, ...]:
    """What each byte makes of a register of zeros; taken from zlib, whose CRC of nothing but zeros is known."""
    return tuple(zlib.crc32(bytes([value])) ^ zlib.crc32(b"\0") for value in range(256))


@cache
def _near_end() -> dict[int, tuple[int, int]]:
    """The difference that a bit makes -> bytes behind its own, its mask; for the last stride."""
    table, found = _table(), {}
    for mask in (1 << bit for bit in range(8)):
        difference = table[mask]
        for at in range(STRIDE):
            found[difference] = at, mask
            difference = table[difference & 0xFF] ^ difference >> 8
    return found


@cache
def _strides() -> tuple[list[int], ...]:
    """For each byte of a difference what a stride back makes of it; the whole is the sum of its bytes' shares."""
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
    """The shares of the bits that are set."""
    total = 0
    for bit, share in enumerate(shares):
        total ^= share if value >> bit & 1 else 0
    return total
