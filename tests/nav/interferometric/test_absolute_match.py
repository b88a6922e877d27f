"""Mean absolute difference of measured points to the terrain, against a sum over single points."""

from __future__ import annotations

import numpy as np
import pytest

from fti.arrays import Array
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.interferometric.absolute_match import best_shift, mean_absolute_difference, profile_of_points
from fti.nav.interferometric.closest_point import ClosestPoints, PointMethod, PointRefusal, closest_points
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.search import Lattice
from fti.nav.terrain_matching.window import cut_window
from fti.ranging.interferometric import InterferometricAltimeter
from fti.ranging.sensor import Poses
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

CELL = 20.0


def hills(seed: int = 5) -> Terrain:
    relief = fractal_relief((200, 400), CELL, np.random.default_rng(seed), sd=60.0, max_size_m=2000.0, min_size_m=150.0)
    return Terrain.from_array(relief, CELL, east0=-4000.0, north0=-2000.0)


def flight(crab_deg: float = 0.0) -> Poses:
    """41 poses 2000 m above the hills, to the east, with a pitch of 2 deg."""
    east = np.linspace(-1500.0, 1500.0, 41)
    mats = MAT_ENU_NED @ mat_from_rpy(0.0, np.radians(2.0), np.radians(90.0 + crab_deg))
    origins = np.column_stack((east, np.zeros(41), np.full(41, 2000.0)))
    return Poses(origins, np.broadcast_to(mats, (41, 3, 3)), np.tile([75.0, 0.0, 0.0], (41, 1)))


def profile_off(
    shift: Array, terrain: Terrain, method: PointMethod = PointMethod.PROPOSED, crab: float = 0.0
) -> Profile:
    """Of a navigated position that is off by a shift."""
    at = flight(crab)
    returns = InterferometricAltimeter(swath_width=0.0, rays=(2, 61)).measure(terrain, at)
    points = closest_points(returns.slant_range, returns.look_angle, at, method)
    return profile_of_points(np.arange(41.0), at.origins_l - [*shift, 0.0], points, sd=3.0, height_sd=3.0)


def test_it_is_the_mean_over_the_points() -> None:
    terrain = hills()
    profile = profile_off(np.array([30.0, -70.0]), terrain)
    for lattice in (Lattice(6), Lattice(3, stride=2, centre=(2, -1))):
        window = cut_window(terrain, profile, 400.0)
        found = mean_absolute_difference(window, profile, lattice)
        east, north = lattice.shifts(window.cell_m)
        for i, j in ((0, 0), (2, 5), (len(north) - 1, len(east) - 2)):
            up = terrain.up(profile.east + east[j], profile.north + north[i])
            assert found[i, j] == pytest.approx(np.abs(profile.ground - up).mean(), abs=1e-9)


def test_the_shift_is_found_with_points_far_beside_the_track() -> None:
    terrain, shift = hills(), np.array([-110.0, 65.0])
    profile = profile_off(shift, terrain, crab=10.0)
    assert np.abs(profile.north - (0.0 - shift[1])).max() > 250.0
    window = cut_window(terrain, profile, 400.0).refine(4)  # shifts of 5 m
    assert best_shift(window, profile, Lattice(50)) == pytest.approx(shift, abs=1e-9)
    assert mean_absolute_difference(window, profile, Lattice(50)).min() < 1e-3


def test_a_wrong_form_of_the_point_moves_the_shift() -> None:
    """The simple form in a pitch of 2 deg: 2000 m tan 2 deg = 70 m ahead of the point, to the east."""
    terrain = hills()
    profile = profile_off(np.zeros(2), terrain, PointMethod.SIMPLE)
    found = best_shift(cut_window(terrain, profile, 400.0).refine(4), profile, Lattice(50))
    assert found == pytest.approx([-70.0, 0.0], abs=8.0)


def test_refused_points_are_left_out() -> None:
    points = ClosestPoints(np.zeros((10, 3)), np.zeros(10, dtype=np.uint8))
    points.refusal[3], points.relative[3] = PointRefusal.OFF_BELLY, np.nan
    profile = profile_of_points(np.arange(10.0), np.zeros((10, 3)), points, 1.0, 1.0)
    assert profile.t.tolist() == [0.0, 1.0, 2.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]


def test_a_shift_over_unknown_ground_is_unknown_and_one_beyond_the_window_an_error() -> None:
    terrain = hills()
    profile = profile_off(np.zeros(2), terrain)
    window = cut_window(terrain, profile, 200.0)
    window.heights[:, :] = np.nan
    assert np.isnan(best_shift(window, profile, Lattice(3))).all()
    with pytest.raises(ValueError, match="does not contain all shifts"):
        mean_absolute_difference(window, profile, Lattice(30))
