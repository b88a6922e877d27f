"""Validity live: an altimeter's channel over ground that is known, with holes, edges and sensors that are wrong."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fti.config import Device
from fti.messages.outputs import Compensation, HeightAboveGround
from fti.messages.reasons import Reason
from fti.nav.altimetry.altimeter_channel import AltimeterChannel, AltimeterReading
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import AttitudeState, PositionState
from fti.nav.terrain_reference import Ground
from fti.terrain.terrain import Terrain

LAT0, LON0 = math.radians(48.0), math.radians(11.5)
HEIGHT_M = 150.0
POSTS = np.arange(-600.0, 601.0, 5.0)


def channel(heights: np.ndarray, right_m: float = 0.0, **altimeter: Any) -> AltimeterChannel:
    """Over posts [m] around the place; a laser unless told otherwise, so far to the right of P."""
    limits = {"kind": "laser", "range_m": (1.0, 400.0), "max_roll_deg": 45.0, **altimeter}
    device = Device.model_validate(
        {
            "name": "altimeter",
            "link": "line",
            "driver": "lightware_ascii",
            "altimeter": limits,
            "lever_arm_b": (0.0, right_m, 0.0),
        }
    )
    terrain = Terrain.from_array(heights, 5.0, lat0=LAT0, lon0=LON0, east0=POSTS[0], north0=POSTS[0])
    altimeter_channel = AltimeterChannel(device)
    altimeter_channel.set_terrain(Ground(terrain, 0.0, "test"))
    return altimeter_channel


def output(of: AltimeterChannel, value: float, roll_deg: float = 0.0, place_sd: float = 0.1) -> HeightAboveGround:
    """What becomes of a sample 150 m over the place, heading north."""
    attitude = AttitudeState(math.radians(roll_deg), 0.0, 0.0, 1e-4, 1e-4)
    position = PositionState(LAT0, LON0, HEIGHT_M, place_sd, 0.1, 0.0, 0.0, 0.0, 0)
    return of.feed(AltimeterReading(10, 10, value, 0.1, False), NavState(10, attitude, position, "ins", "ins"))


def level() -> np.ndarray:
    return np.zeros((len(POSTS), len(POSTS)))


def test_a_sensor_that_measures_what_is_there_is_valid_and_one_that_does_not_is_not() -> None:
    laser = channel(level())
    assert output(laser, 150.2).reasons == ()
    assert output(laser, 155.2).reasons == (Reason.DEVIATION,)
    assert output(laser, 75.0).reasons == (Reason.DEVIATION,)  # a cloud
    assert output(channel(level(), max_deviation_m=6.0), 155.2).reasons == ()


def test_a_place_that_is_not_known_makes_no_sensor_wrong() -> None:
    slope = np.broadcast_to(0.8 * POSTS, (len(POSTS), len(POSTS)))
    assert output(channel(slope), 158.0).reasons == (Reason.DEVIATION,)
    assert output(channel(slope), 158.0, place_sd=10.0).reasons == ()


def test_a_widened_gate_has_a_reason() -> None:
    """8 m of deviation on a slope, the place known to 10 m: a gate of 24 m, and 5 m in the table; by 4 m 9.6 m."""
    slope = np.broadcast_to(0.8 * POSTS, (len(POSTS), len(POSTS)))
    assert output(channel(slope), 158.0, place_sd=10.0).unchecked == (Reason.UNCERTAIN,)
    assert output(channel(slope), 150.0, place_sd=4.0).unchecked == ()
    assert output(channel(slope), 150.0, place_sd=4.5).unchecked == (Reason.UNCERTAIN,)
    assert output(channel(slope, max_deviation_m=30.0), 158.0, place_sd=10.0).unchecked == ()


def test_a_hole_under_the_aircraft_does_not_refuse_a_beam_beside_it() -> None:
    holed = level()
    holed[np.ix_(np.abs(POSTS) < 12.0, np.abs(POSTS) < 12.0)] = np.nan
    beside = output(channel(holed, right_m=20.0, max_nadir_deviation_m=10.0), 150.0)
    assert beside.predicted == pytest.approx(150.0)
    assert beside.reasons == ()
    assert beside.compensation is Compensation.ATTITUDE
    assert beside.unchecked == (Reason.TERRAIN_HOLE,), "its height was held against nothing"
    assert output(channel(holed), 150.0).unchecked == (Reason.TERRAIN_HOLE,)


def test_an_island_of_known_ground_does_not_make_a_place_known() -> None:
    """Of 10 m of error of the place those of a metre are left on it, and their heights differ by nothing."""
    island = level()
    beside = np.maximum.outer(np.abs(POSTS), np.abs(POSTS))
    island[(beside > 7.0) & (beside < 200.0)] = np.nan
    assert output(channel(level()), 150.0, place_sd=10.0).compensation is Compensation.RANGE
    height = output(channel(island), 150.0, place_sd=10.0)
    assert height.predicted == pytest.approx(150.0)
    assert (height.compensation, height.unchecked) == (Compensation.ATTITUDE, (Reason.TERRAIN_HOLE,))


def test_a_height_that_is_used_as_it_is_is_held_against_the_navigated_one() -> None:
    """Banked 30 deg to the right the laser looks to the left, onto the roof of a wood, 20 m over the meadow below."""
    wood = np.where(np.broadcast_to(POSTS, (len(POSTS), len(POSTS))) < -30.0, 20.0, 0.0)
    slant = 130.0 / math.cos(math.radians(30.0))
    assert output(channel(wood), slant, roll_deg=30.0).reasons == ()
    gated = output(channel(wood, max_nadir_deviation_m=10.0), slant, roll_deg=30.0)
    assert gated.reasons == (Reason.NOT_NADIR,)
    assert gated.height_agl == pytest.approx(150.0, abs=0.3)  # which a terrain cures


def test_a_beam_that_grazes_the_ground_is_refused() -> None:
    wall = np.where(np.broadcast_to(POSTS, (len(POSTS), len(POSTS))) < -15.0, 60.0, 0.0)
    observed = output(channel(wall, max_deviation_m=1000.0), 130.0, roll_deg=8.0)
    assert observed.reasons == (Reason.INCIDENCE,)


def test_ground_in_the_beam_that_is_uneven_is_refused() -> None:
    rough = 60.0 * (np.indices((len(POSTS), len(POSTS))).sum(axis=0) // 8 % 2)
    radar = channel(rough, kind="radar", beam_deg=80.0, max_deviation_m=1000.0, max_dispersion=0.15)
    assert output(radar, 120.0).reasons == (Reason.DISPERSION,)
    assert output(channel(level(), kind="radar", beam_deg=80.0, max_dispersion=0.15), 150.0).reasons == ()
