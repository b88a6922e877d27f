"""Percentiles of delays in bounded memory, and what may be claimed from them."""

from __future__ import annotations

import asyncio
import math
from typing import cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.hil.device_pipeline import DevicePipeline
from fti.hil.device_streams import SensorStream
from fti.hil.ports.counters import EndpointCounters
from fti.hil.ports.endpoints import Endpoint
from fti.hil.report import Meter, TransmissionReport, lateness_by_link
from fti.hil.tables.fault_types import Burst
from fti.latency_histogram import BINS, LatencyHistogram
from tests.hil.faults.device_flights import device
from tests.hil.worlds import scenario

MICROSECOND_MS = 1e-3


def histogram(late_s: list[float]) -> LatencyHistogram:
    result = LatencyHistogram()
    for late in late_s:
        result.add(late)
    return result


@given(st.lists(st.floats(0.0, 2000.0), min_size=1, max_size=300))
def test_percentiles_are_upper_bounds_and_near(late_s: list[float]) -> None:
    """Nearest rank; at most 1 us or 1/16 above, up to the longest delay that has a bin."""
    found, ordered = histogram(late_s).summary, sorted(late_s)
    for share, value_ms in ((0.5, found.p50_ms), (0.99, found.p99_ms)):
        true_ms = 1e3 * ordered[min(int(share * len(ordered)), len(ordered) - 1)]
        if true_ms < 1e3 * 1000.0:
            assert true_ms - 1e-9 <= value_ms <= true_ms * (1 + 1 / 16) + MICROSECOND_MS
    assert found.max_ms == 1e3 * ordered[-1]
    assert found.messages == len(late_s)


def test_its_memory_does_not_grow() -> None:
    result = histogram([10.0**k for k in range(-9, 9)])
    assert len(result._counts) == BINS


def test_early_is_punctual() -> None:
    latency_summary = histogram([-1.0, -1e-9]).summary
    assert (latency_summary.messages, latency_summary.p50_ms, latency_summary.max_ms) == (2, 0.0, 0.0)
    assert LatencyHistogram().summary.messages == 0


@given(st.lists(st.lists(st.floats(0.0, 10.0), max_size=40), max_size=4))
def test_merged_is_as_if_all_had_been_added_to_one(parts: list[list[float]]) -> None:
    values = [late for part in parts for late in part]
    assert LatencyHistogram.merge(map(histogram, parts)).summary == histogram(values).summary


def meter(late_ms: float, hz: float = 100.0, name: str = "ins", link: str = "eth") -> Meter:
    result = Meter(name, link, hz)
    for k in range(101):
        result.note(k / hz, 1e-3 * late_ms)
    return result


@pytest.mark.parametrize(("late_ms", "held"), [(0.1, True), (4.6, True), (5.1, False), (40.0, False)])
def test_a_rate_is_held_below_half_a_period(late_ms: float, held: bool) -> None:
    rate = meter(late_ms).rate
    assert rate.is_held is held
    assert rate.sent_hz is not None
    assert math.isclose(rate.sent_hz, 100.0, rel_tol=1e-9)


def test_one_that_falls_behind_shows_the_rate_that_it_reached() -> None:
    """100 Hz asked for; each message takes 20 ms."""
    slow = Meter("ins", "eth", 100.0)
    for k in range(101):
        slow.note(k / 100, k / 50 - k / 100)
    assert slow.rate.sent_hz == pytest.approx(50.0)
    assert not slow.rate.is_held


def test_messages_that_were_held_back_are_no_higher_rate() -> None:
    class Sink:
        is_stream = False

        def send(self, data: bytes) -> None: ...

    burst = Burst(kind="burst", hold_s=0.33, from_s=0.0, to_s=10.0)
    line = DevicePipeline(device("power_unit"), scenario(fault=(burst,)))
    stream, instants = SensorStream(line, cast("Endpoint", Sink()), 0), 0
    while (due_s := stream.due_s()) is not None:
        stream.note(due_s, 0.0)
        asyncio.run(stream.send())
        instants += 1
    rate = stream.meter.rate
    assert instants > 1.1 * len(line.sensor.due)  # it left between its cycles, too
    assert rate.lateness.messages == instants
    assert rate.sent_hz == pytest.approx(rate.asked_hz, rel=1e-3)  # its own clock has errors


def test_a_line_that_is_too_slow_is_no_rate_that_holds() -> None:
    punctual = meter(0.1).rate
    counters = EndpointCounters(messages=90, dropped_messages=11, too_slow_messages=11)
    report = TransmissionReport({"eth": counters}, punctual.lateness, {"eth": punctual.lateness}, [punctual])
    assert report.problems == ["ins: its line eth is too slow: 11 messages were dropped"]
    assert report.as_json()["devices"]["ins"]["held"] is False
    assert TransmissionReport({"eth": EndpointCounters()}, punctual.lateness, {}, [punctual]).problems == []
    late = meter(40.0).rate
    assert (
        "p99 lateness is 40.00 ms, above half a period of 5.00 ms"
        in TransmissionReport({}, late.lateness, {}, [late]).problems[0]
    )


def test_the_lateness_of_a_link_is_that_of_all_its_devices() -> None:
    latency_summaries = lateness_by_link(
        [meter(1.0, link="b"), meter(3.0, link="a"), meter(30.0, name="other", link="b")]
    )
    assert {name: (late.messages, late.max_ms) for name, late in latency_summaries.items()} == {
        "a": (101, 3.0),
        "b": (202, 30.0),
    }
