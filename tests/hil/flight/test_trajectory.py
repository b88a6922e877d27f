"""The flight: on the glide path, with derivatives that fit, and an attitude that an aeroplane has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.gravity import normal_gravity
from fti.geodesy.rotations import mat_from_rpy
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.hil.flight.approach import ApproachPlan, Manoeuvre, approach_flight
from fti.hil.flight.trajectory import FlightState, SplineFlight, earth_frame_velocity
from fti.hil.sensors.inertial import angular_rate_b, specific_force_b
from tests.hil.worlds import path

CALM = ApproachPlan(wander=0.0, wander_height=0.0, gust=0.0)
T = np.arange(0.5, 81.0, 0.25)


def fly(plan: ApproachPlan, seed: int = 1) -> SplineFlight:
    return approach_flight(path(), path().x_gpi, plan, seed)


def along(state: FlightState) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    s, y = path().to_path(state.lat, state.lon)
    return s, y, state.alt - path().alt_path(s)


def test_calm_flight_is_on_the_glide_path_within_a_centimetre() -> None:
    s, y, dh = along(fly(CALM).state(T))
    assert np.abs(y).max() < 0.01
    assert np.abs(dh[s > 500.0]).max() < 0.01


def test_calm_flight_begins_and_moves_as_planned() -> None:
    s, _, _ = along(fly(CALM).state(T))
    np.testing.assert_allclose(s, path().x_gpi + 4500.0 - 60.0 * T, atol=0.01)


def test_flight_levels_off_over_the_runway_and_crosses_the_threshold_at_its_height() -> None:
    state = fly(CALM).state(np.array([75.0, 82.0]))
    height = state.alt - path().airfield.threshold_alt_m
    assert height[0] == pytest.approx(path().airfield.tch_m, abs=0.3)
    assert height[1] == pytest.approx(10.0, abs=0.3)


def test_velocity_is_the_derivative_of_the_position() -> None:
    flight, h = fly(ApproachPlan(wind_n=(4.0, -3.0))), 1e-3
    after, before = flight.state(T + h), flight.state(T - h)
    difference = (ecef(after) - ecef(before)) / (2 * h)
    np.testing.assert_allclose(earth_frame_velocity(flight.state(T)), difference, atol=2e-5)


def test_acceleration_is_the_derivative_of_the_velocity() -> None:
    flight, h = fly(ApproachPlan()), 1e-3
    difference = (earth_frame_velocity(flight.state(T + h)) - earth_frame_velocity(flight.state(T - h))) / (2 * h)
    np.testing.assert_allclose(flight.state(T).accel_e, difference, atol=1e-6)


def test_turn_rate_is_the_derivative_of_the_attitude() -> None:
    flight, h = fly(ApproachPlan(wind_n=(0.0, 6.0))), 0.002
    rates = flight.state(T).omega_nb_b
    turned = np.einsum(
        "nji,njk->nik", attitude(flight.state(T - h)), attitude(flight.state(T + h))
    )  # about I + skew(omega) 2 h
    np.testing.assert_allclose(rates[:, 2], (turned[:, 1, 0] - turned[:, 0, 1]) / (4 * h), atol=1e-4)
    np.testing.assert_allclose(rates[:, 0], (turned[:, 2, 1] - turned[:, 1, 2]) / (4 * h), atol=1e-4)
    assert np.abs(rates).max() > 1e-3


def test_a_wind_from_the_right_needs_a_crab_to_the_right() -> None:
    """Landing on 250: the right is 340, so a wind from 340 blows towards 160."""
    towards = np.deg2rad(160.0)
    state = fly(replace(CALM, wind_n=(6.0 * np.cos(towards), 6.0 * np.sin(towards)))).state(T)
    crab = np.rad2deg(state.heading) - 250.0
    np.testing.assert_allclose(crab, np.rad2deg(np.arcsin(6.0 / 59.9)), atol=0.3)


def test_pitch_is_path_plus_angle_of_attack() -> None:
    state = fly(CALM).state(np.array([20.0]))
    assert np.rad2deg(state.pitch - state.aoa)[0] == pytest.approx(-3.0, abs=0.05)


def test_a_side_step_banks_towards_it_first_and_comes_back() -> None:
    plan = replace(CALM, manoeuvres=(Manoeuvre(offset=200.0, out_s=30.0, back_s=45.0),))
    flight = fly(plan)
    _, y, _ = along(flight.state(np.array([9.0, 30.0, 45.0, 66.0])))
    np.testing.assert_allclose(y, [0.0, 200.0, 200.0, 0.0], atol=0.01)
    roll = np.rad2deg(flight.state(np.array([14.0, 26.0])).roll)
    assert roll[0] > 5.0
    assert roll[1] < -5.0


def test_wander_has_the_size_asked_for_and_depends_on_the_seed() -> None:
    flights = [fly(ApproachPlan(), seed) for seed in range(30)]
    offsets = np.array([along(f.state(T))[1] for f in flights])
    heights = np.array([along(f.state(T[:200]))[2] for f in flights])
    assert np.sqrt((offsets**2).mean()) == pytest.approx(3.0, rel=0.15)
    assert np.sqrt((heights**2).mean()) == pytest.approx(1.5, rel=0.15)
    assert np.abs(offsets[0] - offsets[1]).max() > 1.0
    np.testing.assert_array_equal(along(fly(ApproachPlan(), 5).state(T))[1], offsets[5])


def test_specific_force_of_steady_flight_is_gravity() -> None:
    """Unaccelerated over the Earth but for its curvature and Coriolis: within 0.02 m/s^2 of gravity."""
    state = fly(CALM).state(np.array([20.0]))
    force = np.linalg.norm(specific_force_b(state)[0])
    assert force == pytest.approx(normal_gravity(state.lat, state.alt)[0], abs=0.02)
    assert specific_force_b(state)[0, 2] < -9.7  # accelerometers feel the lift: up, so negative along +down


def test_gyros_of_steady_flight_feel_the_rotation_of_the_earth() -> None:
    """Earth rate plus the transport rate v / R, no more."""
    rate = np.linalg.norm(angular_rate_b(fly(CALM).state(np.array([20.0])))[0])
    assert 7.292e-5 - 1e-5 < rate < 7.292e-5 + 1e-5


def ecef(state: FlightState) -> NDArray[np.float64]:
    return ecef_from_geodetic(state.lat, state.lon, state.alt)


def attitude(state: FlightState) -> NDArray[np.float64]:
    return mat_from_rpy(state.roll, state.pitch, state.heading)
