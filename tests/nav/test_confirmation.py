"""An independent source confirms a receiver: it is readmitted, or the filter restarts.

Truth, unit and receivers are those of ``receiver_flights``, through the whole pipeline; the source is drawn here: 1
Hz, errors of 8 m of which it states 10 m.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fti.config import AlertLimits, Config, parse
from fti.geodesy.wgs84 import radii
from fti.messages.measurements import Attitude, ImuSample, Measurement, Position, PressureAltitude, Stamp, Velocity
from fti.messages.outputs import Event, FilterSolution, SourceValidity
from fti.nav.confirmation import ConfirmationMonitor, Size, find_tolerance
from fti.nav.pipeline import Pipeline
from fti.nav.protection import FilterReference
from fti.nav.source_interpolation import PositionState
from tests.nav.receiver_flights import SECOND_NS, T0, VELOCITY_SD, Fault, Fixes, Flight, draw, offset_after, silent

LAT, RADIUS = 0.8, 6_366_000.0
LIMITS = AlertLimits()


def config(depends: dict[str, list[str] | None], filtered: bool) -> Config:
    """gnss, and independent sources by name with what they depend on."""
    device = {"link": "l", "driver": "d"}
    sources = [
        {"name": n, "max_age_ms": 1500, **device, **({} if on is None else {"depends_on": on})}
        for n, on in depends.items()
    ]
    nav: dict[str, Any] = {"attitude": ["imu"], "position": ["gnss", *depends]}
    table: dict[str, Any] = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [{"name": name, **device} for name in ("imu", "air", "gnss")] + sources,
        "nav": nav | ({"filter": {"imu": "imu", "gnss": ["gnss"], "baro": "air"}} if filtered else {}),
    }
    return parse(table, "", Path("t.toml"))


# ---------------------------------------------------------------------------------------------------- the numbers


def at(north_m: float, sd: float = 2.0, up_m: float = 0.0, newest_ns: int = 0) -> PositionState:
    return PositionState(LAT + north_m / RADIUS, 0.2, 100.0 + up_m, sd, sd, None, None, None, newest_ns)


@pytest.mark.parametrize(
    ("apart_m", "source_sd", "size_m", "tolerance"),
    [
        (10.0, 10.0, 200.0, 58.0),  # 10 + 4.8 * 10
        (10.0, 10.0, 110.0, None),  # half of the contradiction is 55 m
        (60.0, 10.0, 1000.0, None),  # 4.8 * hypot(2, 10) = 49 m: they disagree
        (0.0, 42.0, 10_000.0, None),  # 4.8 * 42 = 202 m: beyond the alert limit of 200 m
        (0.0, 41.0, 10_000.0, 196.8),
        (0.0, 0.0, 200.0, None),  # no sigma
    ],
)
def test_a_source_confirms_half_of_the_contradiction(
    apart_m: float, source_sd: float, size_m: float, tolerance: float | None
) -> None:
    """By hand, with K = 4.80."""
    value = find_tolerance(at(0.0), at(apart_m, source_sd), Size(size_m), LIMITS)
    assert value == (None if tolerance is None else pytest.approx(tolerance, abs=0.2))


def test_a_height_that_contradicts_needs_a_height_of_the_source() -> None:
    """By hand: 3 m + 4.42 * 4 m are less than half of 47 m, and than the 30 m of the alert limit."""
    size = Size(200.0, 47.0)
    assert find_tolerance(at(0.0), at(0.0, 4.0, up_m=3.0), size, LIMITS) == pytest.approx(20.7, abs=0.1)
    assert find_tolerance(at(0.0), at(0.0, 4.0, up_m=47.0), size, LIMITS) is None
    assert find_tolerance(at(0.0), at(0.0, 4.0, up_m=3.0), Size(None, 47.0), LIMITS) is None


def agreements(depends: list[str] | None, *, source_s: Sequence[int], seconds: int = 45) -> list[int]:
    """Seconds at which a source confirms a receiver at the same place; it gives a position at ``source_s``."""
    monitor, found = ConfirmationMonitor(config({"box": depends}, filtered=False), {}), []
    for second in range(seconds):
        t_ns = second * SECOND_NS
        place = Position(stamp=Stamp(t_ns), lat=LAT, lon=0.2, alt=100.0, horizontal_sd=3.0, vertical_sd=3.0)
        monitor.feed("gnss", place, [place], t_ns)
        if second in source_s:
            monitor.feed("box", place, [place], t_ns)
        if monitor.update(t_ns, {"gnss": Size(200.0)}, None, None, None):
            found.append(second)
    return found


def test_it_takes_30_s_without_a_break() -> None:
    assert agreements(["map"], source_s=range(45))[0] == 30
    broken = [*range(20), *range(24, 60)]
    assert agreements(["map"], source_s=broken, seconds=60)[0] == 54


def test_who_shares_an_entry_or_declares_nothing_confirms_nothing() -> None:
    assert not agreements(["satellites", "inertial"], source_s=range(45))
    assert not agreements(None, source_s=range(45))
    assert agreements([], source_s=range(45))


def test_a_source_that_its_own_tests_refuse_confirms_nothing() -> None:
    monitor = ConfirmationMonitor(config({"box": ["map"]}, filtered=False), {})
    for second in range(45):
        place = Position(stamp=Stamp(0), lat=LAT, lon=0.2, alt=100.0, horizontal_sd=3.0, vertical_sd=3.0)
        refused = Position(stamp=Stamp(0), lat=LAT, lon=0.2, alt=100.0, valid=False)
        monitor.feed("gnss", place, [refused], second * SECOND_NS)
        monitor.feed("box", place, [refused], second * SECOND_NS)
        assert not monitor.update(second * SECOND_NS, {"gnss": Size(200.0)}, None, None, None)


def test_one_of_the_two_against_the_filter_is_nothing_and_both_are_distinguished() -> None:
    """The filter is 90 m away: beyond its 50 m and 4.8 * 3 m of the receiver, not beyond 4.8 * 10 m of the box."""
    for sd, expected in ((10.0, []), (3.0, [True])):
        monitor = ConfirmationMonitor(config({"box": ["map"]}, filtered=False), {})
        found = []
        for second in range(31):
            t_ns = second * SECOND_NS
            place = Position(stamp=Stamp(t_ns), lat=LAT, lon=0.2, alt=100.0, horizontal_sd=3.0, vertical_sd=3.0)
            other = Position(stamp=Stamp(t_ns), lat=LAT, lon=0.2, alt=100.0, horizontal_sd=sd, vertical_sd=3.0)
            monitor.feed("gnss", place, [place], t_ns)
            monitor.feed("box", other, [other], t_ns)
            filtered = FilterReference(at(90.0), 50.0, 50.0)
            found += monitor.update(t_ns, {"gnss": Size(400.0)}, None, filtered, None)
        assert [confirmation.is_against_filter for confirmation in found] == expected


# ------------------------------------------------------------------------------------------------ through the pipeline


@dataclass
class FlightLog:
    """validity : of gnss, time [s] and valid;  filtered : time [s], horizontal error and HPL [m];  events : texts"""

    validity: list[tuple[float, bool]] = field(default_factory=list)
    filtered: list[tuple[float, float, float]] = field(default_factory=list)
    events: list[tuple[float, str]] = field(default_factory=list)

    def is_valid_at(self, t: float) -> bool:
        return [valid for at_s, valid in self.validity if at_s <= t][-1]

    def texts(self) -> str:
        return "\n".join(f"{t:.0f} s: {text}" for t, text in self.events)

    def time_of(self, text: str) -> float:
        return next(t for t, event in self.events if text in event)


def fly(flight: Flight, fault: Fault, source: list[str] | None, *, filtered: bool, until_s: float) -> FlightLog:
    pipeline, log = Pipeline(config({"box": source}, filtered), None), FlightLog()
    truth = flight.truth.state(flight.t)
    receiver = _receiver(fault(flight.receivers["gnss"]))
    rows = sorted([*receiver, *_independent_source(flight), *_air(flight)], key=lambda r: r[0])
    number = 0
    for k, t in enumerate(flight.t[flight.t < until_s].tolist()):
        t_ns = T0 + round(t * SECOND_NS)
        stamp, row = Stamp(t_ns), flight.imu[k].tolist()
        out = pipeline.feed("imu", ImuSample(stamp=stamp, accel_b=tuple(row[:3]), gyro_b=tuple(row[3:])))
        roll, pitch, heading = (float(getattr(truth, name)[k]) for name in ("roll", "pitch", "heading"))
        out += pipeline.feed("imu", Attitude(stamp=stamp, roll=roll, pitch=pitch, heading=heading))
        while number < len(rows) and rows[number][0] < t:
            out += pipeline.feed(*rows[number][1:])
            number += 1
        out += [*pipeline.tick(t_ns), *pipeline.tick(t_ns + SECOND_NS // 50)]
        for each in out:
            _record(log, each, t, float(truth.lat[k]), float(truth.lon[k]))
    return log


def _record(log: FlightLog, each: Any, t: float, lat: float, lon: float) -> None:
    if isinstance(each, Event):
        log.events.append((t, f"{each.source}: {each.text}"))
    elif isinstance(each, SourceValidity) and each.source == "gnss":
        log.validity.append((t, each.valid))
    elif isinstance(each, FilterSolution) and each.lat is not None and each.lon is not None and each.hpl is not None:
        meridian, normal = (float(r) for r in radii(lat))
        error = np.hypot((each.lat - lat) * meridian, (each.lon - lon) * normal * np.cos(lat))
        log.filtered.append((t, float(error), each.hpl))


def _receiver(fixes: Fixes) -> list[tuple[float, str, Measurement]]:
    rows: list[tuple[float, str, Measurement]] = []
    for t, lat, lon, alt, vel in zip(
        *(c.tolist() for c in (fixes.t, fixes.lat, fixes.lon, fixes.alt, fixes.vel)), strict=True
    ):
        stamp = Stamp(T0 + round(t * SECOND_NS))
        rows.append((t, "gnss", Position(stamp=stamp, lat=lat, lon=lon, alt=alt, horizontal_sd=1.8, vertical_sd=2.7)))
        rows.append((t, "gnss", Velocity(stamp=stamp, north=vel[0], east=vel[1], down=vel[2], sd=VELOCITY_SD)))
    return rows


def _independent_source(flight: Flight) -> list[tuple[float, str, Measurement]]:
    rng, t = np.random.default_rng(7), np.arange(0.6, flight.t[-1], 1.0)
    state = flight.truth.state(t)
    errors = rng.normal(0.0, 8.0, (len(t), 3)) / [RADIUS, RADIUS * np.cos(LAT), 1.0]
    rows: list[tuple[float, str, Measurement]] = []
    for k, at_s in enumerate(t.tolist()):
        lat, lon, alt = (float(getattr(state, n)[k] + errors[k, i]) for i, n in enumerate(("lat", "lon", "alt")))
        stamp, (north, east, down) = Stamp(T0 + round(at_s * SECOND_NS)), state.vel_n[k].tolist()
        rows.append((at_s, "box", Velocity(stamp=stamp, north=north, east=east, down=down, sd=0.5)))
        rows.append(
            (at_s, "box", Position(stamp=stamp, lat=lat, lon=lon, alt=alt, horizontal_sd=10.0, vertical_sd=10.0))
        )
    return rows


def _air(flight: Flight) -> list[tuple[float, str, Measurement]]:
    return [
        (t, "air", PressureAltitude(stamp=Stamp(T0 + round(t * SECOND_NS)), alt_press=alt))
        for t, alt in flight.baro.tolist()
    ]


def hidden(size_m: float, *, ends: bool) -> Fault:
    """An offset east from 60 to 80 s; silent from 80 to 86 s, so that the step back is not observed."""

    def offset(since: np.ndarray) -> np.ndarray:
        return np.where((since < 20.0) | (not ends), size_m, 0.0)[:, None] * [0.0, 1.0, 0.0]

    lie = offset_after(60.0, offset)
    return lambda fixes: silent(80.0, 86.0)(lie(fixes))


def test_a_receiver_that_is_right_again_is_back_in_with_an_independent_source() -> None:
    """400 m of contradiction; 30 s after its return."""
    log = fly(draw(0), hidden(400.0, ends=True), ["map"], filtered=False, until_s=130.0)
    assert not log.is_valid_at(114.0)
    assert log.is_valid_at(120.0), log.texts()


def test_without_an_independent_source_it_stays_unconfirmed() -> None:
    log = fly(draw(0), hidden(400.0, ends=True), None, filtered=False, until_s=130.0)
    assert not log.is_valid_at(129.0)


@pytest.mark.parametrize(("size_m", "ends"), [(400.0, False), (80.0, True)])
def test_a_lie_that_lasts_and_one_that_the_source_cannot_detect_stay_out(size_m: float, ends: bool) -> None:
    """80 m: 4.8 sigma of the source are 48 m, more than half."""
    log = fly(draw(0), hidden(size_m, ends=ends), ["map"], filtered=False, until_s=150.0)
    assert not log.is_valid_at(149.0), log.texts()


def spoofed() -> Fault:
    """East at 8 m/s with the velocity that belongs to it from 120 to 150 s; silent until 156 s."""

    def offset(since: np.ndarray) -> np.ndarray:
        return np.where(since < 30.0, 8.0 * since, 0.0)[:, None] * [0.0, 1.0, 0.0]

    def velocity(since: np.ndarray) -> np.ndarray:
        return np.where(since < 30.0, 8.0, 0.0)[:, None] * [0.0, 1.0, 0.0]

    lie = offset_after(120.0, offset, velocity)
    return lambda fixes: silent(150.0, 156.0)(lie(fixes))


@pytest.mark.parametrize("source", [["map"], None])
def test_a_receiver_that_the_filter_has_excluded_aids_again_when_a_source_confirms_it(
    source: list[str] | None,
) -> None:
    log = fly(draw(0), spoofed(), source, filtered=True, until_s=260.0)
    assert log.time_of("gnss: refused") < 130.0
    print(log.texts())
    late = [error for t, error, _ in log.filtered if t > 250.0]
    assert all(error < hpl for t, error, hpl in log.filtered if t > 60.0)
    if source is None:
        assert "aids the filter again" not in log.texts()
    else:
        assert 186.0 < log.time_of("gnss: aids the filter again: box agrees with it") < 225.0
        assert max(late) < 6.0


def pushed(flight: Flight, acceleration: float) -> Flight:
    """The inertial unit feels so much too much to the right from 120 to 140 s [m/s^2]."""
    imu = flight.imu.copy()
    imu[(flight.t >= 120.0) & (flight.t < 140.0), 1] += acceleration
    return replace(flight, imu=imu)


@pytest.mark.parametrize("source", [["map"], None])
def test_two_that_agree_against_the_filter_restart_it(source: list[str] | None) -> None:
    """0.5 m/s^2 for 20 s: 10 m/s, in which the filter believes; it refuses the receiver."""
    log = fly(pushed(draw(0), 0.5), lambda fixes: fixes, source, filtered=True, until_s=260.0)
    print(log.texts())
    assert log.time_of("gnss: refused") < 130.0
    before = [error for t, error, _ in log.filtered if 145.0 < t < 150.0]
    late = [error for t, error, _ in log.filtered if t > 250.0]
    assert min(before) > 50.0
    if source is None:
        assert "restarts" not in log.texts()
        assert min(late) > 200.0
    else:
        assert log.time_of("filter: restarts: gnss and box agree, and contradict it") < 200.0
        assert max(late) < 6.0
