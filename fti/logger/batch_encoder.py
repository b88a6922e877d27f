"""Encoder of MCAP message records from frame batches: the inner loop of the recorder's writer."""

from __future__ import annotations

import functools
import struct
from array import array
from collections.abc import Mapping, Sequence
from typing import Any

from fti.frame_batch import FrameBatch
from fti.logger.records import MESSAGE, MESSAGE_BODY

#: A channel id and the frame batches to write; times do not decrease within a batch.
ChannelBatches = tuple[int, Sequence[FrameBatch]]
#: Batches with at most this number of messages are packed one by one.
MAX_SINGLE_MESSAGES = 4
NO_TIME = 2**64 - 1
MESSAGE_SIZE = MESSAGE.size
_SEQUENCE = 0xFFFF_FFFF
_EQUAL = struct.Struct("<BQH")  # opcode, length, channel


def encode_batches(
    channel_batches: Sequence[ChannelBatches], index: Mapping[int, array[int]], at: int, parts: list[bytes]
) -> tuple[int, int]:
    """Append message records to ``parts`` and their offsets, from ``at`` on, to the index; first and last time [ns].

    One loop for all channels: at two messages per link, function calls would double the cost.
    """
    first, last, add, pack = NO_TIME, 0, parts.append, MESSAGE.pack
    for channel_id, batches in channel_batches:
        add_index = index[channel_id].append
        for positions, times, frames, payload in batches:
            if times[0] < first:  # noqa: PLR1730  (a call of min costs three times as much)
                first = times[0]
            if times[-1] > last:  # noqa: PLR1730
                last = times[-1]
            if len(frames) > MAX_SINGLE_MESSAGES and payload == len(frames) * len(frames[0]) and _are_equal(frames):
                packed, entries = _pack_equal(channel_id, (positions, times, frames, payload), at)
                add(packed)
                index[channel_id].extend(entries)
                at += len(packed)
                continue
            for position, time, data in zip(positions, times, frames):  # noqa: B905  (strict takes as long as packing)
                size = len(data)
                add(pack(5, MESSAGE_BODY + size, channel_id, position & _SEQUENCE, time, time))
                add(data)
                add_index(time)
                add_index(at)
                at += MESSAGE_SIZE + size
    return first, last


def _are_equal(frames: Sequence[bytes]) -> bool:
    return list(map(len, frames)).count(len(frames[0])) == len(frames)


def _pack_equal(channel_id: int, batch: FrameBatch, at: int) -> tuple[bytes, list[int]]:
    """Message records of a batch of frames of equal length, packed with one call; index entries from ``at`` on."""
    positions, times, frames, _ = batch
    count, size = len(frames), len(frames[0])
    fields: list[Any] = [_EQUAL.pack(5, MESSAGE_BODY + size, channel_id)] * (5 * count)
    fields[1::5] = positions if positions[-1] <= _SEQUENCE else [position & _SEQUENCE for position in positions]
    fields[2::5] = fields[3::5] = times
    fields[4::5] = frames
    entries = [0] * (2 * count)
    entries[::2] = times
    entries[1::2] = range(at, at + count * (MESSAGE_SIZE + size), MESSAGE_SIZE + size)
    return _records(count, size).pack(*fields), entries


def truncate_index(index: array[int], begin: int) -> None:
    """Remove the entries of offsets from ``begin`` on."""
    while index and index[-1] >= begin:
        del index[-2:]


@functools.lru_cache(maxsize=256)
def _records(count: int, size: int) -> struct.Struct:
    """Format of ``count`` message records of ``size`` bytes: common head, sequence, both times, data."""
    return struct.Struct("<" + f"{_EQUAL.size}sIQQ{size}s" * count)
