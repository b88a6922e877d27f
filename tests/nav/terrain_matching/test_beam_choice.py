"""Choice of beams: the forecast against finite differences, the choice against trying each candidate."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.terrain_matching.beam_choice import (
    NO_BEAM,
    after_sample,
    choose_beam,
    choose_beams,
    forecast,
    steering_angles,
)
from fti.ranging.laser import Laser
from fti.ranging.multibeam import MultiBeam, beam_directions, beams_across
from fti.ranging.sensor import Poses
from fti.terrain.terrain import Terrain
from tests.nav.terrain_matching.grounds import CELL_M, hills
from tests.planes import looking_down, plane

LASER = Laser(max_range=1000.0)
BEAMS = MultiBeam(LASER, beams_across(3)).directions_s()


def test_the_forecast_over_a_plane_is_its_slope_over_sigma() -> None:
    """Of the vertical beam the sigma is that of range and elevation."""
    rows = forecast(LASER, plane(0.2, -0.1), looking_down(200.0), BEAMS, range_sd=3.0, dem_sd=4.0)
    assert rows.shape == (1, 3, 3)
    assert rows[0, 1] == pytest.approx(np.array([0.2, -0.1, 1.0]) / 5.0, abs=1e-9)
    assert rows[0, :, 0] / rows[0, :, 2] == pytest.approx([0.2] * 3, abs=1e-9)


def test_a_row_is_the_change_of_the_residual_with_shift_and_height() -> None:
    """Finite differences of the range: it falls where the ground rises, and grows with the height of the aircraft."""
    ground, poses, step = hills(), looking_down(260.0, roll=0.1, heading=0.4), 0.01
    poses = Poses.stationary(poses.origins_l + np.array([800.0, 900.0, 0.0]), poses.mats_ls)
    ranges = MultiBeam(LASER, beams_across(3)).measure(ground, poses).slant_range
    rows = forecast(LASER, ground, poses, BEAMS, range_sd=1.0, dem_sd=0.0)[0]
    for axis, sign in enumerate((-1.0, -1.0, 1.0)):
        moved = Poses.stationary(poses.origins_l + step * np.eye(3)[axis], poses.mats_ls)
        change = (MultiBeam(LASER, beams_across(3)).measure(ground, moved).slant_range - ranges)[0] / step
        assert rows[:, axis] == pytest.approx(sign * change, abs=1e-3)


def test_a_beam_over_a_hole_or_beyond_its_reach_has_no_forecast() -> None:
    hole = plane().finest.heights.copy()
    hole[:, 82:] = np.nan  # from 50 m east
    rows = forecast(LASER, plane().with_finest(hole), looking_down(200.0), BEAMS, range_sd=1.0, dem_sd=1.0)
    assert np.isnan(rows[0]).all(axis=1).tolist() == [False, False, True]
    near = forecast(Laser(max_range=100.0), plane(), looking_down(200.0), BEAMS, range_sd=1.0, dem_sd=1.0)
    assert np.isnan(near).all()


def test_the_choice_is_that_of_trying_each_candidate() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        rows, root = rng.standard_normal((7, 3)), rng.standard_normal((3, 3))
        cov = root @ root.T + 0.1 * np.eye(3)
        traces = [np.trace(np.linalg.inv(np.linalg.inv(cov) + np.outer(row, row))[:2, :2]) for row in rows]
        best = choose_beam(rows, cov)
        assert best == int(np.argmin(traces))
        assert np.trace(after_sample(cov, rows[best])[:2, :2]) == pytest.approx(min(traces), rel=1e-9)


def test_the_direction_that_is_not_known_yet_is_measured() -> None:
    """Three beams, over slopes to the east (the steepest), to the north and over level ground, many times."""
    rows = np.tile([[0.3, 0.0, 1.0], [0.0, 0.2, 1.0], [0.0, 0.0, 1.0]], (60, 1, 1))
    counts = np.bincount(choose_beams(rows, 30.0, 5.0), minlength=3)
    assert counts.min() >= 10  # a slope alone cannot be separated from a height error


def test_times_without_a_forecast_choose_no_beam() -> None:
    rows = np.tile([[0.3, 0.0, 1.0], [np.nan] * 3], (3, 1, 1))
    rows[1] = np.nan
    assert choose_beams(rows, 30.0, 5.0).tolist() == [0, NO_BEAM, 0]


def test_steering_reaches_both_sides_in_equal_steps() -> None:
    angles = np.degrees(steering_angles(math.radians(40.0), math.radians(1.0)))
    assert angles[:, 0].tolist() == [0.0] * 81
    assert angles[:, 1] == pytest.approx(np.arange(-40.0, 41.0))


@pytest.mark.parametrize("name", ["switched", "steered"])
def test_a_chosen_beam_brings_more_than_the_vertical_one(name: str) -> None:
    """Over a valley whose floor is level: only the side beams see a slope."""
    axis = CELL_M * np.arange(400)
    valley = Terrain.from_array(np.maximum(np.abs(axis - 1000.0) - 60.0, 0.0)[None, :] * np.ones((400, 1)), CELL_M)
    origins = np.column_stack((np.full(20, 1000.0), 800.0 + 10.0 * np.arange(20), np.full(20, 250.0)))
    poses = Poses.stationary(origins, np.broadcast_to(MAT_ENU_NED @ mat_from_rpy(0.0, 0.0, 0.0), (20, 3, 3)))
    angles = beams_across(3) if name == "switched" else steering_angles(math.radians(40.0), math.radians(2.0))
    rows = forecast(LASER, valley, poses, beam_directions(*np.transpose(angles)), range_sd=1.0, dem_sd=0.0)
    chosen = choose_beams(rows, 30.0, 5.0)
    assert np.abs(rows[np.arange(20), chosen, 0]).max() > 0.5
    vertical = len(angles) // 2
    assert np.abs(rows[:, vertical, 0]).max() == 0.0
