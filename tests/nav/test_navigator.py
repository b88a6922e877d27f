"""The filter as used by a pipeline: alignment, convergence, mode, late measurements, hostile inputs."""

from __future__ import annotations

import dataclasses
import math
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.rotations import mat_en, mat_from_rpy
from fti.geodesy.wgs84 import ecef_from_geodetic, radii
from fti.hil.flight.random_routes import random_flight
from fti.hil.flight.trajectory import FlightState
from fti.hil.sensors.inertial import angular_rate_b, specific_force_b
from fti.messages.outputs import FilterMode
from fti.messages.reasons import Reason
from fti.nav.filter.aiding import BaroAltitude, GnssPosition, GnssVelocity, SlantRange
from fti.nav.filter.error_states import BARO_DRIFT, GNSS_DRIFTS, Extra, FilterModel
from fti.nav.filter.estimate import InitialState
from fti.nav.filter.innovation_gate import GateDecision
from fti.nav.filter.navigator import InertialNavigator
from tests.helpers import ROOT

Array = NDArray[np.float64]

SECOND = 1_000_000_000
STEP = 0.04
T0 = 1_700_000_000 * SECOND


@pytest.fixture(scope="module")
def flight() -> FlightState:
    return random_flight(np.random.default_rng(5), 32.0).state(np.arange(0.0, 30.0, STEP))


def ns(t: float) -> int:
    return T0 + round(t * SECOND)


def gnss(state: FlightState, k: int, east: float = 0.0) -> tuple[GnssPosition, GnssVelocity]:
    _, normal = radii(state.lat[k])
    lon = float(state.lon[k]) + east / float((normal + state.alt[k]) * np.cos(state.lat[k]))
    north, east_ms, down = state.vel_n[k].tolist()
    position = GnssPosition(float(state.lat[k]), lon, float(state.alt[k]), 1.5, 2.0)
    return position, GnssVelocity(north, east_ms, down, 0.1)


def fly(
    navigator: InertialNavigator,
    state: FlightState,
    is_received: Callable[[float], bool] = lambda t: True,
    east: Callable[[float], float] = lambda t: 0.0,
    delay: int = 0,
    every: int = 10,
    watch: bool = False,
) -> list[FilterMode]:
    """Noise-free sensors; a fix every so many samples, so many samples late; the modes, if they are watched."""
    forces, rates, modes = specific_force_b(state), angular_rate_b(state), []
    for k, t in enumerate(state.t.tolist()):
        navigator.feed_inertial(ns(t), forces[k], rates[k])
        j = k - delay
        if j >= 0 and j % every == 0 and is_received(float(state.t[j])):
            for aiding in gnss(state, j, east(float(state.t[j]))):
                navigator.feed_aiding(ns(float(state.t[j])), aiding)
        if watch:
            modes.append(navigator.mode(ns(t))[0])
    return modes


def metres_off(navigator: InertialNavigator, state: FlightState, k: int = -1) -> float:
    here = navigator.at(ns(float(state.t[k])))
    assert here is not None
    meridian, normal = (float(r) for r in radii(state.lat[k]))
    lat, lon, alt = here.geodetic
    east = (lon - float(state.lon[k])) * (normal + alt) * math.cos(lat)
    return math.hypot((lat - float(state.lat[k])) * (meridian + alt), east, alt - float(state.alt[k]))


def started(state: FlightState, model: FilterModel | None = None, level_sd: float = 2.0) -> InertialNavigator:
    navigator = InertialNavigator(model or FilterModel())
    north, east, down = state.vel_n[0].tolist()
    start = InitialState(
        float(state.lat[0]), float(state.lon[0]), float(state.alt[0]), (north, east, down), float(state.roll[0]),
        float(state.pitch[0]), float(state.heading[0]), (level_sd, level_sd, 2.0), (0.2,) * 3, (0.01, 0.01, 0.02),
    )  # fmt: skip
    navigator.begin(ns(0.0) - 1, start, specific_force_b(state)[0], angular_rate_b(state)[0])
    return navigator


def test_it_aligns_in_flight_without_an_attitude_and_converges(flight: FlightState) -> None:
    navigator = InertialNavigator(FilterModel(extras=GNSS_DRIFTS))
    assert navigator.output(ns(0.0)).reasons == (Reason.NO_IMU,)
    modes = fly(navigator, flight, watch=True)
    assert {FilterMode.WAITING, FilterMode.ALIGNING} >= set(modes[:20])
    assert modes[-1] is FilterMode.AIDED
    output = navigator.output(ns(float(flight.t[-1])))
    assert output.valid
    assert output.reasons == ()
    assert metres_off(navigator, flight) < 1.0
    assert output.roll == pytest.approx(float(flight.roll[-1]), abs=math.radians(0.5))
    assert output.horizontal_sd is not None
    assert output.horizontal_sd < 2.0


def test_a_devices_attitude_aligns_it_at_once(flight: FlightState) -> None:
    navigator = InertialNavigator(FilterModel())
    for aiding in gnss(flight, 0):
        navigator.feed_aiding(ns(0.0), aiding)
    navigator.feed_attitude(ns(0.0), float(flight.roll[0]), float(flight.pitch[0]), float(flight.heading[0]))
    navigator.feed_inertial(ns(0.04), specific_force_b(flight)[1], angular_rate_b(flight)[1])
    assert navigator.mode(ns(0.04)) == (FilterMode.ALIGNING, (Reason.ALIGNING,))  # until the next fix agrees
    for aiding in gnss(flight, 2):
        navigator.feed_aiding(ns(0.08), aiding)
    navigator.feed_inertial(ns(0.08), specific_force_b(flight)[2], angular_rate_b(flight)[2])
    assert navigator.mode(ns(0.08)) == (FilterMode.AIDED, ())
    assert metres_off(navigator, flight, 1) < 0.5


def test_a_path_is_not_corrected_by_fixes(flight: FlightState) -> None:
    """A fix 4 m to the east moves the estimate of the filter; the path between two times is that of the aircraft."""
    navigator = started(flight, level_sd=3.0)
    forces, rates = specific_force_b(flight), angular_rate_b(flight)
    for k in range(1, 21):
        navigator.feed_inertial(ns(float(flight.t[k])), forces[k], rates[k])
        if k == 10:
            navigator.feed_aiding(ns(float(flight.t[k])), gnss(flight, k, east=4.0)[0])
    first, last = ns(float(flight.t[5])), ns(float(flight.t[15]))
    path = navigator.path([first, first + 30_000_000, last])
    ends = [navigator.at(t_ns) for t_ns in (first, last)]
    assert path is not None and ends[0] is not None and ends[1] is not None
    begin, end = (ecef_from_geodetic(flight.lat[k], flight.lon[k], flight.alt[k]) for k in (5, 15))
    moved = end - begin
    assert path[0].y == pytest.approx(ends[0].y)
    assert path[-1].y[:3] - path[0].y[:3] == pytest.approx(moved, abs=0.05)
    assert np.linalg.norm(ends[1].y[:3] - ends[0].y[:3] - moved) > 1.0
    assert navigator.path([first - 10 * SECOND, last]) is None


def test_what_is_missing_is_named(flight: FlightState) -> None:
    navigator = InertialNavigator(FilterModel())
    navigator.feed_inertial(ns(0.0), specific_force_b(flight)[0], angular_rate_b(flight)[0])
    assert navigator.mode(ns(0.0)) == (FilterMode.WAITING, (Reason.ALIGNING, Reason.NO_GNSS))
    navigator.feed_aiding(ns(0.0), gnss(flight, 0)[0])
    navigator.feed_inertial(ns(0.04), specific_force_b(flight)[1], angular_rate_b(flight)[1])
    assert navigator.mode(ns(0.04)) == (FilterMode.ALIGNING, (Reason.ALIGNING, Reason.NO_VELOCITY))
    assert not navigator.output(ns(0.04)).valid
    assert navigator.mode(ns(1.0)) == (FilterMode.WAITING, (Reason.NO_IMU,))


def test_an_outage_is_coasted_and_reported(flight: FlightState) -> None:
    navigator = started(flight)
    modes = fly(navigator, flight, is_received=lambda t: not 8.0 <= t < 18.0, watch=True)
    assert modes[round(9.0 / STEP)] is FilterMode.AIDED
    assert modes[round(13.0 / STEP)] is FilterMode.COASTING
    assert modes[-1] is FilterMode.AIDED


def test_late_is_in_time_to_the_last_bit(flight: FlightState) -> None:
    """Fixes of 0.4 s ago, and the same fixes at once: one answer."""
    late, soon = started(flight), started(flight)
    fly(late, flight, delay=10)
    fly(soon, flight, delay=0)
    for aiding in gnss(flight, len(flight.t) - 10):
        soon.feed_aiding(ns(float(flight.t[-10])), aiding)
    one, two = late.at(ns(float(flight.t[-11]))), soon.at(ns(float(flight.t[-11])))
    assert one is not None
    assert two is not None
    np.testing.assert_array_equal(one.y, two.y)
    np.testing.assert_array_equal(one.P, two.P)


def test_late_ones_that_come_together_are_taken_together_and_in_the_order_of_their_times(flight: FlightState) -> None:
    """Fixes of 0.8 s at once, out of order, without an output in between: the same result as in time."""
    late, soon = started(flight), started(flight)
    fly(late, flight, is_received=lambda t: t < 29.2, every=5)
    fly(soon, flight, every=5)
    last = len(flight.t) - 1
    for j in sorted(range(0, last + 1, 5), key=lambda j: (j % 2, -j)):
        if flight.t[j] >= 29.2:
            for aiding in gnss(flight, j):
                late.feed_aiding(ns(float(flight.t[j])), aiding)
    one, two = late.at(ns(float(flight.t[-1]))), soon.at(ns(float(flight.t[-1])))
    assert one is not None
    assert two is not None
    np.testing.assert_array_equal(one.y, two.y)
    np.testing.assert_array_equal(one.P, two.P)


def test_it_reaches_as_far_as_it_has_an_estimate(flight: FlightState) -> None:
    navigator = started(flight)
    assert navigator.reaches(ns(0.0))
    assert not InertialNavigator(FilterModel()).reaches(ns(0.0))
    fly(navigator, flight, is_received=lambda t: t < 1.0)
    end = float(flight.t[-1])
    reached = {past: navigator.reaches(ns(end - past)) for past in (1.3, 0.9, 0.0, -0.19, -0.21)}
    assert reached == {past: navigator.at(ns(end - past)) is not None for past in reached}
    assert list(reached.values()) == [False, True, True, True, False]


def test_a_late_fix_counts_for_the_time_at_which_it_was_true(flight: FlightState) -> None:
    """At 60 m/s 0.4 s are 24 m: taken as new, they would be in the answer."""
    navigator = started(flight)
    fly(navigator, flight, delay=10)
    assert metres_off(navigator, flight) < 1.0


def test_what_lies_between_two_inertial_samples_is_met_there(flight: FlightState) -> None:
    """Half a minute away from every fix: an estimate between samples is that of the flight, to millimetres."""
    navigator = started(flight)
    fly(navigator, flight, is_received=lambda t: False)
    half = random_flight(np.random.default_rng(5), 32.0).state(np.array([29.5]))
    here = navigator.at(ns(29.5))
    assert here is not None
    mat_nb = mat_from_rpy(half.roll[0], half.pitch[0], half.heading[0])
    np.testing.assert_allclose(here.mat_nb, mat_nb, atol=1e-5)


def test_a_jump_of_the_satellites_is_refused_for_as_long_as_it_lasts(flight: FlightState) -> None:
    """500 m to the east for good: refused and named; after five seconds it was taken, with a sigma of 2 m."""
    navigator = started(flight)
    fly(navigator, flight, east=lambda t: 500.0 if t > 12.0 else 0.0)
    innovations = [v for v in navigator.drain_innovations() if v.name == "gnss.position" and v.t_ns > ns(12.0)]
    assert {v.decision for v in innovations} == {GateDecision.REFUSED}
    assert "gnss.position" in navigator.output(ns(float(flight.t[-1]))).rejected
    assert metres_off(navigator, flight) < 20.0


def test_an_excluded_source_is_not_used_until_it_is_readmitted(flight: FlightState) -> None:
    """500 m to the east for 8 s in an excluded receiver, which agrees afterwards: nothing of it is taken."""
    navigator, forces = started(flight), np.hstack((specific_force_b(flight), angular_rate_b(flight)))
    names = ("gnss.position", "gnss.height")
    decisions = []
    for k, t in enumerate(flight.t[flight.t < 30.0].tolist()):
        navigator.feed_inertial(ns(t), forces[k, :3], forces[k, 3:])
        if k % 25 == 0:
            navigator.feed_aiding(ns(t), gnss(flight, k, 500.0 if 10.0 < t < 18.0 else 0.0)[0])
        if k == 250:
            navigator.drain_segments()
            navigator.exclude(names, ns(t), None)
        if k == 600:
            navigator.drain_segments()
            navigator.readmit(names)
        decisions += [(v.t_ns, v.decision) for v in navigator.drain_innovations() if v.name == "gnss.position"]
    excluded = [decision for t_ns, decision in decisions if ns(10.5) < t_ns < ns(22.5)]
    assert set(excluded) == {GateDecision.EXCLUDED}
    assert [decision for t_ns, decision in decisions if t_ns > ns(24.5)][-1] is GateDecision.ACCEPTED
    assert metres_off(navigator, flight, round(29.9 / STEP)) < 20.0


def test_a_height_that_is_wrong_takes_nothing_from_the_level(flight: FlightState) -> None:
    """A receiver 300 m too high beside a barometer: refused by itself, and the level is used all the same."""
    navigator, forces = started(flight), np.hstack((specific_force_b(flight), angular_rate_b(flight)))
    for k, t in enumerate(flight.t.tolist()):
        navigator.feed_inertial(ns(t), forces[k, :3], forces[k, 3:])
        if k % 25 == 0:
            true, _ = gnss(flight, k)
            assert true.alt is not None
            navigator.feed_aiding(ns(t), dataclasses.replace(true, alt=true.alt + (300.0 if t > 5.0 else 0.0)))
            navigator.feed_aiding(ns(t), BaroAltitude(float(flight.alt[k]), 1.0))
        if t > 15.0:
            break
    assert navigator.mode(ns(15.0)) == (FilterMode.AIDED, (Reason.REJECTED,))
    assert navigator.output(ns(15.0)).rejected == ("gnss.height",)
    assert metres_off(navigator, flight, round(15.0 / STEP)) < 3.0


def test_an_outlier_does_no_harm(flight: FlightState) -> None:
    navigator = started(flight)
    fly(navigator, flight, east=lambda t: 500.0 if 12.0 < t < 12.5 else 0.0)
    assert metres_off(navigator, flight) < 1.0
    assert navigator.mode(ns(float(flight.t[-1]))) == (FilterMode.AIDED, ())


def test_while_it_is_refused_it_is_named(flight: FlightState) -> None:
    navigator = started(flight)
    fly(navigator, flight, east=lambda t: 500.0 if t > 28.0 else 0.0)
    output = navigator.output(ns(float(flight.t[-1])))
    assert output.rejected == ("gnss.position",)
    assert Reason.REJECTED in output.reasons


def test_a_slow_offset_of_the_barometer_is_found(flight: FlightState) -> None:
    navigator = started(flight, FilterModel(extras={Extra.BARO: BARO_DRIFT}))
    forces, rates = specific_force_b(flight), angular_rate_b(flight)
    for k, t in enumerate(flight.t.tolist()):
        navigator.feed_inertial(ns(t), forces[k], rates[k])
        if k % 10 == 0:
            navigator.feed_aiding(ns(t), gnss(flight, k)[0])
            navigator.feed_aiding(ns(t), BaroAltitude(float(flight.alt[k]) + 42.0, 1.0))
    here = navigator.at(ns(float(flight.t[-1])))
    assert here is not None
    assert here.drift(Extra.BARO) == pytest.approx(42.0, abs=1.5)
    assert (here.drift_sd(Extra.BARO) or 0.0) < 2.0


# ------------------------------------------------------------------------------------------------- hostile inputs


def test_numbers_that_are_none_are_refused(flight: FlightState) -> None:
    navigator = started(flight)
    before = navigator.at(ns(0.0))
    nan, level = float("nan"), (0.0, 0.0, 1.0)
    for aiding in (
        GnssPosition(nan, 0.2, 700.0, 2.0, 3.0), GnssPosition(0.8, 0.2, 700.0, 0.0, 3.0),
        GnssVelocity(1.0, math.inf, 0.0, 0.1), BaroAltitude(700.0, -1.0),
        SlantRange(1.0, 1.0, 1.0, 0.8, 0.2, 700.0, (1.0, 0.0, 0.0), level),
    ):  # fmt: skip
        navigator.feed_aiding(ns(0.5), aiding)
    assert navigator.refused[Reason.DEVICE_FLAG] == 5
    navigator.feed_inertial(ns(0.1), [nan, 0.0, -9.8], [0.0, 0.0, 0.0])
    navigator.feed_inertial(ns(0.1), [0.0, 0.0, -1e9], [0.0, 0.0, 0.0])
    navigator.feed_attitude(ns(0.1), nan, 0.0, 0.0)
    assert navigator.refused[Reason.DEVICE_FLAG] == 8
    after = navigator.at(ns(0.0))
    assert before is not None
    assert after is not None
    np.testing.assert_array_equal(after.y, before.y)


def test_twice_the_same_counts_once(flight: FlightState) -> None:
    one, two = started(flight), started(flight)
    for navigator, times in ((one, 1), (two, 3)):
        fly(navigator, flight, is_received=lambda t: False)
        for _ in range(times):
            navigator.feed_aiding(ns(29.5), gnss(flight, round(29.5 / STEP))[0])
    a, b = (n.at(ns(29.9)) for n in (one, two))
    assert a is not None
    assert b is not None
    np.testing.assert_array_equal(a.P, b.P)
    assert two.refused[Reason.STALE] == 2


def test_what_is_too_old_is_refused(flight: FlightState) -> None:
    navigator = started(flight)
    fly(navigator, flight)
    navigator.feed_aiding(ns(20.0), gnss(flight, round(20.0 / STEP), east=900.0)[0])
    assert navigator.refused[Reason.STALE] == 1
    assert metres_off(navigator, flight) < 1.0


def test_time_that_goes_backwards_is_refused_and_a_clock_that_jumped_begins_anew(flight: FlightState) -> None:
    navigator = started(flight)
    fly(navigator, flight)
    forces, rates = specific_force_b(flight), angular_rate_b(flight)
    for k in range(20):
        navigator.feed_inertial(ns(10.0 + k * STEP), forces[k], rates[k])
    assert metres_off(navigator, flight) < 1.0
    for k in range(20, 30):
        navigator.feed_inertial(ns(10.0 + k * STEP), forces[k], rates[k])
    mode, reasons = navigator.mode(ns(10.0 + 29 * STEP))
    assert mode in {FilterMode.ALIGNING, FilterMode.WAITING}
    assert Reason.RESET in reasons


def test_a_position_that_was_lost_is_not_corrected_along_the_tangent(flight: FlightState) -> None:
    """57 km off with a sigma of 20 km, as after an hour without satellites: the altitude was 255 m off, sigma 2 m."""
    navigator = started(flight, level_sd=20_000.0)
    fly(navigator, flight, east=lambda t: 57_000.0)
    here = navigator.output(ns(float(flight.t[-1])))
    assert here.mode is FilterMode.AIDED
    assert here.alt == pytest.approx(float(flight.alt[-1]), abs=2.0)
    assert here.reasons == ()


def test_a_fix_outside_the_gate_of_a_lost_position_does_not_begin_it_anew(flight: FlightState) -> None:
    navigator = started(flight, level_sd=2100.0)
    modes = fly(navigator, flight, east=lambda t: 57_000.0, watch=True)
    assert set(modes) == {FilterMode.INVALID}


def test_a_gap_of_inertial_samples_begins_anew_and_finds_back(flight: FlightState) -> None:
    navigator = started(flight)
    forces, rates = specific_force_b(flight), angular_rate_b(flight)
    for k, t in enumerate(flight.t.tolist()):
        if 8.0 <= t < 9.0:
            assert navigator.mode(ns(t))[0] is (FilterMode.INVALID if t > 8.3 else navigator.mode(ns(t))[0])
            continue
        navigator.feed_inertial(ns(t), forces[k], rates[k])
        if k % 10 == 0:
            for aiding in gnss(flight, k):
                navigator.feed_aiding(ns(t), aiding)
    assert navigator.mode(ns(float(flight.t[-1])))[0] is FilterMode.AIDED
    assert metres_off(navigator, flight) < 2.0


@pytest.mark.parametrize(
    ("lat", "lon", "pitch"),
    [
        (np.pi / 2, 0.0, 0.1),
        (-np.pi / 2, 1.0, 0.0),
        (0.8, np.pi, 0.0),
        (0.8, 0.2, np.pi / 2),
        (0.0, -np.pi, -np.pi / 2),
    ],
    ids=["north pole", "south pole", "date line", "straight up", "straight down"],
)
def test_no_place_and_no_attitude_is_special(lat: float, lon: float, pitch: float) -> None:
    """Ten seconds of standstill with fixes: the output is a standstill, too."""
    from fti.geodesy.formulas import EARTH_RATE
    from fti.geodesy.gravity import normal_gravity

    navigator = InertialNavigator(FilterModel(extras=GNSS_DRIFTS))
    mat_nb = mat_from_rpy(0.0, pitch, 0.3)
    force_b = mat_nb.T @ [0.0, 0.0, -float(normal_gravity(lat, 100.0))]
    rate_b = mat_nb.T @ mat_en(lat, lon).T @ [0.0, 0.0, EARTH_RATE]
    start = InitialState(lat, lon, 100.0, (0.0,) * 3, 0.0, pitch, 0.3, (2.0,) * 3, (0.2,) * 3, (0.01, 0.01, 0.02))
    navigator.begin(ns(0.0), start, force_b, rate_b)
    for k in range(1, 250):
        navigator.feed_inertial(ns(k * STEP), force_b, rate_b)
        if k % 25 == 0:
            navigator.feed_aiding(ns(k * STEP), GnssPosition(lat, -lon if k % 50 else lon, 100.0, 1.5, 2.0))
            navigator.feed_aiding(ns(k * STEP), GnssVelocity(0.0, 0.0, 0.0, 0.02))
    output = navigator.output(ns(249 * STEP))
    assert output.mode is FilterMode.AIDED
    assert output.alt == pytest.approx(100.0, abs=0.1)
    assert output.vel_north == pytest.approx(0.0, abs=0.01)
    assert output.pitch == pytest.approx(pitch, abs=1e-3)
    assert all(math.isfinite(x) for x in (output.horizontal_sd or 0.0, output.heading_sd or 0.0, output.lat or 0.0))


def test_a_diverged_estimate_is_never_output(flight: FlightState) -> None:
    """The operator readmits a receiver at 900 km: such a height had been valid for a tick, to 1 m."""
    navigator, forces, rates, reasons = started(flight), specific_force_b(flight), angular_rate_b(flight), set[Reason]()
    for k, t in enumerate(flight.t[:200].tolist()):
        navigator.feed_inertial(ns(t), forces[k], rates[k])
        if k % 5 == 4:
            navigator.feed_aiding(ns(t), replace(gnss(flight, k)[0], alt=9e5))
        if k == 100:
            navigator.drain_segments()
            navigator.readmit(("gnss.position", "gnss.height"), 9e5)
        output = navigator.output(ns(t))
        assert output.alt is None or abs(output.alt) < 1e5
        reasons |= set(output.reasons)
    assert {Reason.DIVERGED, Reason.RESET} <= reasons


def test_a_place_without_a_height_does_not_hide_the_height_of_its_epoch(flight: FlightState) -> None:
    """Two NMEA sentences at one time, the one without a height first: it aligns and accepts the height."""
    navigator, forces, rates = (
        InertialNavigator(FilterModel(extras=GNSS_DRIFTS)),
        specific_force_b(flight),
        angular_rate_b(flight),
    )
    for k, t in enumerate(flight.t[:100].tolist()):
        navigator.feed_attitude(ns(t), float(flight.roll[k]), float(flight.pitch[k]), float(flight.heading[k]))
        if k % 10 == 0:
            position, velocity = gnss(flight, k)
            for aiding in (replace(position, alt=None), velocity, position, position):
                navigator.feed_aiding(ns(t), aiding)
        navigator.feed_inertial(ns(t), forces[k], rates[k])
    assert navigator.mode(ns(t)) == (FilterMode.AIDED, ())
    names = [v.name for v in navigator.drain_innovations()]
    assert names.count("gnss.height") == names.count("gnss.position") == names.count("gnss.velocity") > 5


def test_a_wrong_first_fix_is_never_output(flight: FlightState) -> None:
    """80 m/s of climb in the first velocity: 80 m of height had been valid, and two metres sure."""
    navigator, forces, rates, valid = (
        InertialNavigator(FilterModel(extras=GNSS_DRIFTS)),
        specific_force_b(flight),
        angular_rate_b(flight),
        0,
    )
    for k, t in enumerate(flight.t[:400].tolist()):
        navigator.feed_attitude(ns(t), float(flight.roll[k]), float(flight.pitch[k]), float(flight.heading[k]))
        if k % 10 == 0:
            position, velocity = gnss(flight, k)
            navigator.feed_aiding(ns(t), position)
            wrong = k == 0 and velocity.down is not None
            navigator.feed_aiding(ns(t), replace(velocity, down=(velocity.down or 0.0) - 80.0) if wrong else velocity)
        navigator.feed_inertial(ns(t), forces[k], rates[k])
        output = navigator.output(ns(t))
        if output.valid:
            valid += 1
            assert output.alt == pytest.approx(float(flight.alt[k]), abs=10.0)
    assert valid > 300


@pytest.mark.parametrize("first", ["sound", "wrong"])
def test_another_receiver_that_is_wrong_does_not_keep_it_from_aligning(flight: FlightState, first: str) -> None:
    """300 m to the east of the sound one, in turns with it, each with its own fixes four times a second."""
    navigator, forces, rates = (
        InertialNavigator(FilterModel(extras=GNSS_DRIFTS)),
        specific_force_b(flight),
        angular_rate_b(flight),
    )
    valid = 0
    for k, t in enumerate(flight.t[:400].tolist()):
        navigator.feed_attitude(ns(t), float(flight.roll[k]), float(flight.pitch[k]), float(flight.heading[k]))
        if k % 5 == 0:
            wrong = (k % 10 == 0) == (first == "wrong")
            name = "other" if wrong else "gnss"
            position, velocity = gnss(flight, k, 300.0 if wrong else 0.0)
            navigator.feed_aiding(ns(t), replace(position, name=f"{name}.position"))
            navigator.feed_aiding(ns(t), replace(velocity, name=f"{name}.velocity"))
        navigator.feed_inertial(ns(t), forces[k], rates[k])
        valid += navigator.output(ns(t)).valid
    assert valid > 380
    names = {"sound": "other.position", "wrong": "gnss.position"}  # nobody knows which of two is wrong: it is named
    assert navigator.output(ns(t)).rejected == (names[first],)


def test_a_bit_that_fell_over_in_one_inertial_sample_is_known_and_forgotten(flight: FlightState) -> None:
    """100 m/s^2 for one sample are a false velocity; without noise for it the aiding was refused."""
    navigator, forces, rates, worst = started(flight), specific_force_b(flight), angular_rate_b(flight), 0.0
    for k, t in enumerate(flight.t.tolist()):
        spike = [0.0, 0.0, -100.0] if k == 200 else [0.0, 0.0, 0.0]
        navigator.feed_inertial(ns(t), forces[k] + spike, rates[k])
        if k % 10 == 0:
            for aiding in gnss(flight, k):
                navigator.feed_aiding(ns(t), aiding)
        output = navigator.output(ns(t))
        if output.valid and k >= 200:
            assert output.reasons == ()
            assert output.alt is not None and output.vertical_sd is not None
            worst = max(worst, abs(output.alt - float(flight.alt[k])) / output.vertical_sd)
    assert worst < 3.0


def test_random_rubbish_raises_nothing(flight: FlightState) -> None:
    """A thousand calls with times and values from anywhere."""
    rng = np.random.default_rng(8)
    navigator = started(flight)

    def value() -> float:
        return float(rng.choice([0.0, 1.0, -1e3, 1e12, 1e300, math.nan, math.inf, rng.normal()]))

    for _ in range(1000):
        t = ns(float(rng.choice([0.0, rng.uniform(-5.0, 5.0), rng.uniform(0.0, 0.5), 1e6])))
        what = rng.integers(6)
        if what == 0:
            navigator.feed_inertial(t, [value() for _ in range(3)], [value() for _ in range(3)])
        elif what == 1:
            navigator.feed_aiding(t, GnssPosition(value(), value(), value(), abs(value()), abs(value())))
        elif what == 2:
            navigator.feed_aiding(t, GnssVelocity(value(), value(), value(), abs(value())))
        elif what == 3:
            navigator.feed_attitude(t, value(), value(), value())
        else:
            output = navigator.output(t)
            assert not output.valid or all(math.isfinite(x) for x in (output.lat or 0.0, output.vertical_sd or 0.0))


#: Prints those of the named kernels that are not compiled after the warm-up.
WARM_UP = """
import sys
from fti.nav.filter import kernels, navigator
navigator.warm_up()
print(*(name for name in sys.argv[1:] if not getattr(kernels, name).signatures))
"""


def test_every_kernel_that_navigation_calls_is_warmed_up() -> None:
    modules = sorted((ROOT / "fti/nav").rglob("*.py"))
    called = {name for file in modules for name in re.findall(r"\bkernels\.(\w+)\(", file.read_text())}
    assert len(called) > 5
    ended = subprocess.run([sys.executable, "-c", WARM_UP, *called], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == []
