"""The predicted range of one pose: closed forms over a slope, and the reason where there is none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec import structs
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fti.config import Altimeter, Device
from fti.messages.reasons import Reason
from fti.nav.altimetry.expected_range import HEADING_SD, AltimeterPredictor
from fti.nav.altimetry.expected_sample import ExpectedSample, ExpectedSampleOrReason, NoGround
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import AttitudeState, PositionState
from fti.nav.terrain_reference import Ground
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]

LAT, LON = 0.84, 0.19
LEVER, MOUNTED_DEG = (-1.2, 0.3, 0.6), (2.0, -3.0, 10.0)
FLAT_SD, HIGH_SD, TILT_SD, RANGE_SD, DEM_SD = 3.0, 2.0, 0.008, 0.3, 1.5


@pytest.fixture(scope="module")
def ground() -> Ground:
    """Hills of 60 m, 12 km wide, with a wall; its frame lies at LAT, LON."""
    posts = np.arange(-600, 601) * 10.0
    east, north = np.meshgrid(posts, posts)
    hills = 300.0 + 30.0 * np.sin(east / 90.0) + 30.0 * np.cos(north / 70.0 + east / 400.0)
    hills[(np.abs(east - 100.0) < 40.0)] += 25.0
    terrain = Terrain.from_array(hills, 10.0, lat0=LAT, lon0=LON, east0=-6000.0, north0=-6000.0)
    return Ground(terrain, DEM_SD, "hills")


def device(kind: str, model: str = "nearest") -> Device:
    altimeter = Altimeter.model_validate({"kind": kind, "range_m": (0.5, 700.0), "model": model})
    return Device(name="a", link="l", driver="d", altimeter=altimeter, lever_arm_b=LEVER, rpy_bs_deg=MOUNTED_DEG)


KINDS = [("laser", "nearest"), ("radar", "nearest"), ("radar", "beam")]


def poses(n: int) -> list[NavState]:
    rng = np.random.default_rng(7)
    found = []
    for north, east, up in rng.uniform((-3000, -3000, 420), (3000, 3000, 650), (n, 3)):
        lat, lon = LAT + north / 6.37e6, LON + east / (6.37e6 * math.cos(LAT))
        roll, pitch, heading = rng.uniform((-0.5, -0.3, 0.0), (0.5, 0.3, 6.28))
        attitude = AttitudeState(roll, pitch, heading, TILT_SD, TILT_SD / 2)
        found.append(
            NavState(0, attitude, PositionState(lat, lon, up, FLAT_SD, HIGH_SD, 40.0, -30.0, 2.0, 0), "a", "a")
        )
    return found


class Slope:
    """A plane that climbs to the north and falls to the east, and a range to it from any pose, in closed form."""

    NORTH, EAST, UP = 0.2, -0.1, 300.0

    def __init__(self, nav: NavState) -> None:
        assert nav.attitude is not None
        angles = nav.attitude.heading, nav.attitude.pitch, nav.attitude.roll
        yaw, pitch, roll = np.radians(MOUNTED_DEG)[::-1]
        self.mat_nb = Rotation.from_euler("ZYX", angles).as_matrix()
        self.ray_b = Rotation.from_euler("ZYX", (yaw, pitch, roll)).apply([0.0, 0.0, 1.0])
        self.normal = np.array([self.NORTH, self.EAST, 1.0]) / math.sqrt(1.0 + self.NORTH**2 + self.EAST**2)

    def above(self, p: Array) -> float:
        """Height of a point north, east, down over the plane."""
        return float(-p[2] - self.UP - self.NORTH * p[0] - self.EAST * p[1])

    def range(self, p: Array, error: Array | None = None) -> float:
        """From P with an error of the pose: north, east, down, and about them."""
        dp, psi = np.zeros((2, 3)) if error is None else error.reshape(2, 3)
        turned = Rotation.from_rotvec(psi).as_matrix() @ self.mat_nb
        sensor, ray = p + dp + turned @ LEVER, turned @ self.ray_b
        return self.above(sensor) / float(ray[2] + self.NORTH * ray[0] + self.EAST * ray[1])


@pytest.mark.parametrize("attitude", [(0.0, 0.0, 0.0), (0.2, -0.1, 1.0), (-0.3, 0.15, 4.0)])
def test_a_laser_over_a_slope_in_closed_form(attitude: tuple[float, float, float]) -> None:
    """Range, height and angles to a micrometre; sigmas, by differences of the closed form, to 5 %: 64 drawn errors."""
    posts = np.arange(-200, 201) * 10.0
    heights = Slope.UP + Slope.EAST * posts[None, :] + Slope.NORTH * posts[:, None]
    terrain = Terrain.from_array(heights, 10.0, lat0=LAT, lon0=LON, east0=-2000.0, north0=-2000.0)
    position = PositionState(LAT, LON, 700.0, FLAT_SD, HIGH_SD, 40.0, -30.0, 2.0, 0)
    nav = NavState(0, AttitudeState(*attitude, TILT_SD, TILT_SD / 2), position, "a", "a")
    here = AltimeterPredictor(device("laser"), Ground(terrain, DEM_SD, "slope")).predict(nav, RANGE_SD)
    assert isinstance(here, ExpectedSample)
    slope, p = Slope(nav), np.array([0.0, 0.0, -700.0])
    ray = slope.mat_nb @ slope.ray_b
    assert here.slant_range == pytest.approx(slope.range(p), abs=1e-6)
    assert here.height == pytest.approx(400.0, abs=1e-6)
    assert here.dispersion == 0.0
    assert here.cosine == pytest.approx(ray[2], abs=1e-9)
    assert here.incidence == pytest.approx(math.acos(ray @ slope.normal), abs=1e-9)
    assert here.ground_sd == pytest.approx(FLAT_SD * math.hypot(slope.NORTH, slope.EAST), abs=1e-6)
    sds = np.array([FLAT_SD, FLAT_SD, HIGH_SD, TILT_SD, TILT_SD, HEADING_SD])
    by_range = np.array([slope.range(p, e) - slope.range(p, -e) for e in np.diag(1e-2 * sds)]) / 2e-2
    by_nadir = np.array([slope.above(p + e) - slope.above(p - e) for e in np.diag(1e-2 * sds)[:, :3]]) / 2e-2
    by_dem = 1.0 / (ray[2] + slope.NORTH * ray[0] + slope.EAST * ray[1])  # a lower ground is so much farther
    assert here.range_sd == pytest.approx(math.hypot(*by_range, by_dem * DEM_SD, RANGE_SD), rel=0.05)
    way = slope.mat_nb @ LEVER + here.slant_range * ray
    apart = DEM_SD * math.sqrt(2.0 - 2.0 * math.exp(-math.hypot(way[0], way[1]) / 100.0))
    expected = math.hypot(*(by_nadir - ray[2] * by_range), apart, ray[2] * RANGE_SD)
    assert here.height_sd == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize(("kind", "model"), KINDS)
def test_bias_and_scale_of_an_altimeter_are_expected_of_it(ground: Ground, kind: str, model: str) -> None:
    """Only the range changes; values of the ray, the ground and the position stay the same."""
    bare = device(kind, model)
    assert bare.altimeter is not None
    wrong = bare.altimeter.model_copy(update={"bias_m": 2.0, "scale": 1.01})
    biased = AltimeterPredictor(bare.model_copy(update={"altimeter": wrong}), ground)
    for nav in poses(6):
        there, here = AltimeterPredictor(bare, ground).predict(nav, RANGE_SD), biased.predict(nav, RANGE_SD)
        if isinstance(there, ExpectedSample) and isinstance(here, ExpectedSample):
            assert here.slant_range == pytest.approx(1.01 * there.slant_range + 2.0)
            assert structs.replace(here, slant_range=there.slant_range) == there


def test_the_threshold_of_the_leading_edge_is_that_of_the_configuration(ground: Ground) -> None:
    """A lower threshold detects the ground earlier, never later."""
    bare = device("radar", "beam")
    assert bare.altimeter is not None
    found = []
    for level in (None, -6.0206, -20.0):
        altimeter = bare.altimeter.model_copy(update={"threshold_db": level})
        one = AltimeterPredictor(bare.model_copy(update={"altimeter": altimeter}), ground)
        found.append(
            [
                e.slant_range if isinstance(e := one.predict(nav, RANGE_SD), ExpectedSample) else math.nan
                for nav in poses(12)
            ]
        )
    default, quarter, deep = np.array(found)
    assert np.nanmax(np.abs(default - quarter)) < 1e-3
    assert np.nanmax(deep - default) < 0.5
    assert np.nanmean(default - deep) > 1.0


def test_the_reason_for_a_missing_prediction_is_returned(ground: Ground) -> None:
    predictor = AltimeterPredictor(device("laser"), ground)
    level = AttitudeState(0.0, 0.0, 0.0, None, None)

    def predict(
        attitude: AttitudeState | None, lat: float | None = None, lon: float = 0.0, alt: float | None = None
    ) -> ExpectedSampleOrReason:
        position = None if lat is None else PositionState(lat, lon, alt, None, None, None, None, None, 0)
        return predictor.predict(NavState(0, attitude, position, None, None), None)

    assert isinstance(predict(level, LAT, LON, 500.0), ExpectedSample)
    assert predict(level) is Reason.NO_POSITION
    assert predict(None, LAT, LON, 500.0) is Reason.NO_ATTITUDE
    assert predict(level, LAT, LON, None) is Reason.NO_ALTITUDE
    assert predict(AttitudeState(0.0, 0.0, None, None, None), LAT, LON, 500.0) is Reason.NO_HEADING
    assert predict(level, LAT + 0.01, LON, 500.0) is Reason.TERRAIN_EDGE
    assert predict(level, LAT, LON, 100.0) is Reason.HEIGHT_ERROR  # below the ground
    assert isinstance(predict(level, LAT, LON, 9000.0), NoGround)
    for nothing in (math.nan, math.inf, 1e300):
        assert predict(level, LAT, LON, nothing) is Reason.NO_ALTITUDE
        assert isinstance(predict(level, nothing, LON, 500.0), Reason)
    for lat in (math.pi / 2, -math.pi / 2):
        assert isinstance(predict(level, lat, math.pi, 500.0), Reason)
    straight_up = predict(AttitudeState(0.0, math.pi / 2, 1.0, None, None), LAT, LON, 500.0)
    assert not isinstance(straight_up, ExpectedSample) or math.isfinite(straight_up.slant_range)
