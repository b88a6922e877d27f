"""The predicted measurement: closed forms on planes, the plumb line, the beam's rays, and poses that mean nothing."""

import math

import numpy as np
import pytest

from fti.geodesy.rotations import mat_from_rpy
from fti.nav.altimetry.range_prediction import Predictor
from fti.ranging.laser import Laser
from fti.ranging.nearest import NearestReturn
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import WIDE
from fti.ranging.sensor import Validity
from fti.terrain.terrain import Terrain

R20, P5 = math.radians(20.0), math.radians(5.0)
LASER = Laser(max_range=2000.0)


def plane(to_east: float = 0.0, to_north: float = 0.0, half: float = 2000.0, **frame: float) -> Terrain:
    """A plane through the origin of the frame, posts 100 m apart, with gradients to the east and to the north."""
    at = np.arange(-half, half + 1.0, 100.0)
    heights = to_east * at[None, :] + to_north * at[:, None]
    return Terrain.from_array(heights, 100.0, east0=-half, north0=-half, **frame)


def test_pencil_over_level_ground_is_h_over_cos() -> None:
    prediction = Predictor(plane(), LASER).predict_local([0.0, 0.0, 300.0], mat_from_rpy(R20, P5, 1.0))
    assert prediction.slant_range[0] == pytest.approx(300.0 / (math.cos(R20) * math.cos(P5)), rel=1e-12)
    assert prediction.height_p[0] == pytest.approx(300.0, abs=1e-9)
    assert prediction.incidence[0] == pytest.approx(math.acos(math.cos(R20) * math.cos(P5)), abs=1e-9)
    assert prediction.rise[0] == pytest.approx(0.0, abs=1e-9)
    assert prediction.dispersion[0] == 0.0


def test_rise_is_the_height_of_m_over_n_on_a_slope() -> None:
    """Right wing down to the east over ground that climbs to the east: M lies higher than N."""
    prediction = Predictor(plane(to_east=0.2), LASER).predict_local([0.0, 0.0, 300.0], mat_from_rpy(-R20, 0.0, 0.0))
    east, north, up = prediction.point_l[0]
    assert east == pytest.approx(300.0 * math.tan(R20) / (1.0 + 0.2 * math.tan(R20)), rel=1e-9)
    assert (north, up) == pytest.approx((0.0, 0.2 * east), abs=1e-9)
    assert prediction.rise[0] == pytest.approx(up, abs=1e-9)
    normal = np.array([0.0, 0.2, 1.0]) / math.sqrt(1.04)  # north, east, down; into the ground
    np.testing.assert_allclose(prediction.normal_n[0], normal, atol=1e-12)
    np.testing.assert_allclose(prediction.nadir_n[0], normal, atol=1e-12)


def test_lever_arm_and_mounting_are_those_of_the_sensor() -> None:
    """2 m below P and 3 m ahead, boresight 10 deg to the left: of a roll of 20 deg 10 remain."""
    mounted = Predictor(plane(), LASER, lever_arm_b=(3.0, 0.0, 2.0), mat_bs=mat_from_rpy(math.radians(10.0), 0.0, 0.0))
    prediction = mounted.predict_local([0.0, 0.0, 100.0], mat_from_rpy(math.radians(-20.0), P5, 0.0))
    below = -3.0 * math.sin(P5) + 2.0 * math.cos(math.radians(20.0)) * math.cos(P5)
    assert prediction.lever_n[0, 2] == pytest.approx(below, abs=1e-12)
    tilt = math.cos(math.radians(10.0)) * math.cos(P5)
    assert prediction.slant_range[0] == pytest.approx((100.0 - below) / tilt, rel=1e-12)
    assert prediction.height_p[0] == pytest.approx(100.0, abs=1e-9)


def test_nearest_return_comes_along_the_normal_of_a_slope() -> None:
    prediction = Predictor(plane(to_north=0.2), NearestReturn(rings=8)).predict_local([0.0, 0.0, 300.0], np.eye(3))
    np.testing.assert_allclose(
        prediction.direction_n[0], [0.2 / math.sqrt(1.04), 0.0, 1.0 / math.sqrt(1.04)], atol=2e-3
    )
    assert prediction.slant_range[0] == pytest.approx(300.0 / math.sqrt(1.04), abs=2e-3)
    assert prediction.incidence[0] < 3e-3
    assert prediction.dispersion[0] > 1.0


def test_radar_reports_which_ray_gives_its_edge() -> None:
    """Rolled by 20 deg the leading edge over level ground still comes from nearly straight below."""
    prediction = Predictor(plane(), RadarAltimeter(antenna=WIDE, order=12)).predict_local(
        [0.0, 0.0, 300.0], mat_from_rpy(R20, 0.0, 0.5)
    )
    assert prediction.slant_range[0] == pytest.approx(300.0, abs=2.5)
    assert prediction.cosine[0] > math.cos(math.radians(7.0))
    assert prediction.dispersion[0] > 5.0


@pytest.mark.parametrize(
    ("lat", "lon"), [(0.84, 0.2), (0.0, math.pi), (0.5 * math.pi, 0.0), (-0.5 * math.pi, 2.0), (1.2, -math.pi)]
)
def test_heights_follow_the_plumb_line_everywhere(lat: float, lon: float) -> None:
    """8 km from the frame's origin, also beyond a pole and the date line: the surface is a sphere's, not a plane's.

    Level ground of the frame rises above the ellipsoid with the square of the distance; N lies where the plumb line
    meets it, and ``Terrain.height`` says how high that is.
    """
    ground = plane(half=12_000.0, lat0=lat, lon0=lon)
    place = ground.frame.to_geodetic([6000.0, -5000.0, 305.0])
    prediction = Predictor(ground, LASER).at(*place, 0.1, 0.05, 2.0)
    expected = float(place[2]) - float(ground.height(place[0], place[1]))
    assert prediction.height_p[0] == pytest.approx(expected, abs=1e-6)
    assert prediction.rise[0] == pytest.approx(0.0, abs=0.1)  # the ground leans by 1.2 mrad against the plumb line here


def test_under_the_surface_the_height_is_negative_and_the_range_unknown() -> None:
    prediction = Predictor(plane(), LASER).predict_local([0.0, 0.0, -3.0], np.eye(3))
    assert prediction.height_p[0] == pytest.approx(-3.0)
    assert prediction.validity[0] == Validity.BURIED
    assert np.isnan(prediction.slant_range[0])


@pytest.mark.parametrize("sensor", [LASER, NearestReturn(rings=2), RadarAltimeter(order=4)])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("which", range(6))
def test_a_pose_that_is_no_number_is_unknown(
    sensor: Laser | NearestReturn | RadarAltimeter, bad: float, which: int
) -> None:
    pose = [0.0, 0.0, 300.0, 0.1, 0.1, 0.1]
    pose[which] = bad
    prediction = Predictor(plane(), sensor).at(*pose)
    assert not prediction.valid[0]
    assert np.isnan(
        [prediction.slant_range[0], prediction.cosine[0], prediction.incidence[0], prediction.rise[0]]
    ).all()


@pytest.mark.parametrize("roll_deg", [89.0, 90.0, 120.0, 180.0])
def test_a_beam_that_looks_up_returns_nothing(roll_deg: float) -> None:
    prediction = Predictor(plane(), LASER).at(0.0, 0.0, 300.0, math.radians(roll_deg), 0.0, 0.0)
    assert not prediction.valid[0]
    assert prediction.height_p[0] == pytest.approx(300.0, abs=1e-6)


def test_outside_the_terrain_is_reported() -> None:
    prediction = Predictor(plane(), LASER).at(0.1, 0.1, 300.0, 0.0, 0.0, 0.0)
    assert prediction.validity[0] == Validity.OUTSIDE
    assert np.isnan(prediction.height_p[0])
