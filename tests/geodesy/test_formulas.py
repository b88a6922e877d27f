"""The only form of each formula against pyproj, scipy and closed forms; and the arrays, which are compiled from it."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pyproj
import pytest
from scipy.spatial.transform import Rotation

from fti.geodesy import formulas, quaternions, rotations, wgs84
from fti.geodesy.gravity import normal_gravity
from fti.geodesy.local import LocalFrame

LATS = (-math.pi / 2, -1.2, -1e-9, 0.0, 0.7, 1.5707, math.pi / 2)
LONS = (-math.pi, -0.3, 0.0, 2.5, math.pi)
PLACES = list(itertools.product(LATS, LONS, (-400.0, 0.0, 12_000.0)))
ATTITUDES = np.random.default_rng(5).uniform((-3.1, -1.5, 0.0), (3.1, 1.5, 6.28), (40, 3)).tolist()
TO_ECEF = pyproj.Transformer.from_crs(4979, 4978, always_xy=True)


def scipy_quat(q: formulas.Quaternion) -> Rotation:
    return Rotation.from_quat([q[1], q[2], q[3], q[0]])


@pytest.mark.parametrize("place", PLACES)
def test_positions_are_those_of_proj(place: tuple[float, float, float]) -> None:
    """4 nm there.  Back, PROJ has one step of Bowring's: 0.01 mm at these heights."""
    lat, lon, alt = place
    expected = TO_ECEF.transform(lon, lat, alt, radians=True)
    assert formulas.ecef_from_geodetic(*place) == pytest.approx(expected, abs=4e-9)
    back = formulas.geodetic_from_ecef(*expected)
    assert back[2] == pytest.approx(alt, abs=4e-9)
    assert back[0] == pytest.approx(lat, abs=1e-15)
    if abs(lat) < 1.5707:  # a pole has any longitude
        assert math.remainder(back[1] - lon, math.tau) == pytest.approx(0.0, abs=1e-15)


def test_the_centre_of_the_earth_has_some_place() -> None:
    assert formulas.geodetic_from_ecef(0.0, 0.0, 0.0) == (0.0, 0.0, -formulas.SEMI_MAJOR)


def test_radii_and_gravity_of_equator_and_pole() -> None:
    """a (1 - e^2) and a; a^2 / b twice.  NIMA TR 8350.2, table 3.4: 9.7803253359 and 9.8321849378 m/s^2."""
    a, b = 6378137.0, 6356752.3142
    assert formulas.radii(0.0) == pytest.approx((b * b / a, a), abs=1e-3)
    assert formulas.radii(math.pi / 2) == pytest.approx((a * a / b, a * a / b), abs=1e-3)
    assert formulas.normal_gravity(0.0, 0.0) == 9.7803253359
    assert formulas.normal_gravity(-1.0, 1000.0) == pytest.approx(9.8321849378 - 3.086e-3, abs=2e-10)


@pytest.mark.parametrize("rpy", ATTITUDES)
def test_rotations_are_those_of_scipy(rpy: list[float]) -> None:
    roll, pitch, heading = rpy
    expected = Rotation.from_euler("ZYX", [heading, pitch, roll])
    rows, v = formulas.mat_nb(roll, pitch, heading), (1.0, -2.0, 0.5)
    np.testing.assert_allclose(rows, expected.as_matrix(), atol=1e-15)
    assert formulas.rotate(rows, v) == pytest.approx(expected.apply(v), abs=1e-14)
    assert formulas.rotate_back(rows, v) == pytest.approx(expected.inv().apply(v), abs=1e-14)
    assert formulas.rpy_from_mat(rows) == pytest.approx((roll, pitch, heading), abs=1e-12)
    quat = formulas.quat_from_mat(rows)
    assert (scipy_quat(quat) * expected.inv()).magnitude() < 1e-14
    np.testing.assert_allclose(formulas.mat_from_quat(*quat), rows, atol=1e-14)
    longer = (2.0 * quat[0], 2.0 * quat[1], 2.0 * quat[2], 2.0 * quat[3])
    assert formulas.rotate_by_quat(longer, v) == pytest.approx(expected.apply(v), abs=1e-14)
    turn = formulas.quat_from_turn(roll, pitch, -heading / 3.0)
    by_turn = Rotation.from_rotvec([roll, pitch, -heading / 3.0])
    both = formulas.quat_product(turn, quat)
    assert (scipy_quat(both) * (by_turn * expected).inv()).magnitude() < 1e-14


@pytest.mark.parametrize(("lat", "lon", "alt"), PLACES)
def test_the_axes_of_a_place_are_those_of_scipy(lat: float, lon: float, alt: float) -> None:
    """From the earth frame by the longitude about z, then down from the pole."""
    del alt
    expected = Rotation.from_euler("ZY", [lon, -lat - math.pi / 2]).as_matrix()
    np.testing.assert_allclose(formulas.mat_en(lat, lon), expected, atol=1e-15)


def test_angles_are_wrapped() -> None:
    angles = (0.0, math.pi, -math.pi, 7.0, -7.0, -1e-20)
    assert [formulas.wrap_heading(a) for a in angles] == pytest.approx([0, math.pi, math.pi, 0.716815, 5.566371, 0])
    assert math.isnan(formulas.wrap_heading(math.nan))  # an unknown heading is not north
    assert [formulas.wrap_half_turn(a) for a in angles] == pytest.approx(
        [0.0, -math.pi, -math.pi, 0.716815, -0.716815, 0.0], abs=1e-6
    )


def test_arrays_have_the_values_of_their_elements() -> None:
    """To rounding; shapes broadcast."""
    lat, lon, alt = np.array(PLACES).T
    xyz = wgs84.ecef_from_geodetic(lat, lon, alt)
    np.testing.assert_allclose(xyz, [formulas.ecef_from_geodetic(*place) for place in PLACES], rtol=0.0, atol=2e-9)
    back = np.stack(wgs84.geodetic_from_ecef(xyz), axis=-1)
    np.testing.assert_allclose(back, [formulas.geodetic_from_ecef(*p) for p in xyz.tolist()], rtol=1e-14, atol=2e-9)
    np.testing.assert_allclose(wgs84.radii(lat), np.transpose([formulas.radii(x) for x in lat.tolist()]), rtol=1e-15)
    assert wgs84.ecef_from_geodetic(lat[:, None], lon[:2], 0.0).shape == (len(lat), 2, 3)
    assert wgs84.radii(0.3)[0].shape == ()
    gravity = [formulas.normal_gravity(math.sin(x), h) for x, _, h in PLACES]
    np.testing.assert_allclose(normal_gravity(lat, alt), gravity, rtol=1e-15)
    mats = rotations.mat_from_rpy(*np.transpose(ATTITUDES))
    np.testing.assert_allclose(mats, [formulas.mat_nb(*rpy) for rpy in ATTITUDES], rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(np.transpose(rotations.rpy_from_mat(mats)), ATTITUDES, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(rotations.mat_en(0.3, lon[:2])[1], formulas.mat_en(0.3, float(lon[1])), atol=1e-15)
    quats = quaternions.quat_from_mat(mats)
    np.testing.assert_allclose(quaternions.mat_from_quat(quats), mats, rtol=0.0, atol=1e-14)


def test_one_point_in_a_local_frame() -> None:
    frame = LocalFrame(0.8, 0.2, 300.0)
    points = [frame.point_to_local(*place) for place in PLACES]
    np.testing.assert_allclose(points, frame.to_local(*np.transpose(PLACES)), rtol=0.0, atol=1e-8)
