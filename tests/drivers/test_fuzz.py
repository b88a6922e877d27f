"""Damaged streams of millions of bytes: no exception, bounded memory, no incomplete frame is accepted.

10^5 bytes of each driver, 10^7 with ``--scale full``; seeded, so that what fails once fails again.
"""

from __future__ import annotations

import json
import tracemalloc
from collections.abc import Callable, Iterator
from random import Random

import pytest

from fti import drivers
from fti.drivers import Decoder
from fti.drivers._framing import Framer
from tests.drivers.checksums import CHECKED, UNCHECKED
from tests.drivers.test_contract import MAX_GARBAGE_BYTES, MAX_HELD
from tests.drivers.vectorfiles import CAN_FRAME, VECTORS, Vector, assert_accounted, feed_all, vectors_of

SEED = 20261121
QUICK_BYTES, FULL_BYTES = 10**5, 10**7
MAX_READ_BYTES = 600
QUICK_BITS = 150
#: A decoder may learn names and sources; what it keeps of 25 kB of damage is less than this [B].
MAX_KEPT_BYTES = 2**17

each_driver = pytest.mark.parametrize("name", drivers.names())
checked_vectors = pytest.mark.parametrize(
    "vector", [v for v in VECTORS if v.facts["driver"] in CHECKED], ids=lambda v: v.name
)


# ------------------------------------------------------------------------------------------------------- damage


def damaged(data: bytes, chance: Random) -> bytes:
    """A message after what can happen to it on a line."""
    at, size = chance.randrange(len(data)), chance.randint(1, 8)
    match chance.randrange(8):
        case 0:  # bits are turned
            return bytes(b ^ (1 << chance.randrange(8)) if chance.random() < 3 / len(data) else b for b in data)
        case 1:  # bytes are lost
            return data[:at] + data[at + size :]
        case 2:  # bytes come in between
            return data[:at] + chance.randbytes(size) + data[at:]
        case 3:  # another length, another number
            return data[:at] + chance.randbytes(size) + data[at + size :]
        case 4:  # its end is missing
            return data[:at]
        case 5:  # its beginning is missing
            return data[at:]
        case 6:  # it begins anew
            return data[:at] + data
        case _:  # noise
            return chance.randbytes(size * 8)


def stream(vectors: list[Vector], chance: Random, size: int) -> Iterator[bytes]:
    """About ``size`` bytes of messages, every third of them whole, in reads of any length."""
    pending = bytearray()
    while size > 0:
        data = chance.choice(vectors).data
        pending += data if chance.random() < 1 / 3 else damaged(data, chance)
        size -= len(data)
        while len(pending) > MAX_READ_BYTES:
            cut = chance.randint(1, MAX_READ_BYTES)
            yield bytes(pending[:cut])
            del pending[:cut]
    yield bytes(pending)


def can_stream(vectors: list[Vector], chance: Random, size: int) -> Iterator[bytes]:
    """The same in CAN frames, one a read; some with other lengths and identifiers."""
    frames = [frame for vector in vectors for frame in vector.reads()]
    for _ in range(size // CAN_FRAME):
        frame = chance.choice(frames)
        yield frame if chance.random() < 1 / 3 else damaged(frame, chance)


def reads(vectors: list[Vector], chance: Random, size: int) -> Iterator[bytes]:
    """Damage as the driver's link brings it."""
    return (can_stream if vectors[0].is_can else stream)(vectors, chance, size)


def by_options(name: str) -> list[list[Vector]]:
    """The driver's vectors, those together that are decoded in one way."""
    ways: dict[str, list[Vector]] = {}
    for vector in vectors_of(name):
        ways.setdefault(json.dumps(vector.facts["options"], sort_keys=True), []).append(vector)
    return list(ways.values())


# -------------------------------------------------------------------------------------------------------- tests


class Watched:
    """Stands between framing and decoders: each frame that is taken must hold by the independent checksum."""

    def __init__(self, holds: Callable[[bytes], bool], monkeypatch: pytest.MonkeyPatch) -> None:
        self.frames = 0
        feed = Framer.feed

        def checked(framer: Framer, data: bytes, t_rx_ns: int) -> Iterator[tuple[int, bytes]]:
            for stamp, frame in feed(framer, data, t_rx_ns):
                self.frames += 1
                assert holds(frame), frame.hex()
                yield stamp, frame

        monkeypatch.setattr(Framer, "feed", checked)


@pytest.fixture
def watched(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Watched:
    """For the driver of the test."""
    parameters = request.node.callspec.params
    name = parameters["name"] if "name" in parameters else parameters["vector"].facts["driver"]
    return Watched(CHECKED.get(name, lambda frame: True), monkeypatch)


@each_driver
def test_the_frames_of_every_driver_are_checked_or_the_reason_is_given(name: str) -> None:
    assert (name in CHECKED) != (name in UNCHECKED)


@each_driver
def test_whatever_happens_on_the_line_nothing_is_taken_that_is_not_whole(
    name: str, scale: int, watched: Watched
) -> None:
    size = QUICK_BYTES if scale == 1 else FULL_BYTES
    ways = by_options(name)
    for vectors in ways:
        decoder, fed = vectors[0].decoder(), 0
        for data in reads(vectors, Random(SEED), size // len(ways)):
            decoder.feed(data, fed)
            fed += len(data)
            assert decoder.counters.held <= MAX_HELD
        assert_accounted(decoder.counters, fed)
        assert sum(decoder.counters.messages.values()) > 0
        assert_in_step(decoder, vectors[0])
    assert watched.frames or vectors_of(name)[0].is_can


def assert_in_step(decoder: Decoder, vector: Vector) -> None:
    """After so many good bytes it decodes as if nothing had been."""
    steady = len(feed_all(vector.decoder(), vector.reads() * 3)) - len(feed_all(vector.decoder(), vector.reads() * 2))
    for _ in range((MAX_HELD + MAX_GARBAGE_BYTES) // len(vector.data) + 1):
        for data in vector.reads():
            decoder.feed(data, 8)
    assert sum(len(decoder.feed(data, 9)) for data in vector.reads()) == steady


@each_driver
def test_damage_leaves_nothing_behind_in_memory(name: str) -> None:
    vectors = by_options(name)[0]
    decoder = vectors[0].decoder()
    for data in reads(vectors, Random(1), QUICK_BYTES // 4):
        decoder.feed(data, 7)
    tracemalloc.start()
    try:
        for data in reads(vectors, Random(2), QUICK_BYTES // 4):
            decoder.feed(data, 7)
        kept, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert kept < MAX_KEPT_BYTES


@checked_vectors
def test_a_single_turned_bit_is_seen(vector: Vector, watched: Watched, scale: int) -> None:
    """Every bit of what a checksum covers; some of them in the quick form."""
    data = vector.data[:MAX_READ_BYTES]
    bits = range(8 * len(data))
    for at in Random(SEED).sample(bits, min(QUICK_BITS, len(bits))) if scale == 1 else bits:
        hit = bytearray(data)
        hit[at // 8] ^= 1 << at % 8
        feed_all(vector.decoder(), [bytes(hit), data])
    assert watched.frames
