"""CAN frames as bytes: the kernel's layout, both ways."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.canframe import FD_LENGTHS, pack_can, unpack_can


def test_layout_of_the_kernel() -> None:
    assert pack_can(0x123, b"\x01\x02").hex() == "23010000020000000102000000000000"
    assert pack_can(0x1ABCDEF0, b"", extended=True)[:4] == bytes.fromhex("f0debc9a")
    assert pack_can(0x123, bytes(3), remote=True)[:5] == bytes.fromhex("2301004003")
    assert pack_can(0x04, bytes(8), error=True)[:4] == bytes.fromhex("04000020")
    fd = pack_can(0x7FF, bytes(range(9)), fd=True)
    assert (len(fd), fd[4], fd[5]) == (72, 12, 4)


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8), st.booleans())
def test_round_trip_classic(can_id: int, data: bytes, remote: bool) -> None:
    extended = can_id > 0x7FF
    can_frame = unpack_can(pack_can(can_id, data, extended=extended, remote=remote))
    assert can_frame == (can_id, extended, remote, False, False, bytes(len(data)) if remote else data)


@given(st.sampled_from(FD_LENGTHS))
def test_round_trip_fd(length: int) -> None:
    data = bytes(range(length))
    assert unpack_can(pack_can(0x42, data, fd=True)) == (0x42, False, False, False, True, data)


@pytest.mark.parametrize(
    ("can_id", "data", "fd"), [(0x800, b"", False), (-1, b"", False), (1, bytes(9), False), (1, bytes(65), True)]
)
def test_what_does_not_fit_is_an_error(can_id: int, data: bytes, fd: bool) -> None:
    with pytest.raises(ValueError, match=r"allowed is|has 0 to"):
        pack_can(can_id, data, fd=fd)


@pytest.mark.parametrize("frame", [b"", bytes(15), bytes(4) + b"\x09" + bytes(11), bytes(4) + b"\x41" + bytes(67)])
def test_bytes_that_are_no_frame_are_an_error(frame: bytes) -> None:
    with pytest.raises(ValueError, match="bytes"):
        unpack_can(frame)
