"""MCAP message records of bursts: the inner loop of the recorder's writer."""

from __future__ import annotations

import functools
import struct
from array import array
from collections.abc import Mapping, Sequence
from typing import Any

from fti.frame_batch import FrameBatch
from fti.logger.records import MESSAGE, MESSAGE_BODY

#: What a channel has to write: its id, and bursts; in each of them time does not go back.
ChannelBatches = tuple[int, Sequence[FrameBatch]]
#: Up to so many messages of a burst are packed one by one.
MAX_SINGLE_MESSAGES = 4
NO_TIME = 2**64 - 1
MESSAGE_SIZE = MESSAGE.size
_SEQUENCE = 0xFFFF_FFFF
_EQUAL = struct.Struct("<BQH")  # opcode, length, channel


def encode_batches(
    channel_batches: Sequence[ChannelBatches], index: Mapping[int, array[int]], at: int, parts: list[bytes]
) -> tuple[int, int]:
    """Add message records to ``parts``, and where they stand from ``at`` on to the index; first and last time.

    One loop over everything: a calm recorder has two messages of each link, and calls would cost as much again.
    """
    first, last, add, pack = NO_TIME, 0, parts.append, MESSAGE.pack
    for channel_id, bursts in channel_batches:
        note = index[channel_id].append
        for positions, times, frames, payload in bursts:
            if times[0] < first:  # noqa: PLR1730  (a call of min costs three times as much)
                first = times[0]
            if times[-1] > last:  # noqa: PLR1730
                last = times[-1]
            if len(frames) > MAX_SINGLE_MESSAGES and payload == len(frames) * len(frames[0]) and _are_equal(frames):
                packed, places = _pack_equal(channel_id, (positions, times, frames, payload), at)
                add(packed)
                index[channel_id].extend(places)
                at += len(packed)
                continue
            for position, time, data in zip(positions, times, frames):  # noqa: B905  (strict takes as long as packing)
                size = len(data)
                add(pack(5, MESSAGE_BODY + size, channel_id, position & _SEQUENCE, time, time))
                add(data)
                note(time)
                note(at)
                at += MESSAGE_SIZE + size
    return first, last


def _are_equal(frames: Sequence[bytes]) -> bool:
    """All have the same length."""
    return list(map(len, frames)).count(len(frames[0])) == len(frames)


def _pack_equal(channel_id: int, burst: FrameBatch, at: int) -> tuple[bytes, list[int]]:
    """Message records of a burst of frames of one length, with one call, and where they stand from ``at`` on."""
    positions, times, frames, _ = burst
    count, size = len(frames), len(frames[0])
    fields: list[Any] = [_EQUAL.pack(5, MESSAGE_BODY + size, channel_id)] * (5 * count)
    fields[1::5] = positions if positions[-1] <= _SEQUENCE else [position & _SEQUENCE for position in positions]
    fields[2::5] = fields[3::5] = times
    fields[4::5] = frames
    places = [0] * (2 * count)
    places[::2] = times
    places[1::2] = range(at, at + count * (MESSAGE_SIZE + size), MESSAGE_SIZE + size)
    return _records(count, size).pack(*fields), places


def truncate_index(index: array[int], begin: int) -> None:
    """Take back what was noted from that place on."""
    while index and index[-1] >= begin:
        del index[-2:]


@functools.lru_cache(maxsize=256)
def _records(count: int, size: int) -> struct.Struct:
    """So many message records of that size: what is equal in all, sequence, both times, data."""
    return struct.Struct("<" + f"{_EQUAL.size}sIQQ{size}s" * count)
