"""C/N0 and the clock of a receiver: what suspects it, with numbers by hand; and that its copies are kept."""

from __future__ import annotations

import math

import pytest
from msgspec.structs import replace

from fti.messages.measurements import Position, ReceiverClock, Satellite, Satellites, Stamp, Velocity
from fti.messages.outputs import Event
from fti.nav.pipeline import Pipeline
from fti.nav.plausibility.monitor import PlausibilityMonitor
from fti.nav.plausibility.signals import SignalTest
from tests.nav.receiver_flights import config

S = 1_000_000_000


def sky(*levels: float | None) -> Satellites:
    """Satellites 1, 2, ... with these C/N0 [dB-Hz]."""
    rows = enumerate(levels, start=1)
    return Satellites(stamp=Stamp(0), satellites=tuple(Satellite(system="G", number=n, cn0_dbhz=c) for n, c in rows))


def clock(offset_s: float, drift: float | None = 1e-6, sd: float | None = 1e-8) -> ReceiverClock:
    return ReceiverClock(stamp=Stamp(0), offset=offset_s, drift=drift, offset_sd=sd)


@pytest.mark.parametrize(
    ("after", "is_sign"),
    [
        ((47.0, 48.0, 49.0, 46.0), True),  # + 7, + 7, + 7, + 7 dB
        ((33.0, 34.0, 35.0, 32.0), True),  # 7 dB less
        ((45.0, 46.0, 47.0, 44.0), False),  # 5 dB
        ((40.0, 41.0, 42.0, 12.0), True),  # one by 27 dB: 6.75 dB in the mean
        ((40.0, 41.0, 42.0, 19.0), False),  # one by 20 dB: 5 dB
        ((55.0, 56.0, 57.0, None), False),  # three satellites
        ((40.0, 41.0, 42.0, 39.0, 60.0, 60.0), False),  # two that are new
    ],
)
def test_a_change_of_all_satellites_is_a_sign(after: tuple[float | None, ...], is_sign: bool) -> None:
    test = SignalTest()
    assert test.feed_satellites(0, sky(40.0, 41.0, 42.0, 39.0)) is None
    assert (test.feed_satellites(9 * S, sky(*after)) is not None) is is_sign
    assert test.is_suspected(10 * S) is is_sign


def test_a_slow_change_is_none_and_a_suspicion_ends() -> None:
    """0.5 dB a second: 5 dB in 10 s, 20 dB in 40 s.  Then 10 dB at once: 30 s."""
    test = SignalTest()
    for second in range(41):
        level = 45.0 - 0.5 * second
        assert test.feed_satellites(second * S, sky(level, level, level, level)) is None
    assert test.feed_satellites(41 * S, sky(35.0, 35.0, 35.0, 35.0)) is not None
    assert test.is_suspected(70 * S)
    assert not test.is_suspected(90 * S)


@pytest.mark.parametrize(
    ("step_s", "is_sign"),
    [
        (0.0, False),
        (1.2e-7, False),  # 120 ns: the limit is 100 ns + 5.5 * 14 ns = 178 ns
        (2.5e-7, True),
        (-2.5e-7, True),
        (1e-3, False),  # a receiver that keeps its clock within a millisecond
        (-2e-3, False),
        (1e-3 + 5e-6, True),
    ],
)
def test_a_clock_that_departs_from_its_rate_is_a_sign(step_s: float, is_sign: bool) -> None:
    """1e-6 s/s: a microsecond a second is no step."""
    test = SignalTest()
    for second in range(5):
        assert test.feed_clock(second * S, clock(1e-6 * second)) is None
    assert (test.feed_clock(5 * S, clock(5e-6 + step_s)) is not None) is is_sign


def test_without_a_rate_or_across_a_gap_a_clock_gives_no_sign() -> None:
    test = SignalTest()
    test.feed_clock(0, clock(0.0, drift=None))
    assert test.feed_clock(S, clock(1e-5, drift=None)) is None
    test.feed_clock(2 * S, clock(0.0))
    assert test.feed_clock(20 * S, clock(1e-3 / 3)) is None


@pytest.mark.parametrize(
    ("offset", "drift", "sd"), [(0.0, math.inf, 0.0), (1e308, -1.7e308, 0.0), (3.3e-4, 0.0, math.nan)]
)
def test_what_is_no_number_is_no_sign(offset: float, drift: float, sd: float) -> None:
    """An infinite step raised a ValueError."""
    test = SignalTest()
    test.feed_clock(0, clock(0.0, drift=0.0))
    assert test.feed_clock(4 * S, clock(offset, drift, sd)) is None


def test_the_drift_of_a_receiver_that_falls_silent_is_forgotten() -> None:
    """Half of the limit of the drift in its last minute, and no fix since: its copies were kept for ever."""
    monitor = PlausibilityMonitor(config(("gnss",), baro=False))
    for second in range(61):
        stamp, north = Stamp(second * S), 60.0 * second
        speed = Velocity(stamp=stamp, north=60.0, east=0.0, down=0.0, sd=0.1)
        lat = 0.8 + (north + 0.25 * max(second - 20, 0)) / 6_367_000.0
        monitor.check("gnss", speed, stamp.t_rx_ns)
        monitor.check("gnss", Position(stamp=stamp, lat=lat, lon=0.1, horizontal_sd=1.0), stamp.t_rx_ns)
        monitor.tick(stamp.t_rx_ns)
    assert monitor.find_suspects() == {"gnss"}
    assert monitor._tests["gnss"].position.is_valid
    monitor.tick(70 * S)
    assert monitor.find_suspects() == frozenset()


def test_receivers_that_aid_the_filter_are_suspected_for_30_s() -> None:
    monitor = PlausibilityMonitor(config(("gnss",), baro=False))
    assert monitor.watches_signals("gnss", Satellites)
    assert not monitor.watches_signals("imu", Satellites)
    monitor.feed_signals("gnss", sky(40.0, 41.0, 42.0, 39.0), 0)
    assert monitor.find_suspects() == frozenset()
    (event,) = monitor.feed_signals("gnss", sky(50.0, 51.0, 52.0, 49.0), S)
    assert "suspected for 30 s: C/N0 of its satellites changed by +10 dB" in event.text  # type: ignore[union-attr]
    assert monitor.find_suspects() == {"gnss"}
    monitor.tick(20 * S)
    assert monitor.find_suspects() == {"gnss"}
    monitor.tick(40 * S)
    assert monitor.find_suspects() == frozenset()


def test_signals_reach_the_test_through_the_pipeline() -> None:
    pipeline = Pipeline(config(("gnss",), baro=False), None)
    stamps = [Stamp(t_ns) for t_ns in (100 * S, 101 * S)]
    levels = [(40.0, 41.0, 42.0, 39.0), (30.0, 31.0, 32.0, 29.0)]
    out = [pipeline.feed("gnss", replace(sky(*each), stamp=stamp)) for each, stamp in zip(levels, stamps, strict=True)]
    assert out[0] == []
    (event,) = out[1]
    assert isinstance(event, Event)
    assert (event.source, event.level) == ("gnss", "info")
