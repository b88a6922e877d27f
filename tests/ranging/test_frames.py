"""The formal description in closed loops with a lever arm of 2 m, and each printed form that breaks them."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.local import LocalFrame
from fti.geodesy.rotations import mat_en, mat_from_rpy
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.nav.altimetry.compensation import Mounting, boresight, height_at_p
from fti.ranging import frames
from fti.ranging.sensor import sensor_poses

Array = NDArray[np.float64]

N = 2000
ARM = np.array([0.6, -0.8, np.sqrt(3.0)])  # 2 m
DOWN = np.array([0.0, 0.0, 1.0])
R20, P5 = np.radians(20.0), np.radians(5.0)
LEVEL = np.eye(3)


class Flight:
    """Random positions, attitudes, mountings, directions and ranges; P is a kilometre or so up."""

    def __init__(self, seed: int = 3) -> None:
        rng = np.random.default_rng(seed)
        self.lat, self.lon = rng.uniform(-1.4, 1.4, N), rng.uniform(-np.pi, np.pi, N)
        self.alt, self.slant = rng.uniform(-100.0, 4000.0, N), rng.uniform(1.0, 3000.0, N)
        self.rpy = rng.uniform(-np.pi, np.pi, N), rng.uniform(-1.5, 1.5, N), rng.uniform(0.0, 2 * np.pi, N)
        self.mat_nb = mat_from_rpy(*self.rpy)
        self.mat_bs = mat_from_rpy(*rng.uniform(-1.0, 1.0, (3, N)))
        towards = rng.standard_normal((N, 3))
        self.direction_s = towards / np.linalg.norm(towards, axis=1, keepdims=True)
        self.mat_sm = frames.mat_sm(self.direction_s)

    def d_n(self, arm: Array = ARM) -> Array:
        d_s = frames.in_sensor(self.slant, self.mat_sm)
        return frames.in_nav(frames.in_body(d_s, self.mat_bs, arm), self.mat_nb)

    def back(self, d_n: Array) -> Array:
        return frames.in_measurement(d_n, self.mat_nb, self.mat_bs, self.mat_sm, ARM)


FLIGHT = Flight()


def test_measurement_frame_is_a_rotation_onto_the_direction_whichever_way_it_looks() -> None:
    ways = np.concatenate((FLIGHT.direction_s, np.vstack((np.eye(3), -np.eye(3)))))
    mats = frames.mat_sm(ways)
    assert np.abs(mats @ np.swapaxes(mats, 1, 2) - np.eye(3)).max() < 1e-14
    assert np.linalg.det(mats) == pytest.approx(np.ones(len(ways)), abs=1e-14)
    assert (mats[..., 2] == ways).all()
    assert frames.mat_sm(DOWN) == pytest.approx(np.eye(3), abs=1e-15)


def test_there_and_back_with_a_lever_arm_over_random_attitudes() -> None:
    """2.37 to 2.39, then 2.46: the same range, and nothing beside the beam."""
    assert np.abs(FLIGHT.back(FLIGHT.d_n()) - FLIGHT.slant[:, None] * DOWN).max() < 1e-9


def test_there_and_back_by_way_of_the_earth_frame() -> None:
    """With 2.40 in the loop; 6 400 km in float64 are rounded by 0.5e-9 m, three components of two positions."""
    place = FLIGHT.lat, FLIGHT.lon, FLIGHT.alt
    back = FLIGHT.back(frames.from_point_e(frames.point_e(*place, FLIGHT.d_n()), *place))
    assert np.abs(back - FLIGHT.slant[:, None] * DOWN).max() < 3e-9


def test_point_is_that_of_the_poses_in_the_local_frame() -> None:
    """Sensor poses in a terrain's frame and the earth frame tell of one and the same point, but for rounding there."""
    frame = LocalFrame(0.8, 0.2, 300.0)
    rng = np.random.default_rng(8)
    lat, lon, alt = frame.to_geodetic(rng.uniform([-2e3, -2e3, 0.0], [2e3, 2e3, 1e3], (N, 3)))
    poses = sensor_poses(frame, (lat, lon, alt), FLIGHT.rpy, lever_arm_b=ARM, mat_bs=FLIGHT.mat_bs)
    point_l = poses.origins_l + FLIGHT.slant[:, None] * np.einsum("nij,nj->ni", poses.mats_ls, FLIGHT.direction_s)
    point_e = frames.point_e(lat, lon, alt, FLIGHT.d_n())
    assert np.abs((point_e - frame.origin_e) @ frame.mat_le.T - point_l).max() < 6e-9


def test_printed_sign_of_the_lever_arm_is_4_m_off() -> None:
    """2.38 and 2.46 as printed, x_b(S) from P to the sensor as the text says: two lever arms from the right point."""
    printed = frames.point_e(FLIGHT.lat, FLIGHT.lon, FLIGHT.alt, FLIGHT.d_n(-ARM))
    right = frames.point_e(FLIGHT.lat, FLIGHT.lon, FLIGHT.alt, FLIGHT.d_n())
    assert np.linalg.norm(printed - right, axis=1) == pytest.approx(np.full(N, 4.0), abs=1e-8)
    printed_back = frames.in_measurement(FLIGHT.d_n(), FLIGHT.mat_nb, FLIGHT.mat_bs, FLIGHT.mat_sm, -ARM)
    off = np.linalg.norm(printed_back - FLIGHT.slant[:, None] * DOWN, axis=1)
    assert off == pytest.approx(np.full(N, 4.0), abs=1e-9)


def test_sensor_2_m_below_p_at_98_m_puts_p_at_100_m() -> None:
    arm = np.array([0.0, 0.0, 2.0])
    d_n = frames.in_nav(frames.in_body(frames.in_sensor(98.0, LEVEL), LEVEL, arm), LEVEL)
    assert d_n == pytest.approx([0.0, 0.0, 100.0], abs=1e-12)
    assert frames.topographic_height(500.0, d_n) == pytest.approx(400.0, abs=1e-12)
    assert frames.range_over_level(100.0, LEVEL, LEVEL, LEVEL, arm) == pytest.approx(98.0, abs=1e-12)


def test_height_of_navigation_is_the_same_description() -> None:
    """The height of P that navigation computes with plain floats is the last row of 2.39."""
    for k in range(200):
        rpy_deg = tuple(np.degrees(np.random.default_rng(k).uniform(-0.5, 0.5, 3)))
        roll, pitch = 0.3 * FLIGHT.rpy[0][k], 0.3 * FLIGHT.rpy[1][k]
        mat_bs = mat_from_rpy(*np.radians(rpy_deg))
        arm = float(ARM[0]), float(ARM[1]), float(ARM[2])
        mounting = Mounting(boresight((float(rpy_deg[0]), float(rpy_deg[1]), float(rpy_deg[2]))), arm, 0.0)
        d_b = frames.in_body(frames.in_sensor(FLIGHT.slant[k], LEVEL), mat_bs, ARM)
        down = frames.in_nav(d_b, mat_from_rpy(roll, pitch, 1.0))[2]
        assert height_at_p(float(FLIGHT.slant[k]), roll, pitch, mounting).height_agl == pytest.approx(down, abs=1e-9)


# ------------------------------------------------------------------------------------------------- geodetic (2.41-2.45)


def test_curvature_matrix_is_the_derivative_of_the_position() -> None:
    """Columns of D against differences of the earth position over 1 m: linear to 1e-6."""
    lat, lon, alt = 0.85, 0.3, 1200.0
    metres = frames.metres_per_geodetic(lat, alt)
    for axis, step in enumerate(np.diag(1.0 / metres)):
        moved = ecef_from_geodetic(lat + step[0], lon + step[1], alt + step[2]) - ecef_from_geodetic(lat, lon, alt)
        assert mat_en(lat, lon).T @ moved == pytest.approx(np.eye(3)[axis], abs=1e-6)


def error_of_linear(lat: float, d_n: Array, alt: float = 0.0) -> Array:
    """North, east, up [m] of the linear point beyond the exact one."""
    exact, linear = frames.point_geodetic(lat, 0.2, alt, d_n), frames.point_geodetic_linear(lat, 0.2, alt, d_n)
    metres = frames.metres_per_geodetic(lat, alt)
    return np.array([(a - b) * m for a, b, m in zip(linear, exact, np.abs(metres), strict=True)])


@pytest.mark.parametrize("way", [1000.0, 3200.0, 10000.0])
def test_what_the_linear_form_leaves_out_is_as_stated(way: float) -> None:
    lat, r = np.radians(45.0), 6.37e6
    for towards in ([way, 0.0, 0.0], [0.0, way, 0.0]):
        assert error_of_linear(lat, np.array(towards))[2] == pytest.approx(-(way**2) / (2 * r), rel=0.01)
    assert error_of_linear(lat, np.array([0.0, way, 0.0]))[0] == pytest.approx(way**2 / (2 * r), rel=0.01)
    assert error_of_linear(lat, np.array([way, way, 0.0]))[1] == pytest.approx(-(way**2) / r, rel=0.01)
    assert error_of_linear(lat, np.array([0.0, way, 1000.0]))[1] == pytest.approx(-1000.0 * way / r, rel=0.02)


@pytest.mark.parametrize("lat", [-np.pi / 2, np.pi / 2, np.pi / 2 - 3e-6])
def test_at_a_pole_the_linear_form_is_nan_and_the_exact_one_goes_across(lat: float) -> None:
    """20 m from the pole, 30 m on: with a longitude over a radius of nothing it would be 5e10 rad and beyond 90 deg."""
    d_n = np.array([np.copysign(30.0, lat), 5.0, 100.0])
    assert all(np.isnan(value) for value in frames.point_geodetic_linear(lat, 0.2, 500.0, d_n))
    there = frames.point_geodetic(lat, 0.2, 500.0, d_n)
    assert abs(there[0]) < np.pi / 2 and there[2] == pytest.approx(400.0, abs=1e-3)
    back = frames.from_point_e(ecef_from_geodetic(*there), lat, 0.2, 500.0)
    assert back == pytest.approx(d_n, abs=3e-9)


def test_across_the_date_line_and_on_the_southern_half_the_point_is_the_same() -> None:
    d_n = np.array([-40.0, 30.0, 100.0])
    for lat in (-0.7, 0.7):
        east_of_it, inland = (frames.point_geodetic(lat, lon, 500.0, d_n) for lon in (np.pi - 1e-7, 0.0))
        assert east_of_it[0] == pytest.approx(inland[0], abs=1e-15)
        assert east_of_it[1] == pytest.approx(inland[1] - np.pi - 1e-7, abs=1e-14)


def test_topographic_height_is_the_exact_one_but_for_the_curvature() -> None:
    d_n = FLIGHT.d_n()
    _, _, exact = frames.point_geodetic(FLIGHT.lat, FLIGHT.lon, FLIGHT.alt, d_n)
    low = exact - frames.topographic_height(FLIGHT.alt, d_n)
    # s^2 / 2R, with R between the polar 6.336e6 and 6.400e6 m and less by what lies below
    assert low == pytest.approx((d_n[:, :2] ** 2).sum(axis=1) / (2 * 6.37e6), rel=0.01, abs=1e-8)
    linear = frames.point_geodetic_linear(FLIGHT.lat, FLIGHT.lon, FLIGHT.alt, d_n)[2]  # 2.44: (0 0 1) D^-1 = -(0 0 1)
    assert (linear == frames.topographic_height(FLIGHT.alt, d_n)).all()


def test_printed_geodetic_form_with_r_en_lands_elsewhere() -> None:
    """2.42 as printed turns the vector into the earth frame and divides it by radii of north and east."""
    lat, lon, alt = 0.84, 0.2, 500.0
    d_n = np.array([30.0, 20.0, 400.0])
    printed = np.array([lat, lon, alt]) + mat_en(lat, lon) @ d_n / frames.metres_per_geodetic(lat, alt)
    assert printed[2] == pytest.approx(500.0 + 275.0, abs=5.0)  # a point 400 m below comes out 275 m above
    assert frames.point_geodetic(lat, lon, alt, d_n)[2] == pytest.approx(100.0, abs=1e-3)


# ------------------------------------------------------------------------------------------------ level ground (2.47)


def printed_2_47(height: float, mat_nb: Array, arm: Array) -> float:
    return float(-(DOWN @ (mat_nb.T @ DOWN * height - arm)))


def test_slant_range_at_roll_20_pitch_5_over_300_m_is_320_5_m() -> None:
    mat_nb = mat_from_rpy(R20, P5, 0.7)
    values = frames.range_over_level(300.0, mat_nb, LEVEL, LEVEL, np.zeros(3))
    assert values == pytest.approx(300.0 / (np.cos(R20) * np.cos(P5)), abs=1e-10)
    assert values == pytest.approx(320.5, abs=0.05)


def test_printed_slant_range_is_negative_and_a_projection() -> None:
    mat_nb = mat_from_rpy(R20, P5, 0.7)
    assert printed_2_47(300.0, mat_nb, np.zeros(3)) == pytest.approx(-300.0 * np.cos(R20) * np.cos(P5), abs=1e-9)
    assert abs(printed_2_47(300.0, mat_nb, np.zeros(3))) == pytest.approx(280.8, abs=0.05)  # not 320.5


def test_slant_range_over_level_ground_closes_the_loop() -> None:
    d_n = FLIGHT.d_n()
    values = frames.range_over_level(d_n[:, 2], FLIGHT.mat_nb, FLIGHT.mat_bs, FLIGHT.mat_sm, ARM)
    beam_n = np.einsum("nij,njk,nk->ni", FLIGHT.mat_nb, FLIGHT.mat_bs, FLIGHT.direction_s)
    looks_down = beam_n[:, 2] > 0.0
    assert np.isnan(values[~looks_down]).all() and 0.4 < looks_down.mean() < 0.6
    error = np.abs(values - FLIGHT.slant)[looks_down]
    assert (error * beam_n[looks_down, 2]).max() < 1e-11  # in height; a grazing beam stretches it by 1 / cos


def test_no_range_where_the_sensor_is_under_the_ground() -> None:
    assert np.isnan(frames.range_over_level(1.5, LEVEL, LEVEL, LEVEL, [0.0, 0.0, 2.0]))
    assert frames.range_over_level(2.0, LEVEL, LEVEL, LEVEL, [0.0, 0.0, 2.0]) == 0.0


def test_no_range_where_the_beam_looks_up() -> None:
    for roll in (100.0, 180.0, -91.0):
        mat_nb = mat_from_rpy(np.radians(roll), 0.0, 0.3)
        assert np.isnan(frames.range_over_level(300.0, mat_nb, LEVEL, LEVEL, np.zeros(3)))
