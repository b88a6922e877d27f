"""Accuracy of the reference terrain of navigation."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fti.config import Device
from fti.messages.outputs import Compensation, HeightAboveGround
from fti.messages.reasons import Reason
from fti.nav.altimetry.expected_range import AltimeterPredictor
from fti.nav.altimetry.expected_sample import ExpectedSample
from fti.nav.altimetry.nadir_height import altitude_over_terrain
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import AttitudeState, PositionState
from fti.nav.terrain_reference import Ground
from fti.terrain.file_info import ElevationFileInfo
from fti.terrain.layer import Layer
from fti.terrain.resampling import ResamplingError
from fti.terrain.terrain import Terrain

SD_M, FINE_M, COARSE_M = 1.5, 0.5, 4.4
ALTITUDE_M = 100.0


@pytest.fixture
def ground() -> Ground:
    """Level; fine posts within 1 km of the origin, coarse ones within 10 km."""
    fine = Layer(np.zeros((21, 21)), 100.0, -1000.0, -1000.0)
    coarse = Layer(np.zeros((21, 21)), 1000.0, -10_000.0, -10_000.0)
    frame = Terrain.from_array(np.zeros((2, 2)), 1.0).frame
    errors = ResamplingError(FINE_M, 2.0, 100), ResamplingError(COARSE_M, 41.0, 100)
    return Ground(Terrain((fine, coarse), frame, (), errors), SD_M, "two layers")


def at(ground: Ground, east_m: float) -> NavState:
    """Level over a place, known exactly."""
    lat, lon, alt = ground.terrain.frame.to_geodetic([east_m, 10.0, ALTITUDE_M])
    position = PositionState(float(lat), float(lon), float(alt), 1e-3, 1e-3, 0.0, 0.0, 0.0, 0)
    return NavState(0, AttitudeState(0.0, 0.0, 0.0, 1e-6, 1e-6), position, "ins", "ins")


@pytest.mark.parametrize(("east_m", "resampling_m"), [(50.0, FINE_M), (5000.0, COARSE_M), (20_000.0, 0.0)])
def test_the_error_of_resampling_adds_to_the_sigma_where_its_layer_counts(
    ground: Ground, east_m: float, resampling_m: float
) -> None:
    assert ground.sd_at(east_m, 10.0) == pytest.approx(math.sqrt(SD_M**2 + resampling_m**2))


def test_a_file_that_states_its_accuracy_has_its_own_sigma() -> None:
    """Posts of two files: the western half of the second one, which states 6 m."""
    file = ElevationFileInfo(
        path="a", format="", rows=2, columns=2, crs="", spacing_m=(1.0, 1.0), pixel="point", vertical="egm96",
        vertical_by="", unit_m=1.0, date=None, sd_m=None, accuracy_m=None, south=0.0, west=0.0, north=0.0, east=0.0,
    )  # fmt: skip
    origin = np.zeros((21, 21), dtype=np.uint8)
    origin[:, :10] = 1
    layer = Layer(np.zeros((21, 21)), 100.0, -1000.0, -1000.0, origin)
    frame = Terrain.from_array(np.zeros((2, 2)), 1.0).frame
    ground = Ground(Terrain((layer,), frame, (file, replace(file, path="b", sd_m=6.0))), SD_M, "two files")
    assert [ground.sd_at(east, 0.0) for east in (-500.0, 500.0, 5000.0)] == [6.0, SD_M, SD_M]


@pytest.mark.parametrize(("east_m", "resampling_m"), [(50.0, FINE_M), (5000.0, COARSE_M)])
def test_it_is_part_of_the_sigmas_of_predictions_and_of_altitudes_over_ground(
    ground: Ground, east_m: float, resampling_m: float
) -> None:
    """A range straight down is as uncertain as the surface; so is an altitude that stands on it."""
    laser = {"name": "laser", "link": "line", "driver": "x", "altimeter": {"kind": "laser", "range_m": (1.0, 400.0)}}
    nav = at(ground, east_m)
    expected = AltimeterPredictor(Device.model_validate(laser), ground).predict(nav, 1e-3)
    assert isinstance(expected, ExpectedSample)
    whole = math.hypot(SD_M, resampling_m)
    assert expected.range_sd == pytest.approx(whole, rel=1e-3)
    common: dict[str, Any] = {"t_ns": 0, "t_valid_ns": 0, "sensor": "laser", "valid": True, "reasons": ()}
    height = HeightAboveGround(raw=ALTITUDE_M, height_agl=ALTITUDE_M, sd=0.1, compensation=Compensation.RANGE, **common)
    altitude = altitude_over_terrain(height, ground, nav.position)
    assert altitude is not None
    assert altitude.height_agl == ALTITUDE_M
    assert altitude.ground_sd == pytest.approx(whole, rel=1e-3)


def test_without_a_prediction_a_height_stands_on_the_ground_with_its_bias_taken_off(ground: Ground) -> None:
    """By attitude alone: the configured bias is taken off, and relief that is only assumed is no error of the range."""
    height = HeightAboveGround(
        t_ns=0, t_valid_ns=0, sensor="laser", valid=True, reasons=(), raw=103.0, nearest=103.0, nearest_sd=0.1,
        height_agl=100.0, sd=8.0, compensation=Compensation.ATTITUDE,
    )  # fmt: skip
    altitude = altitude_over_terrain(height, ground, at(ground, 50.0).position)
    assert altitude is not None
    assert (altitude.height_agl, altitude.height_sd) == (100.0, 0.1)


def test_a_height_over_contradicted_ground_is_no_altitude(ground: Ground) -> None:
    height = HeightAboveGround(
        t_ns=0, t_valid_ns=0, sensor="laser", valid=True, reasons=(), raw=100.0, nearest=100.0, nearest_sd=0.1,
        height_agl=100.0, sd=8.0, compensation=Compensation.ATTITUDE, unchecked=(Reason.GROUND_CONTRADICTED,),
    )  # fmt: skip
    assert altitude_over_terrain(height, ground, at(ground, 50.0).position) is None
