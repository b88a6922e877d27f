"""The air, the ground and what stands on it."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest

from fti.config import Altimeter, Device
from fti.errors import ConfigError
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.environment import Environment, add_obstacles, calibrated_airspeed, impact_pressure, true_ground
from fti.hil.tables.fault_types import Obstacle, TerrainShift
from fti.hil.tables.flights import ApproachFlight
from fti.terrain.terrain import Terrain
from tests.hil.worlds import flat_terrain, path, scenario, world

DEVICE = Device(name="altimeter", link="line", driver="freeflight_ra4500")


def test_calibrated_equals_true_airspeed_in_the_standard_at_sea_level() -> None:
    q_c = impact_pressure(60.0, 101325.0, 288.15)
    assert float(q_c) == pytest.approx(0.5 * 1.225 * 60.0**2, rel=0.01)
    assert float(calibrated_airspeed(q_c)) == pytest.approx(60.0, rel=1e-6)


def test_altimeters_over_level_ground_measure_the_height() -> None:
    """The radar's leading edge from the nadir; the laser along a boresight that pitches with the aircraft."""
    environment, t = world(), np.arange(0.0, 10.0, 0.5)
    state = environment.state(t)
    height = state.alt - environment.ground(state)
    radar = environment.radar_ranges(t, math.radians(40.0), DEVICE)
    assert np.abs(radar - height).max() < 1.0
    laser = environment.laser_ranges(t, DEVICE)
    np.testing.assert_allclose(laser * np.cos(state.pitch) * np.cos(state.roll), height, atol=0.15)


def test_a_lever_arm_down_shortens_the_range() -> None:
    environment, t = world(), np.array([2.0])
    lower = DEVICE.model_copy(update={"lever_arm_b": (0.0, 0.0, 2.0)})
    assert (environment.laser_ranges(t, DEVICE) - environment.laser_ranges(t, lower))[0] == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(25.0, 0.0), (-25.0, 0.0), (0.0, 20.0), (10.0, -20.0)])
def test_a_mounting_turns_the_laser(roll_deg: float, pitch_deg: float) -> None:
    """Over level ground the range is the height over the cosine between the boresight and the vertical."""
    environment, t = world(), np.array([2.0])
    turned = DEVICE.model_copy(update={"rpy_bs_deg": (roll_deg, pitch_deg, 0.0)})
    now = environment.state(t)
    roll, pitch = math.radians(roll_deg), math.radians(pitch_deg)
    boresight_b = np.array([math.sin(pitch) * math.cos(roll), -math.sin(roll), math.cos(pitch) * math.cos(roll)])
    down = (mat_from_rpy(now.roll, now.pitch, 0.0) @ boresight_b)[..., 2]
    height = now.alt - environment.ground(now)
    assert environment.laser_ranges(t, turned) == pytest.approx(height / down, rel=1e-3)


def test_obstacles_stand_on_the_ground_and_on_each_other() -> None:
    ground = flat_terrain()
    ground = ground.with_finest(ground.finest.heights + 30.0)
    box = Obstacle(kind="obstacle", before_threshold_m=3000.0, height_m=20.0, length_m=80.0, width_m=80.0)
    lat, lon = path().to_geodetic(path().x_gpi + 3000.0, 0.0)
    raised = add_obstacles(ground, path(), [box, box])
    assert raised.height(lat, lon) - ground.height(lat, lon) == pytest.approx(40.0, abs=1e-3)


def test_an_obstacle_stands_where_it_was_put_and_nowhere_else() -> None:
    ground = flat_terrain()
    box = Obstacle(
        kind="obstacle", before_threshold_m=3000.0, right_m=100.0, height_m=150.0, length_m=80.0, width_m=80.0
    )
    raised = add_obstacles(ground, path(), [box])
    offsets = np.array([0.0, 25.0, 70.0, -70.0, 0.0, 0.0])
    sides = np.array([100.0, 100.0, 100.0, 100.0, 30.0, 170.0])
    lat, lon = path().to_geodetic(path().x_gpi + 3000.0 + offsets, sides)
    rise = raised.height(lat, lon) - ground.height(lat, lon)
    np.testing.assert_allclose(rise, [150.0, 150.0, 0.0, 0.0, 0.0, 0.0], atol=1e-3)
    assert np.count_nonzero(raised.finest.heights != ground.finest.heights) == pytest.approx(16, abs=4)
    assert not ground.finest.heights.any()


def test_an_obstacle_outside_the_ground_is_refused() -> None:
    box = Obstacle(kind="obstacle", before_threshold_m=30000.0, height_m=150.0)
    with pytest.raises(ValueError, match="outside the terrain"):
        add_obstacles(flat_terrain(), path(), [box])
    with pytest.raises(ConfigError, match=r"test: fault: an obstacle 30000 m before .* is outside the terrain"):
        world(fault=(box,))


def test_a_fault_that_begins_or_ends_after_the_flight_is_reported() -> None:
    cut = {"kind": "cut", "devices": ("altimeter",)}
    (remark,) = world(fault=({**cut, "from_s": 50.0, "to_s": 60.0},)).remarks
    assert remark == "fault[0], cable cut, begins at 50 s, but the flight ends at 10 s"
    (remark,) = world(fault=({**cut, "from_s": 9.0, "to_s": 60.0},)).remarks
    assert remark == "fault[0], cable cut, ends at 60 s, but the flight ends at 10 s"
    assert world(fault=({**cut, "from_s": 9.0, "to_s": 10.0},)).remarks == ()


@pytest.mark.parametrize("kind", ["laser", "radar"])
def test_range_bounds_are_the_ranges_a_little_aside(kind: Literal["laser", "radar"]) -> None:
    """On ground that falls by a tenth to the east, 3 m aside the range is another by 0.3 m, to both sides."""
    level = flat_terrain()
    slope = level.with_finest(np.broadcast_to(-0.1 * level.finest.east, level.finest.heights.shape).copy())
    falling = Environment(scenario(flight=ApproachFlight(duration_s=5.0)), path(), slope, undulation=47.0)
    altimeter = DEVICE.model_copy(update={"altimeter": Altimeter(kind=kind, range_m=(0.0, 2000.0))})
    t = np.array([1.0, 2.0])
    beam, min_range, max_range = falling.range_bounds(t, altimeter, 3.0)
    expected = (
        falling.laser_ranges(t, altimeter) if kind == "laser" else falling.radar_ranges(t, math.radians(40), DEVICE)
    )
    np.testing.assert_array_equal(beam, expected)
    np.testing.assert_allclose((beam - min_range, max_range - beam), 0.3, atol=0.02)


def test_the_radar_sees_the_obstacle() -> None:
    box = Obstacle(kind="obstacle", before_threshold_m=4200.0, height_m=100.0)
    t = np.array([5.0])
    clear, blocked = world().radar_ranges(t, 0.7, DEVICE), world(fault=(box,)).radar_ranges(t, 0.7, DEVICE)
    assert clear[0] - blocked[0] > 70.0


def test_the_true_ground_lies_where_the_displaced_copy_does_not() -> None:
    """A copy that is 300 m too far north, 200 m too far east and 25 m too high: the hill is south-west and lower."""
    posts = np.zeros((401, 401))
    posts[200, 200] = 80.0  # a hill of one post in the middle
    lat0, lon0 = math.radians(48.0), math.radians(11.0)
    copy = Terrain.from_array(posts, 20.0, lat0=lat0, lon0=lon0, alt0=500.0, east0=-4000.0, north0=-4000.0)
    ground = true_ground(copy, [TerrainShift(kind="terrain_shift", north_m=300.0, east_m=200.0, up_m=25.0)])
    # 1 degree at 48 degrees north: 111 194 m to the north and 74 625 m to the east (WGS84, 500 m above it)
    lat, lon = math.radians(48.0 - 300.0 / 111_203.0), math.radians(11.0 - 200.0 / 74_634.0)
    assert float(copy.height(lat0, lon0)) == pytest.approx(580.0, abs=0.01)
    assert float(ground.height(lat, lon)) == pytest.approx(555.0, abs=2.0)
    assert float(ground.height(lat0, lon0)) == pytest.approx(475.0, abs=0.05)
    far = math.radians(48.0 + 3000.0 / 111_203.0)  # 3 km from the origin of the frame: moved with its curvature
    assert float(copy.height(far, lon0) - ground.height(far, lon0)) == pytest.approx(25.0, abs=0.2)


def test_an_altimeter_measures_the_true_ground_below_a_displaced_copy() -> None:
    t = np.arange(0.0, 10.0, 0.5)
    shift = {"kind": "terrain_shift", "up_m": 25.0}
    without, wrong = (
        environment.radar_ranges(t, math.radians(40.0), DEVICE) for environment in (world(), world(fault=(shift,)))
    )
    np.testing.assert_allclose(wrong - without, 25.0, atol=0.2)


def test_a_flight_below_the_true_ground_is_refused() -> None:
    with pytest.raises(ConfigError, match="m below the ground at"):
        world(fault=({"kind": "terrain_shift", "up_m": -900.0},))
