"""One flipped bit is found, wherever it is; two are not taken for one."""

from __future__ import annotations

import random
import zlib

import pytest

from fti.logger.recovery.flipped_bit import STRIDE, correct_bit


@pytest.mark.parametrize("size", [1, 2, 7, 300])
def test_every_bit_is_found(size: int) -> None:
    whole = random.Random(size).randbytes(size)
    crc = zlib.crc32(whole)
    for bit in range(8 * size):
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        assert correct_bit(data, crc) == bit // 8
        assert data == whole


@pytest.mark.parametrize("place", [0, 1, STRIDE - 1, STRIDE, STRIDE + 1, 2 * STRIDE, 4 * 2**20 - 1])
@pytest.mark.parametrize("mask", [1, 128])
def test_it_is_found_in_a_chunk_of_4_mib(place: int, mask: int) -> None:
    """From its begin and from its end."""
    whole = random.Random(3).randbytes(4 * 2**20)
    crc = zlib.crc32(whole)
    for byte in (place, len(whole) - 1 - place):
        data = bytearray(whole)
        data[byte] ^= mask
        assert correct_bit(data, crc) == byte
        assert data == whole


@pytest.mark.parametrize("bit", range(32))
def test_a_bit_of_the_checksum_itself(bit: int) -> None:
    data = bytearray(b"some bytes")
    assert correct_bit(data, zlib.crc32(data) ^ 1 << bit) == len(data)
    assert data == b"some bytes"


def test_more_than_one_bit_is_left_alone() -> None:
    """In 1000 bytes, other damage looks like one bit in 2 of a million cases; none of these does."""
    dice = random.Random(5)
    whole = dice.randbytes(1000)
    crc = zlib.crc32(whole)
    for count in [2, 3, 100] * 100:
        damaged = bytearray(whole)
        for bit in dice.sample(range(8000), count):
            damaged[bit // 8] ^= 1 << bit % 8
        data = bytearray(damaged)
        assert correct_bit(data, crc) is None
        assert data == damaged


def test_nothing_has_no_flipped_bit() -> None:
    assert correct_bit(bytearray(), 0x1234) is None
