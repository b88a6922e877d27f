"""Receivers with a lasting step, through the whole pipeline: provisional outputs until readmission.

Truth, unit and receivers are those of ``receiver_flights``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.wgs84 import radii
from fti.messages.measurements import Attitude, ImuSample, Stamp
from fti.messages.outputs import Event, FilterSolution, ProvisionalSolution
from fti.messages.reasons import Reason
from fti.nav.pipeline import Pipeline
from tests.nav.receiver_flights import (
    SECOND_NS,
    T0,
    Fault,
    Fixes,
    Flight,
    config,
    draw,
    measurements,
    offset_after,
    silent,
)

Array = NDArray[np.float64]
#: A step; a lie that only the filter sees begins when it has a copy to compare with [s].
BEGIN, BEGIN_DRAWN = 30.0, 60.0


@dataclass(frozen=True)
class Row:
    """An output at t [s]: its error horizontally and upwards [m]."""

    t: float
    horizontal: float
    up: float
    output: ProvisionalSolution | FilterSolution


@dataclass
class FlightLog:
    """What came out.  rows : of two outputs that have a place, in order"""

    rows: list[Row] = field(default_factory=list)
    events: list[tuple[float, str]] = field(default_factory=list)

    @property
    def provisional(self) -> list[tuple[Row, ProvisionalSolution]]:
        return [(row, row.output) for row in self.rows if isinstance(row.output, ProvisionalSolution)]

    def times(self) -> Array:
        """Of provisional solutions [s]."""
        return np.array([row.t for row, _ in self.provisional])

    def texts(self) -> str:
        return "\n".join(f"{t:.1f} s: {text}" for t, text in self.events)


def fly(flight: Flight, fault: Fault, until_s: float, readmit_s: float = np.inf) -> FlightLog:
    """Of a receiver gnss, inertial unit and barometer; the operator readmits the receiver at ``readmit_s``."""
    pipeline, log = Pipeline(config(tuple(flight.receivers), True), None), FlightLog()
    truth, queue = flight.truth.state(flight.t), measurements(flight, {"gnss": fault(flight.receivers["gnss"])}, True)
    at_s, device, m = next(queue)
    for k, t in enumerate(flight.t[flight.t < until_s].tolist()):
        t_ns = T0 + round(t * SECOND_NS)
        stamp, row = Stamp(t_ns), flight.imu[k].tolist()
        out = pipeline.feed("imu", ImuSample(stamp=stamp, accel_b=tuple(row[:3]), gyro_b=tuple(row[3:])))
        roll, pitch, heading = (float(getattr(truth, name)[k]) for name in ("roll", "pitch", "heading"))
        out += pipeline.feed("imu", Attitude(stamp=stamp, roll=roll, pitch=pitch, heading=heading))
        while at_s < t:
            out += pipeline.feed(device, m)
            at_s, device, m = next(queue, (np.inf, device, m))
        if t >= readmit_s:
            out, readmit_s = [*out, *pipeline.readmit("gnss", t_ns)], np.inf
        for each in (*out, *pipeline.tick(t_ns)):
            _record(log, each, t_ns, truth.lat[k], truth.lon[k], truth.alt[k])
    return log


def _record(log: FlightLog, each: object, t_ns: int, lat: float, lon: float, alt: float) -> None:
    """Against the true place of that time."""
    t = (t_ns - T0) / SECOND_NS
    if isinstance(each, Event):
        log.events.append((t, f"{each.source}: {each.text}"))
    elif isinstance(each, ProvisionalSolution | FilterSolution) and each.lat is not None:
        assert each.t_ns == t_ns
        assert each.lon is not None
        assert each.alt is not None
        meridian, normal = (float(r) for r in radii(lat))
        north, east = (each.lat - lat) * meridian, (each.lon - lon) * normal * np.cos(lat)
        log.rows.append(Row(t, float(np.hypot(north, east)), float(each.alt - alt), each))


def constant(*metres: float) -> Callable[[Array], Array]:
    return lambda since: np.tile(np.array(metres), (len(since), 1))


def until(seconds: float, offset: Callable[[Array], Array]) -> Callable[[Array], Array]:
    return lambda since: (since < seconds)[:, None] * offset(since)


def drawn_away(begin: float, rate: float, seconds: float) -> Fault:
    """East at ``rate`` [m/s] with the velocity that belongs to it, for so long; then it stays there."""
    east = np.array([0.0, 1.0, 0.0])
    return offset_after(
        begin,
        lambda since: rate * np.minimum(since, seconds)[:, None] * east,
        lambda since: rate * (since < seconds)[:, None] * east,
    )


STEP = offset_after(BEGIN, constant(0.0, 100.0, 0.0))


def assert_never_valid_and_covered(log: FlightLog) -> None:
    for row, output in log.provisional:
        assert not output.valid
        assert output.reasons == (Reason.UNCONFIRMED,)
        assert output.hpl is not None
        assert output.vpl is not None
        assert row.horizontal <= output.hpl, row
        assert abs(row.up) <= output.vpl, row
        assert "fti readmit" in output.readmission


def numbers(output: ProvisionalSolution | FilterSolution, *names: str) -> dict[str, float]:
    found = {name: getattr(output, name) for name in names}
    assert None not in found.values()
    return found


def filtered(log: FlightLog, from_s: float, to_s: float) -> list[Row]:
    return [row for row in log.rows if isinstance(row.output, FilterSolution) and from_s <= row.t < to_s]


@pytest.fixture(scope="module")
def stepped() -> FlightLog:
    """100 m east from 30 s on; the operator readmits the receiver at 75 s."""
    return fly(draw(0), STEP, 85.0, readmit_s=75.0)


def test_a_receiver_that_steps_and_stays_has_a_provisional_filter_until_the_operator_readmits_it(
    stepped: FlightLog,
) -> None:
    """The filter goes on without it, and follows it once it is readmitted."""
    log = stepped
    times = log.times()
    assert BEGIN + 30.0 <= times[0] <= BEGIN + 33.0, log.texts()
    assert 74.5 <= times[-1] <= 75.1
    assert np.max(np.diff(times)) < 0.45, "without a break; ticks have half of the live rate here"
    assert_never_valid_and_covered(log)
    assert all(92.0 < row.horizontal < 108.0 and abs(row.up) < 8.0 for row, _ in log.provisional)
    assert all(output.horizontal_sd is not None and output.horizontal_sd < 3.0 for _, output in log.provisional)
    assert {output.quantities for _, output in log.provisional} == {("position", "height", "velocity")}
    assert all("a step back" in output.readmission for _, output in log.provisional)
    rows = filtered(log, BEGIN, 75.0)
    assert all(row.horizontal < 40.0 for row in rows), "the filter does not follow it"
    assert all(isinstance(row.output, FilterSolution) and row.horizontal < (row.output.hpl or 0.0) for row in rows)
    assert all(92.0 < row.horizontal < 108.0 for row in filtered(log, 77.0, 85.0)), log.texts()
    assert "nav: gnss: refused" not in log.texts()


def test_its_level_is_the_distance_from_the_filter_and_what_that_may_be_wrong(stepped: FlightLog) -> None:
    """3.72 and 3.09 sigma of the filter, or more where its copies have drifted further."""
    places = {row.output.t_ns: row.output for row in filtered(stepped, BEGIN, 75.0)}
    for _, output in stepped.provisional:
        here = numbers(places[output.t_ns], "lat", "lon", "alt", "horizontal_sd", "vertical_sd", "hpl", "vpl")
        values = numbers(output, "lat", "lon", "alt", "distance", "height_difference", "hpl", "vpl")
        meridian, normal = (float(r) for r in radii(here["lat"]))
        north = (values["lat"] - here["lat"]) * (meridian + here["alt"])
        east = (values["lon"] - here["lon"]) * (normal + here["alt"]) * np.cos(here["lat"])
        assert values["distance"] == pytest.approx(np.hypot(north, east), abs=0.01)
        assert values["height_difference"] == pytest.approx(values["alt"] - here["alt"], abs=1e-6)
        horizontal, vertical = values["hpl"] - values["distance"], values["vpl"] - abs(values["height_difference"])
        assert 3.72 * here["horizontal_sd"] - 1e-6 <= horizontal <= 1.02 * here["hpl"]
        assert 3.09 * here["vertical_sd"] - 1e-6 <= vertical <= 1.02 * here["vpl"]


def test_a_receiver_that_steps_back_is_not_unconfirmed_any_more() -> None:
    log = fly(draw(0), offset_after(BEGIN, until(40.0, constant(0.0, 100.0, 0.0))), 106.0)
    assert log.times()[0] <= BEGIN + 33.0
    assert 70.0 <= log.times()[-1] <= 74.5, log.texts()
    assert_never_valid_and_covered(log)
    assert any("position valid again" in text for _, text in log.events)


def test_a_receiver_that_the_filter_excludes_has_one_too() -> None:
    """Drawn away with its velocity: its own tests see nothing.  It begins 30 s after the exclusion."""
    log = fly(draw(0), drawn_away(BEGIN_DRAWN, 5.0, 20.0), 110.0, readmit_s=105.0)
    excluded = next(t for t, text in log.events if "nav: gnss: refused" in text)
    assert excluded + 29.0 <= log.times()[0] <= excluded + 33.0
    assert 104.5 <= log.times()[-1] <= 105.1
    assert_never_valid_and_covered(log)
    assert all(92.0 < row.horizontal < 108.0 for row, _ in log.provisional)
    output = log.provisional[0][1].readmission
    assert "a step back" in output
    assert "a sigma of the filter" not in output, "its velocity is too noisy to show a contradiction of that size"
    assert "'fti readmit gnss'" in output


def test_a_height_alone_is_unconfirmed_alone() -> None:
    """47 m up; the position goes on aiding, and the level is vertical."""
    log = fly(draw(0), offset_after(BEGIN, constant(0.0, 0.0, -47.0)), 85.0, readmit_s=75.0)
    assert {output.quantities for _, output in log.provisional} == {("height",)}
    assert BEGIN + 30.0 <= log.times()[0] <= BEGIN + 33.0
    assert log.times()[-1] <= 75.1
    assert_never_valid_and_covered(log)
    assert all(row.horizontal < 8.0 and 35.0 < row.up < 59.0 for row, _ in log.provisional)
    assert all(
        "fti readmit" in output.readmission and "independent" not in output.readmission for _, output in log.provisional
    )
    assert all(35.0 < row.up < 59.0 for row in filtered(log, 77.0, 85.0)), log.texts()


def test_one_that_its_own_tests_refuse_again_is_unconfirmed_anew_after_30_s() -> None:
    """Another 60 m north at 70 s."""
    log = fly(draw(0), lambda fixes: offset_after(70.0, constant(60.0, 0.0, 0.0))(STEP(fixes)), 105.0)
    times = log.times()
    assert not np.any((times > 74.5) & (times < 100.0)), log.texts()
    assert np.any(times > 103.5)
    assert_never_valid_and_covered(log)
    assert all(108.0 < row.horizontal < 125.0 for row, _ in log.provisional if row.t > 100.0)


def test_one_that_contradicts_its_own_provisional_filter_loses_it_for_30_s() -> None:
    """From 70 s on it is drawn away by 5 m/s with its velocity, which its own tests do not see."""
    log = fly(draw(0), lambda fixes: drawn_away(70.0, 5.0, 20.0)(STEP(fixes)), 114.0)
    times = log.times()
    last = max(times[times < 95.0])
    assert 75.0 <= last <= 82.0, log.texts()
    assert last + 30.0 <= min(times[times > last]) <= last + 33.0
    assert_never_valid_and_covered(log)


def test_it_ends_when_the_receiver_is_silent_or_the_filter_has_nothing_to_run_on() -> None:
    log = fly(draw(0), lambda fixes: silent(66.0, 99.0)(STEP(fixes)), 74.0)
    assert 68.5 <= log.times()[-1] <= 70.6
    flight = draw(0)
    is_kept = (flight.t < 66.0) | (flight.t >= 66.5)
    log = fly(replace(flight, t=flight.t[is_kept], imu=flight.imu[is_kept]), STEP, 74.0)
    assert log.times()[0] <= BEGIN + 33.0
    assert log.times()[-1] <= 66.1


def test_measurements_that_are_no_numbers_aid_nothing() -> None:
    def broken(fixes: Fixes) -> Fixes:
        lat, lon = fixes.lat.copy(), fixes.lon.copy()
        lat[1::7], lon[2::11] = np.nan, np.inf
        return replace(
            STEP(fixes), lat=np.where(fixes.t > BEGIN + 5.0, STEP(replace(fixes, lat=lat)).lat, STEP(fixes).lat)
        )

    log = fly(draw(0), broken, 68.0)
    assert log.provisional
    assert all(np.isfinite([row.horizontal, row.up]).all() for row, _ in log.provisional)
    assert_never_valid_and_covered(log)


FAR = offset_after(BEGIN, constant(0.0, 3000.0, 0.0))


@pytest.mark.parametrize("fault", [lambda fixes: fixes, silent(20.0, 45.0), FAR], ids=["sound", "silent", "far"])
def test_a_receiver_that_nothing_refuses_or_that_is_kilometres_away_has_none(fault: Fault) -> None:
    assert not fly(draw(0), fault, 66.0).provisional
