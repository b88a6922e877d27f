"""CAN frames as bytes: the layout of Linux ``struct can_frame`` and ``struct canfd_frame``, little-endian.

    can_frame, 16 B     | id u32 | length u8 | 0 0 0         | data, padded to 8  |
    canfd_frame, 72 B   | id u32 | length u8 | flags u8 | 0 0 | data, padded to 64 |

    id bit 31 extended (29 bits), 30 remote request, 29 error frame; the rest is the identifier
    FD flags: 0x01 bit-rate switch, 0x02 error state of the sender, 0x04 FD frame

Source: Linux ``include/uapi/linux/can.h``.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

CAN_SIZE = 16
CANFD_SIZE = 72
EXTENDED = 0x8000_0000
REMOTE = 0x4000_0000
ERROR = 0x2000_0000
STANDARD_MASK = 0x7FF
EXTENDED_MASK = 0x1FFF_FFFF
FD_BRS = 0x01
FD_FDF = 0x04
#: Lengths that an FD frame can have: the data length codes 0..15.
FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)

_CAN = struct.Struct("<IB3x8s")
_CANFD = struct.Struct("<IBB2x64s")


class CanFrame(NamedTuple):
    """One CAN frame.  The data of a remote request are zeros, as many bytes as it requests."""

    can_id: int
    extended: bool
    remote: bool
    error: bool
    fd: bool
    data: bytes


def pack_can(
    can_id: int,
    data: bytes,
    *,
    extended: bool = False,
    remote: bool = False,
    error: bool = False,
    fd: bool = False,
) -> bytes:
    """The bytes of a frame.  The data of an FD frame are padded with zeros to the next length of FD_LENGTHS.

    Raises ValueError when the identifier or the data do not fit.
    """
    word = _identifier(can_id, extended or error)
    word |= EXTENDED * extended | REMOTE * remote | ERROR * error
    if fd:
        return _CANFD.pack(word, _fd_length(len(data)), FD_FDF, data)
    if len(data) > 8:
        raise ValueError(f"{len(data)} bytes of data; a CAN frame has 0 to 8")
    return _CAN.pack(word, len(data), bytes(len(data)) if remote else data)


def _identifier(can_id: int, wide: bool) -> int:
    mask = EXTENDED_MASK if wide else STANDARD_MASK
    if not 0 <= can_id <= mask:
        raise ValueError(f"CAN identifier {can_id:#x}; allowed is 0 to {mask:#x}")
    return can_id


def _fd_length(count: int) -> int:
    for length in FD_LENGTHS:
        if count <= length:
            return length
    raise ValueError(f"{count} bytes of data; a CAN FD frame has 0 to 64")


def unpack_can(frame: bytes) -> CanFrame:
    """The frame in 16 or 72 bytes.  Raises ValueError for another size or an impossible length."""
    if len(frame) == CAN_SIZE:
        word, length, data = _CAN.unpack(frame)
    elif len(frame) == CANFD_SIZE:
        word, length, _, data = _CANFD.unpack(frame)
    else:
        raise ValueError(f"{len(frame)} bytes; a CAN frame has {CAN_SIZE}, a CAN FD frame {CANFD_SIZE}")
    if length > len(data):
        raise ValueError(f"length {length} in a frame of at most {len(data)} bytes of data")
    wide = bool(word & (EXTENDED | ERROR))
    return CanFrame(
        can_id=word & (EXTENDED_MASK if wide else STANDARD_MASK),
        extended=bool(word & EXTENDED),
        remote=bool(word & REMOTE),
        error=bool(word & ERROR),
        fd=len(frame) == CANFD_SIZE,
        data=data[:length],
    )
