"""The model error of a radar's beam: nothing over level ground, what receivers may differ by where it is uneven."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.nearest import NearestReturn
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import NARROW, WIDE
from fti.ranging.receiver_error import DETECTOR_SD, PossibleReceivers, leading_edges
from fti.ranging.sensor import Poses
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]
BEAM = math.radians(40.0)
POSTS = np.arange(-100, 101) * 10.0
EAST, NORTH = np.meshgrid(POSTS, POSTS)


def terrain(heights: Array) -> Terrain:
    return Terrain.from_array(heights, 10.0, east0=-1000.0, north0=-1000.0)


def model_sd(ground: Terrain, height: float, predicted: float, roll_deg: float = 0.0) -> float:
    mats = MAT_ENU_NED @ mat_from_rpy(math.radians(roll_deg), 0.0, 0.0)
    at = Poses.stationary(np.array([[0.0, 0.0, height]]), mats[None])
    return float(PossibleReceivers(BEAM).error_sd(ground, at, np.array([predicted]))[0])


@pytest.mark.parametrize("height", [20.0, 100.0, 600.0])
def test_over_level_ground_every_receiver_finds_the_nearest_point(height: float) -> None:
    assert model_sd(terrain(np.zeros_like(EAST)), height, height) == pytest.approx(DETECTOR_SD, abs=1e-6)


def test_an_offset_of_the_prediction_is_in_it() -> None:
    """4 m short over level ground: every receiver of the ensemble is 4 m farther."""
    assert model_sd(terrain(np.zeros_like(EAST)), 100.0, 96.0) == pytest.approx(math.hypot(DETECTOR_SD, 4.0), abs=1e-6)


def test_a_ridge_at_the_edge_of_the_beam_is_seen_by_some_and_not_by_others() -> None:
    """80 m beside, 21.8 deg off the axis, a ridge whose top is 60 m nearer: the nearest return jumps by 60 m."""
    ridge = np.where(np.abs(EAST - 80.0) < 15.0, 60.0, 0.0)
    beside = model_sd(terrain(ridge), 200.0, 200.0)
    assert 5.0 < beside < 60.0
    assert model_sd(terrain(np.where(np.abs(EAST - 400.0) < 15.0, 60.0, 0.0)), 200.0, 200.0) < 1.0


def test_a_pencil_has_no_such_error_and_a_radar_that_of_its_antenna() -> None:
    assert NearestReturn(beam_width=BEAM).model_beam == BEAM
    assert RadarAltimeter(antenna=NARROW).model_beam == pytest.approx(math.radians(30.0), abs=math.radians(1.0))
    assert WIDE.half_power_width == pytest.approx(math.radians(61.0), abs=math.radians(1.0))


def test_a_leading_edge_is_the_first_cell_with_its_share_of_the_most() -> None:
    """One echo at 100 m with 1, a cell with 10 at 150 m, of which a tenth and 4 % are less than 1, a quarter more."""
    np.testing.assert_array_equal(leading_edges(np.array([100.0, 150.0]), np.array([1.2, 10.0])), [150.0, 100.0, 100.0])
    np.testing.assert_array_equal(leading_edges(np.array([100.0, 150.0]), np.array([0.5, 10.0])), [150.0, 150.0, 100.0])
    near = np.array([100.0, 150.0, 150.5, 150.9])  # three echoes in one cell count together
    np.testing.assert_array_equal(leading_edges(near, np.array([1.3, 4.0, 4.0, 4.0])), [150.0, 100.0, 100.0])


def test_where_there_is_no_ground_it_is_not_known() -> None:
    assert math.isnan(model_sd(terrain(np.zeros_like(EAST)), 100.0, math.nan))
    assert math.isnan(model_sd(terrain(np.full_like(EAST, np.nan)), 100.0, 100.0))
