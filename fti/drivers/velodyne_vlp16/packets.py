"""Layout, framing and tables of the packets; see the package for the document."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from fti.drivers._framing import Skip

BLOCKS, CHANNELS, LASERS = 12, 32, 16
POINTS = BLOCKS * CHANNELS
FLAG = b"\xff\xee"
BLOCK_BYTES, DATA_BYTES = 100, 1206
TAIL_AT = BLOCKS * BLOCK_BYTES
FIRST, SECOND = FLAG[:1] * BLOCKS, FLAG[1:] * BLOCKS
CHANNEL = np.dtype([("distance", "<u2"), ("reflectivity", "u1")])
BLOCK = np.dtype([("flag", "<u2"), ("azimuth", "<u2"), ("channels", CHANNEL, (CHANNELS,))])
DATA = np.dtype([("blocks", BLOCK, (BLOCKS,)), ("time_us", "<u4"), ("mode", "u1"), ("product", "u1")])
POSITION_BYTES, TIME_AT, PPS_AT, SENTENCE_AT = 512, 198, 202, 206
VLP16 = 0x22
TURN = 36_000  # azimuth of a full turn [deg / 100]
DISTANCE_LSB_M = 0.002


class ReturnMode(IntEnum):
    """The returns that a packet has."""

    STRONGEST = 0x37
    LAST = 0x38
    DUAL = 0x39


#: Vertical angle of each laser, table 9-1 [rad].
VERTICAL = np.radians([-15.0, 1.0, -13.0, 3.0, -11.0, 5.0, -9.0, 7.0, -7.0, 9.0, -5.0, 11.0, -3.0, 13.0, -1.0, 15.0])
FIRING_S, SEQUENCE_S = 2.304e-6, 55.296e-6
BLOCK_S = 2 * SEQUENCE_S
#: Time of each channel after the first one of its block [s].
CHANNEL_S = (SEQUENCE_S * np.arange(2)[:, None] + FIRING_S * np.arange(LASERS)).ravel()
_PARTS = {mode: 2 if mode is ReturnMode.DUAL else 1 for mode in ReturnMode}
#: Time of each point after that of the packet [s], by return mode, shape (POINTS,).
OFFSETS_S = {
    mode: (BLOCK_S * (np.arange(BLOCKS) // part)[:, None] + CHANNEL_S).ravel() for mode, part in _PARTS.items()
}
_MODES = frozenset(ReturnMode)


def measure(buffer: bytearray) -> int | Skip:
    """Size of the packet at the start of the buffer, or a Skip; see ``_framing``.

    A packet of another product or return mode, or with an impossible azimuth, is skipped as a whole.
    """
    if buffer.startswith(FLAG):
        return _measure_data(buffer)
    if buffer.startswith(FLAG[:1]) and len(buffer) == 1:
        return 0
    if not buffer[0]:
        return _measure_position(buffer)
    return _skip_to_start(buffer)


def _skip_to_start(buffer: bytearray) -> Skip:
    """Skip to the next byte with which a packet may begin."""
    found = [at for at in (buffer.find(FLAG, 1), buffer.find(0, 1)) if at > 0]
    size = min(found, default=len(buffer))
    if not found and buffer.endswith(FLAG[:1]):
        size -= 1
    return Skip(size, "no_sync")


def _measure_data(buffer: bytearray) -> int | Skip:
    if len(buffer) < DATA_BYTES:
        return 0
    first, second, low, high = (buffer[at:TAIL_AT:BLOCK_BYTES] for at in range(4))  # bytes of all blocks
    if first != FIRST or second != SECOND:
        return Skip(1, "bad_flag")
    mode, product = buffer[DATA_BYTES - 2], buffer[DATA_BYTES - 1]
    if product != VLP16:  # where a flag follows the blocks, a packet was cut and the next one has begun
        return Skip(1 if buffer.startswith(FLAG, TAIL_AT) else DATA_BYTES, "other_product")
    if mode not in _MODES:
        return Skip(DATA_BYTES, "other_return_mode")
    if max(zip(high, low, strict=True)) >= divmod(TURN, 256):
        return Skip(DATA_BYTES, "bad_azimuth")
    return DATA_BYTES


def _measure_position(buffer: bytearray) -> int | Skip:
    """A position packet has nothing but zeros around time, pulse state and sentence."""
    zeros = len(buffer) - len(buffer.lstrip(b"\0"))
    if zeros < min(len(buffer), TIME_AT):
        return Skip(zeros, "no_sync")
    if len(buffer) < POSITION_BYTES:
        return 0
    is_position = (
        buffer[PPS_AT] <= 3
        and not any(buffer[PPS_AT + 1 : SENTENCE_AT])
        and (buffer.startswith(b"$GPRMC,", SENTENCE_AT) or not any(buffer[SENTENCE_AT:POSITION_BYTES]))
    )
    return POSITION_BYTES if is_position else Skip(1, "bad_position_packet")
