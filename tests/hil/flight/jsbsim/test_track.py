"""The track over the ground, and the height over hills."""

from __future__ import annotations

import numpy as np
import pytest

from fti.hil.flight.jsbsim.routes import following_height
from fti.hil.flight.jsbsim.track import STEP_M, RouteTrack

CORNER = ((0.0, 0.0), (0.0, 2000.0), (3000.0, 2000.0))  # north, then right to the east


def test_a_corner_is_rounded_with_its_radius() -> None:
    """Two legs and a quarter of a circle of 500 m: the length, the distance to its centre, even steps."""
    track = RouteTrack(CORNER, 500.0)
    turn = (track.points[:, 1] > 1501.0) & (track.points[:, 0] < 499.0)
    assert track.length == pytest.approx(1500.0 + 250.0 * np.pi + 2500.0, abs=STEP_M)
    assert np.hypot(*(track.points[turn] - [500.0, 1500.0]).T) == pytest.approx(500.0, abs=0.1)
    assert np.linalg.norm(np.diff(track.points, axis=0), axis=1) == pytest.approx(STEP_M, abs=0.01)


def test_a_corner_to_the_left_is_the_mirror_image() -> None:
    right, left = RouteTrack(CORNER, 500.0), RouteTrack([(-east, north) for east, north in CORNER], 500.0)
    assert left.points * [-1.0, 1.0] == pytest.approx(right.points)


def test_a_turn_without_room_is_as_wide_as_its_legs_allow() -> None:
    """Legs of 2000 m and 3000 m: the turn begins in the middle of the shorter one at the earliest."""
    track = RouteTrack(CORNER, 5000.0)
    straight = track.points[track.along < 990.0]
    assert straight[:, 0] == pytest.approx(0.0, abs=1e-9)
    assert track.point(1100.0)[0] > 1.0


def test_distance_of_a_place_beside_the_track() -> None:
    track = RouteTrack(CORNER, 500.0)
    assert track.along_at(40.0, 700.0, 650.0) == pytest.approx(700.0)
    assert track.along_at(1000.0, 2030.0, 2600.0) == pytest.approx(1500.0 + 250.0 * np.pi + 500.0, abs=0.1)
    assert track.along_at(0.0, -300.0, 0.0) == pytest.approx(-300.0)


def test_a_track_that_crosses_itself_is_followed_in_order() -> None:
    """Where it crosses, the part that is looked for is the one being flown."""
    track = RouteTrack([(0.0, 0.0), (0.0, 3000.0), (2000.0, 3000.0), (2000.0, 1000.0), (-2000.0, 1000.0)], 0.0)
    assert track.along_at(0.0, 1000.0, 980.0) == pytest.approx(1000.0)
    assert track.along_at(0.0, 1000.0, 8980.0) == pytest.approx(9000.0)


def test_ahead_of_the_end_the_last_leg_goes_on() -> None:
    track = RouteTrack(CORNER, 500.0)
    east, north = track.point(track.length + 700.0)
    assert (east, north) == pytest.approx((track.points[-1][0] + 700.0, 2000.0))


def test_height_over_hills_keeps_above_and_within_its_slopes() -> None:
    """A cliff of 200 m: never below it, no steeper than 7 % up and 5 % down, and level far from it."""
    ground = np.where(np.abs(np.arange(2000) * 10.0 - 10000.0) < 500.0, 200.0, 0.0)
    height = following_height(ground, 10.0, climb=0.07, descent=0.05, window=600.0)
    slope = np.diff(height) / 10.0
    assert np.all(height >= ground)
    assert (slope.max(), slope.min()) == pytest.approx((0.07, -0.05), abs=1e-6)
    assert height.max() == pytest.approx(200.0)
    assert height[[0, -1]] == pytest.approx(0.0)


def test_slopes_change_over_the_window() -> None:
    """From level to 7 % takes 600 m: at 70 m/s the climb changes by 0.6 m/s^2."""
    ground = np.where(np.arange(2000) > 1500, 300.0, 0.0)
    height = following_height(ground, 10.0, climb=0.07, descent=0.07, window=600.0)
    bend = np.diff(height, 2) / 10.0**2
    assert np.abs(bend).max() < 1.1 * 0.07 / 600.0
