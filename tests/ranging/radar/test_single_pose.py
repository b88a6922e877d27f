"""One pose at a time, compiled: to the last bit what the arrays of poses say."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.error_model import RangeError
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import cosine_antenna
from fti.ranging.radar.single_pose import SinglePoseRadar, total
from fti.ranging.sensor import Poses, Validity
from fti.terrain.terrain import Terrain

WIDTH = math.radians(40.0)
ENU_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
SENSORS = {
    "plain": RadarAltimeter(antenna=cosine_antenna(WIDTH, WIDTH)),
    "wide, with errors, in steps": RadarAltimeter(
        error=RangeError(bias=0.3, scale=1e-3), min_range=120.0, max_range=400.0, quantised=True
    ),
    "coherent": RadarAltimeter(antenna=cosine_antenna(WIDTH, WIDTH), order=8, coherent=True),
}


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    """Hills with a wall, a flat lake, a hole and an edge."""
    posts = np.arange(-200, 201) * 10.0
    east, north = np.meshgrid(posts, posts)
    hills = 30.0 * np.sin(east / 90.0) + 30.0 * np.cos(north / 70.0 + east / 400.0)
    hills[np.abs(east - 100.0) < 40.0] += 25.0
    hills[north < -1000.0] = -20.0
    hills[(np.abs(east + 900.0) < 60.0) & (np.abs(north - 900.0) < 60.0)] = np.nan
    return Terrain.from_array(hills, 10.0, lat0=0.84, lon0=0.19, east0=-2000.0, north0=-2000.0)


def poses(n: int) -> Poses:
    """Anywhere above, a few below, beyond the edge or no number; the first straight above the lake."""
    rng = np.random.default_rng(3)
    origins = rng.uniform((-2100, -2100, -40), (2100, 2100, 900), (n, 3))
    angles = rng.normal(0.0, (0.3, 0.2, 3.0), (n, 3))
    origins[0], angles[0] = (200.0, -1500.0, 150.0), 0.0
    origins[1, 0] = np.nan
    mats = np.stack([ENU_NED @ mat_from_rpy(*one) for one in angles])
    return Poses(origins, mats, rng.normal(0.0, 30.0, (n, 3)))


@pytest.mark.parametrize("name", SENSORS)
def test_the_same_to_the_last_bit(terrain: Terrain, name: str) -> None:
    sensor, at = SENSORS[name], poses(60 if name == "coherent" else 300)
    many, one = sensor.measure(terrain, at), SinglePoseRadar(sensor)
    counts: Counter[Validity] = Counter()
    for k in range(len(at)):
        found, ray, spread, validity = one.predict(terrain, at.origins_l[k], at.mats_ls[k], at.vels_l[k])
        assert validity == many.validity[k]
        expected = many.slant_range[k], *many.direction_s[k], many.dispersion[k]
        assert np.array_equal(expected, (found, *ray, spread), equal_nan=True), k
        counts[validity] += 1
    assert counts[Validity.VALID] > 20
    assert len(counts) >= 3, counts


@pytest.mark.parametrize("n", [*range(20), 127, 128, 129, 136, 137, 641, 751, 1000, 2051, 8101])
def test_a_sum_in_the_order_of_numpy(n: int) -> None:
    numbers = np.random.default_rng(n).standard_normal(n)
    assert total(numbers) == np.sum(numbers[None], axis=1)[0]


def test_another_order_is_another_sum() -> None:
    """So the test above can fail."""
    numbers = np.random.default_rng(1).standard_normal(641)
    assert total(numbers) != np.cumsum(numbers)[-1]
