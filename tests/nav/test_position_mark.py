"""A fix that is known 10 s later corrects the filter as if it had been known at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.hil.flight.random_routes import random_flight
from fti.hil.flight.trajectory import FlightState
from fti.hil.sensors.inertial import angular_rate_b, specific_force_b
from fti.nav.filter.aiding import BaroAltitude, GnssPosition, GnssVelocity
from fti.nav.filter.error_states import BARO_DRIFT, Extra, FilterModel
from fti.nav.filter.estimate import Estimate, InitialState
from fti.nav.filter.innovation_gate import rejected_names
from fti.nav.filter.navigator import InertialNavigator
from fti.nav.filter.position_mark import TERRAIN_POSITION, MarkedPosition, PositionMark, mark_drifts
from fti.nav.inertial.ins_error_model import ACCEL

SECOND, STEP, SD = 1_000_000_000, 0.04, 3.0
T0 = 1_700_000_000 * SECOND
MARK_S, FIX_S, END_S = 10.0, 20.0, 25.0
EARTH_M = 6.371e6
#: Without an error of the map, as the position of a receiver without slow errors.
MODEL = FilterModel(extras={**mark_drifts(1e-6), Extra.BARO: BARO_DRIFT})


@pytest.fixture(scope="module")
def flight() -> FlightState:
    return random_flight(np.random.default_rng(7), END_S + 2.0).state(np.arange(0.0, END_S, STEP))


def fly(state: FlightState, late: MarkedPosition | None, punctual: GnssPosition | None) -> InertialNavigator:
    """Twenty-five seconds with velocities until the mark and a barometer, and one of the two fixes."""
    navigator = InertialNavigator(MODEL)
    north, east, down = (state.vel_n[0] + [0.4, -0.3, 0.1]).tolist()
    start = InitialState(
        float(state.lat[0]) + 30.0 / EARTH_M, float(state.lon[0]), float(state.alt[0]), (north, east, down),
        float(state.roll[0]), float(state.pitch[0]), float(state.heading[0]),
        (40.0, 40.0, 5.0), (0.5, 0.5, 0.2), (0.002, 0.002, 0.01),
    )  # fmt: skip
    force, turn = specific_force_b(state), angular_rate_b(state)
    navigator.begin(T0 - 1, start, force[0], turn[0])
    for k, t in enumerate(np.arange(0.0, END_S, STEP)):
        t_ns = T0 + round(float(t) * SECOND)
        navigator.feed_inertial(t_ns, force[k], turn[k])
        if k % 25 == 0:
            navigator.feed_aiding(t_ns, BaroAltitude(float(state.alt[k]) + 20.0, 1.0))
        if k % 50 == 0:
            vel = state.vel_n[k].tolist()
            navigator.feed_aiding(t_ns, GnssVelocity(vel[0], vel[1], vel[2], 0.5))
        if k == round(MARK_S / STEP):
            navigator.feed_aiding(t_ns, punctual or mark_of(state))
        if late is not None and k == round(FIX_S / STEP):
            navigator.feed_aiding(t_ns, late)
    return navigator


def mark_of(state: FlightState) -> PositionMark:
    k = round(MARK_S / STEP)
    return PositionMark(float(state.lat[k]) + 1e-5, float(state.lon[k]) - 1e-5, float(state.alt[k]) + 12.0)


def fixes_of(state: FlightState, north_m: float) -> tuple[MarkedPosition, GnssPosition]:
    k = round(MARK_S / STEP)
    lat, lon = float(state.lat[k]) + north_m / EARTH_M, float(state.lon[k])
    return MarkedPosition(mark_of(state), lat, lon, (SD**2, SD**2, 0.0)), GnssPosition(lat, lon, None, SD, SD)


def last(navigator: InertialNavigator) -> Estimate:
    estimate = navigator.at(T0 + round((END_S - STEP) * SECOND))
    assert estimate is not None
    return estimate


def base_of(estimate: Estimate) -> NDArray[np.float64]:
    """Sigmas of position, velocity and turn."""
    return np.sqrt(np.diag(estimate.P)[:ACCEL])


def test_a_late_fix_corrects_as_a_punctual_one(flight: FlightState) -> None:
    late, punctual = fixes_of(flight, 4.0)
    by_mark, at_once, without = (last(fly(flight, *fix)) for fix in ((late, None), (None, punctual), (None, None)))
    assert np.linalg.norm(by_mark.y[:3] - at_once.y[:3]) < 0.05
    assert np.linalg.norm(by_mark.y[3:6] - at_once.y[3:6]) < 0.005
    assert base_of(by_mark) == pytest.approx(base_of(at_once), rel=0.01)
    # the fix matters: without it the error is some ten metres
    assert np.linalg.norm(without.y[:3] - at_once.y[:3]) > 10.0
    assert base_of(without)[:3].max() > 3.0 * base_of(at_once)[:3].max()


def test_a_fix_outside_the_gate_is_refused(flight: FlightState) -> None:
    late, _ = fixes_of(flight, 400.0)
    navigator = fly(flight, late, None)
    assert rejected_names(navigator.gate_states) == (TERRAIN_POSITION,)
    assert np.linalg.norm(last(navigator).y[:3] - last(fly(flight, None, None)).y[:3]) < 1e-6


def test_a_fix_of_a_mark_that_the_filter_does_not_have_corrects_nothing(flight: FlightState) -> None:
    late, punctual = fixes_of(flight, 4.0)
    before = last(fly(flight, None, punctual))
    assert np.linalg.norm(last(fly(flight, late, punctual)).y[:3] - before.y[:3]) < 1e-3


@pytest.mark.parametrize("wrong", [{"lat": np.nan}, {"cov_n": (9.0, 9.0, 9.5)}, {"cov_n": (9.0, -1.0, 0.0)}])
def test_a_fix_that_is_not_finite_or_has_no_covariance_is_refused(
    flight: FlightState, wrong: dict[str, object]
) -> None:
    late, _ = fixes_of(flight, 4.0)
    navigator = fly(flight, None, None)
    navigator.feed_aiding(T0 + round(END_S * SECOND), replace(late, **wrong))  # type: ignore[arg-type]
    assert sum(navigator.refused.values()) == 1
