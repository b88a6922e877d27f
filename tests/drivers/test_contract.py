"""Contract of all drivers.  A new driver adds its vector files; this module names no driver."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fti import config, drivers
from fti.errors import ConfigError
from fti.messages.measurements import ImuSample, Measurement, Stamp
from tests.drivers.vectorfiles import (
    VECTORS,
    Vector,
    assert_accounted,
    assert_matches,
    feed_all,
    frames,
    make,
    of_class,
    vectors_of,
)

#: More than any decoder may hold: after that many good bytes it must be in step again.
MAX_HELD = 4096
MAX_GARBAGE_BYTES = 512  # of which each byte may begin something that looks like a frame
NAMES = drivers.names()

each_driver = pytest.mark.parametrize("name", NAMES)
each_vector = pytest.mark.parametrize("vector", VECTORS, ids=lambda v: v.name)
byte_streams = pytest.mark.parametrize("vector", [v for v in VECTORS if not v.is_can], ids=lambda v: v.name)


# -------------------------------------------------------------------------------------------------------- module


@each_driver
def test_driver_cites_its_document_and_lists_its_messages(name: str) -> None:
    driver = drivers.load(name)
    assert len(driver.DOCUMENT) > 15
    assert "Document:" in (driver.__doc__ or "")
    assert driver.MESSAGES
    assert all(text and meaning for text, meaning in driver.MESSAGES.items())
    assert driver.CARRIERS
    assert not driver.CARRIERS - {"serial", "udp", "can"}


@each_driver
def test_options_have_defaults_and_are_strict_and_frozen(name: str) -> None:
    driver = drivers.load(name)
    options = config.bind(driver.Options, {}, "file.toml", "device[0].options")
    with pytest.raises(ConfigError, match=r"no_such_key: there is no such key"):
        config.bind(driver.Options, {"no_such_key": 1}, "file.toml", "device[0].options")
    with pytest.raises(ValueError, match="frozen"):
        options.anything = 1  # type: ignore[attr-defined]
    assert driver.make_decoder(options).counters.bytes_in == 0
    assert driver.make_encoder(options) is not driver.make_encoder(options)


@each_driver
def test_questions_and_commands_have_their_form(name: str) -> None:
    driver = drivers.load(name)
    options = driver.Options()
    assert all(isinstance(data, bytes) for data in driver.on_connect(options))
    requests = driver.poll(options)
    assert requests is None or (requests[0] > 0 and isinstance(requests[1], bytes))
    assert driver.make_encoder(options).respond(b"") == []
    with pytest.raises(ValueError, match="no_such_command"):
        driver.command("no_such_command", {}, options)
    for command in driver.COMMANDS.values():
        assert command.does
        assert all(command.arguments.values())


@each_driver
def test_driver_has_a_vector_from_outside_and_a_canonical_one(name: str) -> None:
    own = vectors_of(name)
    assert any(v.facts["outside"] for v in own)
    assert any(v.facts["canonical"] for v in own)
    assert any(v.facts["round_trips"] for v in own)
    assert all(v.facts["origin"] and v.facts["independent"] for v in own)


@each_driver
def test_driver_says_whether_it_gives_inertial_data(name: str) -> None:
    """As its vectors do: both vectors of an inertial unit, of one message or another."""
    measurements = [
        m for v in vectors_of(name) for m in feed_all(v.decoder(), v.reads() * 2) if isinstance(m, ImuSample)
    ]
    given = any(m.accel_b for m in measurements) and any(m.gyro_b for m in measurements)
    assert drivers.is_inertial(drivers.load(name)) == given


# ------------------------------------------------------------------------------------------------------- vectors


@each_vector
def test_vector_is_decoded_to_what_the_independent_side_says(vector: Vector) -> None:
    decoder = vector.decoder()
    results = feed_all(decoder, vector.reads() * 2)
    assert decoder.counters.framed + decoder.counters.held == 2 * len(vector.data)
    for number, expected in enumerate(vector.facts["expect"]):
        facts = dict(expected)
        kind, index, tolerance = facts.pop("measurement"), facts.pop("index"), facts.pop("tolerance", 1e-12)
        measurements = list(of_class(results, kind))[index]
        assert_matches(measurements, facts, tolerance, f"expect[{number}] {kind}[{index}]")


@each_vector
def test_messages_are_counted_by_name(vector: Vector) -> None:
    decoder = vector.decoder()
    feed_all(decoder, vector.reads() * 3)
    listed = set(vector.driver.MESSAGES)
    for name, count in vector.facts["messages"].items():
        assert 2 * count <= decoder.counters.messages[name] <= 3 * count, name
        assert name in listed or "(other)" in listed, name
    assert set(decoder.counters.messages) == set(vector.facts["messages"])


@each_vector
def test_what_was_decoded_is_encoded_to_the_same_bytes(vector: Vector) -> None:
    if not vector.facts["canonical"]:
        return
    decoder, encoder = vector.decoder(), vector.driver.make_encoder(vector.options)
    copies = 1 if decoder.feed(vector.data, 7) and not decoder.counters.held else 2
    decoder = vector.decoder()
    measurements = feed_all(decoder, vector.reads() * copies)
    again = b"".join(data for m in measurements for data in encoder.encode(m))
    assert again[: len(vector.data)] == vector.data


# ------------------------------------------------------------------------------------------------------- streams


#: There are so many vectors and round trips that a third of the usual examples of each is plenty.
FEWER = settings(max_examples=settings().max_examples // 3)


def outcome(vector: Vector, reads: list[bytes]) -> tuple[list[Measurement], Any]:
    decoder = vector.decoder()
    return feed_all(decoder, reads), decoder.counters


@byte_streams
def test_how_the_bytes_are_cut_changes_nothing(vector: Vector) -> None:
    stream = b"\x00garbage" + vector.data + vector.data[:-1] + b"\xff" + vector.data * 2
    whole = outcome(vector, [stream])
    assert whole[0]
    assert outcome(vector, [stream[i : i + 1] for i in range(len(stream))]) == whole

    @FEWER
    @given(st.lists(st.integers(1, len(stream) - 1), max_size=20))
    def cut_anywhere(cuts: list[int]) -> None:
        edges = [0, *sorted(set(cuts)), len(stream)]
        assert outcome(vector, [stream[a:b] for a, b in itertools.pairwise(edges)]) == whole

    cut_anywhere()


@byte_streams
def test_a_message_carries_the_arrival_of_its_first_byte(vector: Vector) -> None:
    stream = vector.data * 2
    decoder = vector.decoder()
    measurements = []
    for at in range(len(stream)):
        for measurement in decoder.feed(stream[at : at + 1], at):
            assert measurement.stamp.t_rx_ns < at  # a message has more than one byte
            assert measurement.stamp.t_valid_ns is None
            measurements.append(measurement.stamp.t_rx_ns)
    assert measurements
    for start in set(measurements):
        assert first_stamp(vector, stream + vector.data, start) == start


def first_stamp(vector: Vector, stream: bytes, start: int) -> int | None:
    """Stamp of the first measurement of a stream that begins at start."""
    decoder = vector.decoder()
    for at in range(start, len(stream)):
        if measurements := decoder.feed(stream[at : at + 1], at):
            return measurements[0].stamp.t_rx_ns
    return None


@byte_streams
def test_messages_released_by_one_read_keep_their_own_stamps(vector: Vector) -> None:
    half = len(vector.data) // 2
    decoder = vector.decoder()
    measurements = decoder.feed(vector.data[:half], 100) + decoder.feed(vector.data[half:] + vector.data, 200)
    assert {m.stamp.t_rx_ns for m in measurements} == {100, 200}


# ------------------------------------------------------------------------------------------------------- garbage


def damaged(data: bytes) -> st.SearchStrategy[bytes]:
    """Bytes that are almost a stream: flipped bits, lost and added bytes, cuts, or nothing but noise."""
    place = st.integers(0, len(data) - 1)
    flips = st.lists(st.tuples(place, st.integers(1, 255)), min_size=1, max_size=8).map(
        lambda hits: bytes(flip(bytearray(data), hits))
    )
    cuts = st.tuples(place, place).map(lambda p: data[: min(p)] + data[max(p) :])
    splices = st.tuples(place, st.binary(max_size=40)).map(lambda p: data[: p[0]] + p[1] + data[p[0] :])
    return st.one_of(st.binary(max_size=300), flips, cuts, splices)


def flip(data: bytearray, hits: list[tuple[int, int]]) -> bytearray:
    for at, mask in hits:
        data[at] ^= mask
    return data


def check_garbage(vector: Vector, check: Callable[[bytes], None]) -> None:
    """Each example takes 5 kB to settle, and test_fuzz damages far more."""
    FEWER(given(damaged(vector.data))(check))()


@byte_streams
def test_garbage_is_survived_accounted_bounded_and_left_behind(vector: Vector) -> None:
    steady = len(feed_all(vector.decoder(), [vector.data] * 3)) - len(feed_all(vector.decoder(), [vector.data] * 2))
    settle = [vector.data] * ((MAX_HELD + MAX_GARBAGE_BYTES) // len(vector.data) + 1)

    def survive(garbage: bytes) -> None:
        decoder = vector.decoder()
        feed_all(decoder, [garbage])
        assert decoder.counters.held <= MAX_HELD
        for data in settle:
            decoder.feed(data, 8)
        after = decoder.feed(vector.data, 9)
        assert_accounted(decoder.counters, len(garbage) + (len(settle) + 1) * len(vector.data))
        assert len(after) == steady

    check_garbage(vector, survive)


@each_vector
def test_can_frames_of_any_content_are_survived_and_accounted(vector: Vector) -> None:
    if not vector.is_can:
        return

    def survive(garbage: bytes) -> None:
        decoder = vector.decoder()
        feed_all(decoder, frames(garbage))
        assert decoder.counters.held == 0
        before = sum(decoder.counters.messages.values())
        feed_all(decoder, [], 8)
        for data in vector.reads():
            decoder.feed(data, 8)
        assert sum(decoder.counters.messages.values()) - before == sum(vector.facts["messages"].values())

    check_garbage(vector, survive)


@each_driver
def test_noise_is_never_an_exception(name: str) -> None:
    driver = drivers.load(name)

    @given(st.lists(st.binary(max_size=100), max_size=10))
    def survive(reads: list[bytes]) -> None:
        feed_all(driver.make_decoder(driver.Options()), reads)

    survive()


# ---------------------------------------------------------------------------------------------------- round trip


def trips() -> list[Any]:
    found = []
    for vector in VECTORS:
        for trip in vector.facts["round_trips"]:
            name = f"{vector.facts['driver']}-{trip['measurement']}.{trip['field']}-{trip['low']:.3g}"
            found.append(pytest.param(vector, trip, id=name))
    return found


@pytest.mark.parametrize(("vector", "trip"), trips())
def test_a_value_comes_back_to_half_the_resolution_of_the_wire(vector: Vector, trip: dict[str, Any]) -> None:
    encoder = vector.driver.make_encoder(vector.options)
    stamp = Stamp(1_700_000_000_000_000_000)

    def come_back(value: float) -> None:
        content = [value] * 3 if trip.get("vector") else value
        sent = {"measurement": trip["measurement"], trip["field"]: content, **trip.get("also", {})}
        passed_to = [make(facts, stamp) for facts in (sent, *trip.get("then", ()))]
        reads = [data for _ in range(3) for m in passed_to for data in encoder.encode(m)]
        found = [
            measurements
            for m in of_class(feed_all(vector.decoder(), reads), trip["measurement"])
            if (measurements := getattr(m, trip["field"])) is not None
        ]
        assert found
        for measurements in found:
            error = abs((measurements[0] if trip.get("vector") else measurements) - value)
            if trip.get("wrap"):
                error = min(error, math.tau - error)
            assert error <= trip["half_lsb"] * (1 + 1e-6) + 1e-12, (measurements, value)

    for edge in (trip["low"], trip["high"]):
        come_back(float(edge))
    FEWER(given(st.floats(trip["low"], trip["high"]))(come_back))()
