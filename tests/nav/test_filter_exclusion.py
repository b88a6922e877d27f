"""Altimeters that contradict the other sources are excluded from aiding, and readmitted when they agree."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.hil.flight.random_routes import random_flight
from fti.hil.flight.trajectory import FlightState
from fti.hil.sensors.inertial import angular_rate_b, specific_force_b
from fti.messages.reasons import Reason
from fti.nav.filter.aiding import GnssPosition, GnssVelocity, TerrainAltitude
from fti.nav.filter.error_states import (
    ALTIMETER_BIAS,
    ALTIMETER_SCALE,
    DEM_DRIFT,
    GNSS_DRIFTS,
    Drift,
    Extra,
    FilterModel,
)
from fti.nav.filter.estimate import Estimate, InitialState
from fti.nav.filter.exclusion import HOLD_NS, READMISSION_NS, Cause, consider_update, inconsistency, reset_states
from fti.nav.filter.navigator import InertialNavigator

Array = NDArray[np.float64]

SECOND, STEP, AGL = 1_000_000_000, 0.04, 200.0
T0 = 1_700_000_000 * SECOND
OWN = ("laser.bias", "laser.scale")
MODEL = FilterModel(extras={**GNSS_DRIFTS, Extra.DEM: DEM_DRIFT, OWN[0]: ALTIMETER_BIAS, OWN[1]: ALTIMETER_SCALE})
BIAS, SCALE = MODEL.columns[OWN[0]], MODEL.columns[OWN[1]]
Wrong = Callable[[float], float]


@pytest.fixture(scope="module")
def flight() -> FlightState:
    return random_flight(np.random.default_rng(5), 92.0).state(np.arange(0.0, 90.0, STEP))


def ns(t: float) -> int:
    return T0 + round(t * SECOND)


def started(state: FlightState, model: FilterModel = MODEL) -> InertialNavigator:
    navigator = InertialNavigator(model)
    north, east, down = state.vel_n[0].tolist()
    start = InitialState(
        float(state.lat[0]), float(state.lon[0]), float(state.alt[0]), (north, east, down), float(state.roll[0]),
        float(state.pitch[0]), float(state.heading[0]), (2.0,) * 3, (0.2,) * 3, (0.01, 0.01, 0.02),
    )  # fmt: skip
    navigator.begin(ns(0.0) - 1, start, specific_force_b(state)[0], angular_rate_b(state)[0])
    return navigator


def altitude(state: FlightState, k: int, wrong: float, name: str = "laser.altitude") -> TerrainAltitude:
    return TerrainAltitude(float(state.alt[k]) + wrong, 0.3, AGL + wrong, name, 1.0, *OWN)


def fly(
    navigator: InertialNavigator,
    state: FlightState,
    wrong: Wrong,
    is_received: Wrong = lambda t: 1.0,
    until: float = 90.0,
    late: int = 0,
) -> dict[float, tuple[str, ...]]:
    """Noise-free sensors; fixes and altitudes once a second, the altitudes late; excluded names by time."""
    imu, turned, names_at = specific_force_b(state), angular_rate_b(state), {}
    for k, t in enumerate(state.t.tolist()):
        if t > until:
            break
        navigator.feed_inertial(ns(t), imu[k], turned[k])
        if k % 25 == 5 and is_received(t):
            north, east, down = state.vel_n[k].tolist()
            place = float(state.lat[k]), float(state.lon[k]), float(state.alt[k])
            navigator.feed_aiding(ns(t), GnssPosition(*place, 2.0, 3.0))
            navigator.feed_aiding(ns(t), GnssVelocity(north, east, down, 0.1))
        j = k - late
        if j >= 0 and j % 25 == 10:
            at = float(state.t[j])
            navigator.feed_aiding(ns(at), altitude(state, j, wrong(at)))
        if k % 25 == 20:
            names_at[t] = navigator.output(ns(t)).excluded
    return names_at


def height_error(navigator: InertialNavigator, state: FlightState, t: float) -> float:
    here = navigator.at(ns(t))
    assert here is not None
    return here.geodetic[2] - float(np.interp(t, state.t, state.alt))


def test_a_step_is_excluded_after_the_hold_and_comes_back_after_it_has_agreed(flight: FlightState) -> None:
    """40 m from 20 s to 40 s: refused, excluded within 7 s, and back no sooner than half a minute after the end."""
    navigator = started(flight)
    outputs = fly(navigator, flight, lambda t: 40.0 if 20.0 <= t < 40.0 else 0.0)
    out = [t for t, names in outputs.items() if names]
    assert 20.0 + HOLD_NS / SECOND <= out[0] <= 28.0
    assert 40.0 + READMISSION_NS / SECOND <= out[-1] + 1.0 <= 82.0
    assert out == [t for t in outputs if out[0] <= t <= out[-1]]
    assert abs(height_error(navigator, flight, 89.0)) < 0.5


def test_an_exclusion_is_reported_with_cause_and_start(flight: FlightState) -> None:
    navigator = started(flight)
    fly(navigator, flight, lambda t: 40.0 if t >= 20.0 else 0.0, until=30.0)
    exclusion = navigator.find_exclusions()["laser.altitude"]
    assert exclusion.cause is Cause.INNOVATIONS
    assert exclusion.since_ns is not None
    assert ns(20.0) <= exclusion.since_ns <= ns(21.0)
    output = navigator.output(ns(30.0))
    assert output.excluded == ("laser.altitude",)
    assert output.rejected == ()
    assert output.reasons == (Reason.EXCLUDED,)


def test_a_bias_from_the_start_is_estimated_and_excluded_by_its_size(flight: FlightState) -> None:
    navigator = started(flight)
    names_at = fly(navigator, flight, lambda t: 35.0, until=40.0)
    assert names_at[max(names_at)] == ("laser.altitude",)
    assert navigator.find_exclusions()["laser.altitude"].cause is Cause.BIAS
    assert abs(height_error(navigator, flight, 39.0)) < 1.5
    here = navigator.at(ns(39.0))
    assert here is not None
    assert here.drift(OWN[0]) + AGL * here.drift(OWN[1]) == pytest.approx(35.0, abs=6.0)


def test_a_sound_one_is_never_excluded(flight: FlightState) -> None:
    assert not any(fly(started(flight), flight, lambda t: 1.5 * np.sin(t)).values())


def test_where_nothing_else_bounds_the_height_it_is_not_excluded(flight: FlightState) -> None:
    """Without satellites the inertial height may be what is wrong: the altimeter is let in again, as ever."""
    navigator = started(flight)
    names_at = fly(
        navigator, flight, lambda t: 40.0 if t >= 20.0 else 0.0, is_received=lambda t: float(t < 12.0), until=40.0
    )
    assert not any(names_at.values())


def test_of_two_altimeters_without_satellites_the_one_that_steps_is_excluded(flight: FlightState) -> None:
    """The other one still agrees with the inertial height: it bounds the height, and goes on aiding."""
    extras = {**MODEL.extras, "other.bias": ALTIMETER_BIAS, "other.scale": ALTIMETER_SCALE}
    navigator = started(flight, FilterModel(extras=extras))
    imu, turned = specific_force_b(flight), angular_rate_b(flight)
    for k, t in enumerate(flight.t[flight.t < 40.0].tolist()):
        navigator.feed_inertial(ns(t), imu[k], turned[k])
        if k % 25 == 5 and t < 12.0:
            place = float(flight.lat[k]), float(flight.lon[k]), float(flight.alt[k])
            navigator.feed_aiding(ns(t), GnssPosition(*place, 2.0, 3.0))
        if k % 25 == 10:
            navigator.feed_aiding(ns(t), altitude(flight, k, 40.0 if t >= 20.0 else 0.0))
            other = TerrainAltitude(float(flight.alt[k]), 0.3, AGL, "other.altitude", 1.0, "other.bias", "other.scale")
            navigator.feed_aiding(ns(t), other)
    assert navigator.output(ns(39.9)).excluded == ("laser.altitude",)
    assert abs(height_error(navigator, flight, 39.9)) < 2.0


def test_an_error_without_a_sound_size_is_never_excluded(flight: FlightState) -> None:
    """As the studies draw them: from the filter's own prior, however large."""
    extras = {**MODEL.extras, OWN[0]: Drift(10.0, period_s=3750.0), OWN[1]: Drift(0.03, period_s=32_400.0)}
    assert not any(fly(started(flight, FilterModel(extras=extras)), flight, lambda t: 35.0, until=40.0).values())


def test_late_is_in_time_to_the_last_bit_across_an_exclusion(flight: FlightState) -> None:
    """Altitudes of 0.4 s ago, and the same at once: one answer, excluded at the same time."""

    def wrong(t: float) -> float:
        return 40.0 if t >= 20.0 else 0.0

    late, soon = started(flight), started(flight)
    fly(late, flight, wrong, until=35.0, late=10)
    fly(soon, flight, wrong, until=35.0)
    one, two = late.at(ns(34.6)), soon.at(ns(34.6))
    assert one is not None
    assert two is not None
    np.testing.assert_array_equal(one.y, two.y)
    np.testing.assert_array_equal(one.P, two.P)
    assert late.find_exclusions() == soon.find_exclusions() != {}


# --------------------------------------------------------------------------------------------------- the arithmetic


def made(flight: FlightState) -> tuple[Estimate, TerrainAltitude]:
    navigator = started(flight)
    fly(navigator, flight, lambda t: 0.0, until=10.0)
    here = navigator.at(ns(10.0))
    assert here is not None
    return here, altitude(flight, round(10.0 / STEP), 8.0)


def test_an_excluded_altimeter_corrects_its_own_states_alone(flight: FlightState) -> None:
    """By matrices: the gain of all other states is zero, and P is that of this gain."""
    here, aiding = made(flight)
    z, H, R = aiding.compute_matrices(here)
    after, nis = consider_update(here, OWN, z, H, R)
    s = float((H @ here.P @ H.T + R)[0, 0])
    K = (here.P @ H.T / s)[:, 0]
    K[[k for k in range(MODEL.size) if k not in {BIAS, SCALE}]] = 0.0
    left = np.eye(MODEL.size) - np.outer(K, H[0])
    np.testing.assert_allclose(after.P, left @ here.P @ left.T + R[0, 0] * np.outer(K, K), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(after.y[:16], here.y[:16], rtol=1e-15)  # the quaternion is made a unit one again
    assert nis == pytest.approx(float(z[0] ** 2 / s))
    assert np.linalg.eigvalsh(after.P).min() > 0.0


def test_what_begins_anew_is_independent_of_all_others(flight: FlightState) -> None:
    here, _ = made(flight)
    anew = reset_states(here, OWN)
    others = [k for k in range(MODEL.size) if k not in {BIAS, SCALE}]
    np.testing.assert_array_equal(anew.P[np.ix_(others, others)], here.P[np.ix_(others, others)])
    assert not anew.P[BIAS, others].any()
    assert (anew.drift_sd(OWN[0]), anew.drift_sd(OWN[1])) == pytest.approx((10.0, 0.03))
    assert anew.drift(OWN[0]) == 0.0


def test_the_inconsistency_is_that_of_what_bias_and_scale_come_to(flight: FlightState) -> None:
    """8 m of bias and -4 % of 200 m cancel; 8 m and 4 % are 16 m."""
    here, aiding = made(flight)
    here = reset_states(here, OWN)
    _, H, _ = aiding.compute_matrices(here)
    sd = np.sqrt(10.0**2 + 1.6**2 + (aiding.height_agl * 0.03) ** 2 + (aiding.height_agl * 0.01) ** 2)
    for scale, metres in ((-8.0 / aiding.height_agl, 0.0), (8.0 / aiding.height_agl, 16.0)):
        y = here.y.copy()
        y[-2:] = 8.0, scale
        wrong = Estimate(here.t_ns, y, here.P, here.imu, here.model)
        assert inconsistency(wrong, OWN, H[0]) == pytest.approx(metres / sd, abs=1e-9)
