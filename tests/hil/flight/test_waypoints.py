"""Along waypoints: legs are straight, turns touch both legs at the bank asked for, height and speed change evenly."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.local import LocalFrame
from fti.hil.flight.trajectory import FlightState, SplineFlight
from fti.hil.flight.waypoints import SMOOTH_S, Waypoint, waypoint_flight

Array = NDArray[np.float64]

FRAME = LocalFrame(np.deg2rad(48.0), np.deg2rad(11.0), 0.0)
BANK = np.deg2rad(25.0)
SPEED = 50.0
RADIUS = SPEED**2 / (9.80665 * np.tan(BANK))


def waypoint(east: float, north: float, alt: float = 600.0, speed: float = SPEED) -> Waypoint:
    lat, lon, _ = FRAME.to_geodetic((east, north, -(east**2 + north**2) / 2 / 6.37e6))
    return Waypoint(float(lat), float(lon), alt, speed)


#: East, then a right turn to the south.
CORNER = [waypoint(0, 0), waypoint(4000, 0), waypoint(4000, -4000)]


def sampled(flight: SplineFlight, step: float = 0.25) -> FlightState:
    return flight.state(np.arange(0.0, flight.end, step))


def places(state: FlightState) -> Array:
    return np.asarray(FRAME.to_local(state.lat, state.lon, 0.0 * state.alt)[:, :2])


def test_it_begins_and_ends_at_its_waypoints() -> None:
    flight = waypoint_flight(CORNER, BANK, (0.0, 0.0))
    ends = places(flight.state([0.0, flight.end]))
    np.testing.assert_allclose(ends, [[0.0, 0.0], [4000.0, -4000.0]], atol=0.5)
    corner = RADIUS * (np.pi / 2 - 2.0)  # an arc instead of two leads
    assert flight.end == pytest.approx((8000.0 + corner) / SPEED, rel=3e-3)


def test_legs_are_straight_and_the_turn_is_an_arc_that_touches_both() -> None:
    values = places(sampled(waypoint_flight(CORNER, BANK, (0.0, 0.0))))
    lead, half = RADIUS, SMOOTH_S / 2 * SPEED
    before, after = values[:, 0] < 4000.0 - lead - half, values[:, 1] < -lead - half
    np.testing.assert_allclose(values[before, 1], 0.0, atol=0.3)  # a great circle is no line of the plane
    np.testing.assert_allclose(values[after, 0], 4000.0, atol=0.3)
    inside = (values[:, 0] > 4000.0 - lead + half) & (values[:, 1] > -lead + half)
    from_centre = np.hypot(values[inside, 0] - 4000.0 + lead, values[inside, 1] + lead)
    averaged_in = (SPEED**2 / RADIUS) * 0.0327 * SMOOTH_S**2 / 2
    np.testing.assert_allclose(from_centre, RADIUS - averaged_in, atol=0.3)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_banks_into_the_turn_no_more_than_the_limit(side: float) -> None:
    turning = [waypoint(0, 0), waypoint(4000, 0), waypoint(4000, -4000 * side)]
    roll = np.rad2deg(sampled(waypoint_flight(turning, BANK, (0.0, 0.0))).roll) * side
    assert roll.max() == pytest.approx(25.0, abs=0.3)
    assert roll.min() > -0.3
    assert np.abs(np.diff(roll)).max() / 0.25 < 10.0  # degrees a second


def test_height_and_speed_change_evenly() -> None:
    climbing = [waypoint(0, 0, 500, 40), waypoint(6000, 0, 800, 60)]
    flight = waypoint_flight(climbing, BANK, (0.0, 0.0))
    state = sampled(flight)
    way = places(state)[:, 0]
    np.testing.assert_allclose(state.alt, 500.0 + way / 20.0, atol=0.1)
    speed = np.hypot(state.vel_n[:, 0], state.vel_n[:, 1])
    np.testing.assert_allclose(speed[20:-20], 40.0 + way[20:-20] / 300.0, atol=0.1)


def test_wind_is_flown_against() -> None:
    """Eastwards in a wind to the north: the nose points south of the track, and does not slip."""
    flight = waypoint_flight([waypoint(0, 0), waypoint(6000, 0)], BANK, (8.0, 0.0))
    state = sampled(flight)
    np.testing.assert_allclose(np.rad2deg(state.heading) - 90.0, np.rad2deg(np.arctan2(8.0, SPEED)), atol=0.1)
    np.testing.assert_allclose(state.tas, np.hypot(8.0, SPEED), atol=0.1)


def test_half_round_the_pole_at_any_length() -> None:
    """500 km past the North Pole at 89 deg: nothing happens there."""
    over = [Waypoint(np.deg2rad(87.0), np.deg2rad(20.0), 3000.0, 150.0), Waypoint(np.deg2rad(87.5), 2.2, 3000.0, 150.0)]
    flight = waypoint_flight(over, BANK, (0.0, 0.0))
    state = flight.state(np.linspace(0.0, flight.end, 500))
    assert flight.end > 2500.0
    np.testing.assert_allclose(state.alt, 3000.0, atol=5e-3)
    np.testing.assert_allclose(np.linalg.norm(state.vel_n, axis=1), 150.0, atol=0.2)
    np.testing.assert_allclose(state.roll, 0.0, atol=1e-3)


def test_turns_without_room_are_refused_by_their_waypoints() -> None:
    tight = [waypoint(0, 0), waypoint(4000, 0), waypoint(4000, -700), waypoint(0, -700)]
    with pytest.raises(ValueError, match=r"waypoint\[1\] and waypoint\[2\] are \d+ m apart, their turns need 54\d m"):
        waypoint_flight(tight, BANK, (0.0, 0.0))


@pytest.mark.parametrize("at", [(0.0, 0.0), (4000.0, 0.0)])
def test_the_same_place_twice_is_refused(at: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match=r"waypoint\[\d\] and waypoint\[\d\] are at the same position"):
        waypoint_flight([waypoint(0, 0), waypoint(*at), waypoint(4000, 0), waypoint(8000, 0)], BANK, (0.0, 0.0))
