import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.baselines import Baselines
from fti.ranging.interferometric import (
    InterferometricAltimeter,
    InterferometricReturns,
    angles_from_direction,
    direction_from_angles,
)
from fti.ranging.sensor import Poses, Validity
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]

EXACT = InterferometricAltimeter()
HEIGHT, SPEED = 1000.0, 40.0


def plane(slope_east: float = 0.0, slope_north: float = 0.0, hole: bool = False) -> Terrain:
    posts = np.linspace(-2000.0, 2000.0, 41)
    east, north = np.meshgrid(posts, posts)
    heights = slope_east * east + slope_north * north
    if hole:
        heights[20, 22] = np.nan  # 200 m east of the origin
    return Terrain.from_array(heights, 100.0, east0=-2000.0, north0=-2000.0)


FLAT = plane()


def poses(
    roll: ArrayLike = 0.0, pitch: ArrayLike = 0.0, crab: ArrayLike = 0.0, climb: ArrayLike = 0.0, course: float = 0.0
) -> Poses:
    """At HEIGHT over the origin; all angles in degrees, crab is heading minus course."""
    roll, pitch, crab, climb = np.broadcast_arrays(*(np.atleast_1d(np.radians(a)) for a in (roll, pitch, crab, climb)))
    mats = MAT_ENU_NED @ mat_from_rpy(roll, pitch, np.radians(course) + crab)
    way = np.array([np.sin(np.radians(course)), np.cos(np.radians(course)), 0.0])
    vels = SPEED * (np.cos(climb)[:, None] * way + np.sin(climb)[:, None] * [0.0, 0.0, 1.0])
    return Poses(np.tile([0.0, 0.0, HEIGHT], (len(mats), 1)), mats, vels)


def measured(at: Poses, terrain: Terrain = FLAT, sensor: InterferometricAltimeter = EXACT) -> InterferometricReturns:
    return sensor.measure(terrain, at)


# ------------------------------------------------------------------------------------------------------------ geometry


def test_range_and_both_angles_give_the_point_back() -> None:
    """10^5 attitudes: roll 60, pitch 15, crab 20, climb 10 deg; points within 75 deg of straight down, to 1e-9 m."""
    rng, n = np.random.default_rng(4), 100000
    roll, pitch, crab, climb = np.radians([60.0, 15.0, 20.0, 10.0])[:, None] * rng.uniform(-1.0, 1.0, (4, n))
    mat_nb = mat_from_rpy(roll, pitch, crab)
    vel_n = np.stack((np.cos(climb), np.zeros(n), -np.sin(climb)), axis=-1)
    vel_s = SPEED * np.einsum("nji,nj->ni", mat_nb, vel_n)
    v = vel_s / SPEED
    down = np.cross(v, [0.0, 1.0, 0.0])
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    swing, ahead = np.radians(75.0) * rng.uniform(-1, 1, (n, 1)), np.radians(5.0) * rng.uniform(-1, 1, (n, 1))
    in_plane = np.cos(swing) * down + np.sin(swing) * np.cross(down, v)
    u = np.cos(ahead) * in_plane + np.sin(ahead) * v
    ranges = rng.uniform(100.0, 6000.0, (n, 1))
    slant, look = angles_from_direction(u, vel_s)
    assert np.abs(slant - ahead[:, 0]).max() < 1e-12
    back = ranges * direction_from_angles(slant, look, vel_s)
    assert np.abs(np.einsum("nij,nj->ni", mat_nb, back - ranges * u)).max() < 1e-9


def test_direction_is_that_of_the_effective_look_angle() -> None:
    """Oh 2019, eq. 11, 30-36 with the sign of the look angle corrected: the same point; as printed, its mirror."""
    at = poses([12.0, -30.0, 5.0], [3.0, -4.0, 8.0], [10.0, -15.0, 20.0], [2.0, 5.0, -6.0], course=50.0)
    look = np.radians([8.0, -20.0, 6.0])
    vel_s = np.einsum("nji,nj->ni", at.mats_ls, at.vels_l)
    here = np.einsum("nij,nj->ni", at.mats_ls, direction_from_angles(np.zeros(3), look, vel_s))
    v = at.vels_l / SPEED
    alpha, beta = np.arcsin(v[:, 2]), np.arctan2(v[:, 0], v[:, 1])
    first = np.stack((np.sin(alpha) * np.sin(beta), np.sin(alpha) * np.cos(beta), -np.cos(alpha)), axis=-1)
    second = np.stack((np.cos(beta), -np.sin(beta), np.zeros(3)), axis=-1)
    right = at.mats_ls[:, :, 1]  # X of the body in that paper
    t1, t2 = (right * first).sum(axis=1), (right * second).sum(axis=1)
    for sign, mirrored in ((1.0, False), (-1.0, True)):
        xi = np.arcsin(sign * np.sin(look) / np.hypot(t1, t2)) - np.arctan2(t1, t2)
        theirs = np.cos(xi)[:, None] * first + np.sin(xi)[:, None] * second
        assert (np.abs(theirs - here).max(axis=1) > 0.03).all() == mirrored
        assert mirrored or theirs == pytest.approx(here, abs=1e-14)
    for arctangent, up in ((np.arctan(t1 / t2), False), (np.arctan2(-t1, -t2), True)):  # 35 with t as printed: -t
        xi = np.arcsin(np.sin(look) / np.hypot(t1, t2)) - arctangent
        theirs = np.cos(xi)[:, None] * first + np.sin(xi)[:, None] * second
        assert ((theirs[:, 2] > 0.0) == up).all()
        assert up or theirs == pytest.approx(here, abs=1e-14)


def test_no_direction_where_there_is_none() -> None:
    ahead = np.array([SPEED, 0.0, 0.0])
    assert np.isnan(direction_from_angles(1.0, 1.0, ahead)).all()  # sin^2 + sin^2 > 1
    assert np.isnan(direction_from_angles(0.0, 0.1, np.zeros(3))).all()
    assert np.isnan(direction_from_angles(0.0, 0.1, [0.0, SPEED, 0.0])).all()
    backwards = direction_from_angles(0.1, 0.2, -ahead)  # a helicopter: still below
    assert backwards[2] > 0.9 and np.stack(angles_from_direction(backwards, -ahead)) == pytest.approx([0.1, 0.2])


@pytest.mark.parametrize("roll", [-25.0, 0.0, 15.0, 29.0])
@pytest.mark.parametrize(("pitch", "crab"), [(0.0, 0.0), (6.0, 0.0), (-4.0, 12.0)])
def test_over_flat_ground_the_nearest_point_is_straight_below(roll: float, pitch: float, crab: float) -> None:
    returns = measured(poses(roll, pitch, crab, course=70.0))
    assert returns.slant_range == pytest.approx(HEIGHT, abs=1e-6)  # h delta^2 / 2 with delta = 0.02 mrad
    assert returns.slant_angle == pytest.approx(0.0, abs=5e-5)
    expected = np.arcsin(np.sin(np.radians(roll)) * np.cos(np.radians(pitch)))
    assert returns.look_angle == pytest.approx(expected, abs=5e-5)


@pytest.mark.parametrize("roll", [40.0, -50.0])
def test_banked_beyond_the_field_of_view_its_edge_is_nearest(roll: float) -> None:
    returns = measured(poses(roll))
    assert returns.slant_range == pytest.approx(HEIGHT / np.cos(np.radians(abs(roll) - 30.0)), rel=1e-9)
    assert returns.look_angle == pytest.approx(np.sign(roll) * np.radians(30.0), abs=1e-9)


@pytest.mark.parametrize("climb", [2.0, -2.0, 7.0])
def test_in_a_climb_the_point_below_lies_behind_the_plane(climb: float) -> None:
    returns = measured(poses(0.0, 3.0, 0.0, climb))
    beyond = max(abs(climb) - 2.5, 0.0)
    assert returns.slant_range == pytest.approx(HEIGHT / np.cos(np.radians(beyond)), abs=1e-6)
    assert returns.slant_angle == pytest.approx(-np.sign(climb) * np.radians(min(abs(climb), 2.5)), abs=5e-5)


def test_plane_itself_is_a_strip_without_width() -> None:
    returns = measured(poses(10.0, 0.0, 5.0, 7.0), sensor=InterferometricAltimeter(swath_width=0.0))
    assert returns.slant_range == pytest.approx(HEIGHT / np.cos(np.radians(7.0)), abs=1e-6)
    assert abs(float(returns.slant_angle[0])) < 1e-15


@pytest.mark.parametrize("slope_deg", [8.0, -8.0])
def test_ground_that_rises_to_the_right_is_nearest_on_the_right(slope_deg: float) -> None:
    """Flying north over a slope to the east: the perpendicular.  Eq. 9 as printed cannot tell it from its mirror."""
    slope = np.radians(slope_deg)
    returns = measured(poses(), plane(slope_east=np.tan(slope)))
    assert returns.slant_range == pytest.approx(HEIGHT * np.cos(slope), abs=1e-6)
    assert returns.look_angle == pytest.approx(slope, abs=5e-5)
    rho = returns.slant_range[0] * returns.direction_s[0]
    printed = np.arccos(abs(rho[1]) / returns.slant_range[0])
    assert np.degrees(printed) == pytest.approx(82.0, abs=0.01)


def test_slant_angle_needs_both_vectors_in_one_frame() -> None:
    """Eq. 8 with the velocity as the navigation frame has it and the point as the body has it, heading east."""
    at = poses(10.0, 0.0, 0.0, 2.0, course=90.0)
    returns = measured(at)
    vel_n = MAT_ENU_NED @ at.vels_l[0]
    printed = 90.0 - np.degrees(np.arccos(vel_n @ returns.direction_s[0] / SPEED))
    assert np.degrees(returns.slant_angle) == pytest.approx(-2.0, abs=0.01)
    assert abs(printed + 2.0) > 5.0


def in_strip(at: Poses, k: int, points: Array) -> Array:
    """Ranges to those of the points (n, 3) that lie in the strip of one pose."""
    way = points - at.origins_l[k]
    ranges = np.linalg.norm(way, axis=1)
    slant, look = angles_from_direction((way / ranges[:, None]) @ at.mats_ls[k], at.mats_ls[k].T @ at.vels_l[k])
    return np.asarray(ranges[(np.abs(slant) <= np.radians(2.5)) & (np.abs(look) <= np.radians(30.0))])


def points_of(ground: Terrain, step: float, half: float = 1000.0) -> Array:
    east, north = np.meshgrid(np.arange(-half, half + 1.0, step), np.arange(-half, half + 1.0, step))
    return np.stack((east, north, ground.up(east, north)), axis=-1).reshape(-1, 3)


def test_nearest_point_of_rough_ground_is_nearer_than_any_point_of_a_grid() -> None:
    """Against points 8 m apart: none is nearer by more than the search leaves, 0.14 m.  Among posts all are longer."""
    relief = fractal_relief((41, 41), 100.0, np.random.default_rng(6), sd=40.0, max_size_m=4000.0, min_size_m=400.0)
    ground = Terrain.from_array(relief, 100.0, east0=-2000.0, north0=-2000.0)
    at = poses([5.0, -12.0, 0.0, 20.0], 2.0, [0.0, 8.0, -5.0, 3.0], course=30.0)
    returns = measured(at, ground)
    fine, posts = points_of(ground, 8.0), points_of(ground, 100.0)
    longer = np.array([in_strip(at, k, fine).min() for k in range(len(at))]) - returns.slant_range
    assert longer.min() > -0.15 and longer.max() < 1.0
    longer = np.array([in_strip(at, k, posts).min() for k in range(len(at))]) - returns.slant_range
    assert longer.min() > 0.0 and longer.max() > 1.0
    hits = at.origins_l + returns.slant_range[:, None] * np.einsum("nij,nj->ni", at.mats_ls, returns.direction_s)
    assert ground.up(hits[:, 0], hits[:, 1]) == pytest.approx(hits[:, 2], abs=1e-6)


def test_of_several_hollows_the_nearest_is_found_and_not_the_one_that_looks_so_on_the_grid() -> None:
    """2.5 km over broken ground: refining only the best of the grid leaves 6 to 9 m at these four of 150 poses."""
    rng, n = np.random.default_rng(6), 150
    relief = fractal_relief((41, 41), 100.0, rng, sd=60.0, max_size_m=1000.0, min_size_m=200.0, hurst=0.3)
    ground = Terrain.from_array(relief, 100.0, east0=-2000.0, north0=-2000.0)
    rng = np.random.default_rng(9)
    at = poses(rng.uniform(-25.0, 25.0, n), 2.0, rng.uniform(-8.0, 8.0, n), course=30.0)
    at.origins_l[:] = np.column_stack((rng.uniform(-700.0, 700.0, (n, 2)), np.full(n, 2500.0)))
    awkward = [66, 111, 44, 86]
    some = Poses(at.origins_l[awkward], at.mats_ls[awkward], at.vels_l[awkward])
    found, points = measured(some, ground).slant_range, points_of(ground, 10.0, 1990.0)
    longer = np.array([in_strip(some, k, points).min() for k in range(len(some))]) - found
    assert longer.min() > -0.15 and longer.max() < 2.0


# --------------------------------------------------------------------------------------------------------------- noise


def test_noise_of_table_iii_comes_back(scale: int) -> None:
    n = 250 * scale
    at, limit = poses(np.full(n, 10.0)), 3.3 / np.sqrt(2 * n)
    found = EXACT.measure(FLAT, at, np.random.default_rng(5))
    for value, true, sd in (
        (found.slant_range, HEIGHT, 4.54),
        (found.slant_angle, 0.0, 0.0013),
        (found.look_angle, np.radians(10.0), 3.60e-4),
    ):
        assert value.std() == pytest.approx(sd, rel=limit)
        assert value.mean() == pytest.approx(true, abs=3.3 * sd / np.sqrt(n) + 5e-5)
    again = direction_from_angles(found.slant_angle, found.look_angle, np.array([SPEED, 0.0, 0.0]))
    assert np.abs(again - found.direction_s).max() < 1e-12


def body_errors(slant: Array, look: Array, ranges: Array, true: Array) -> Array:
    return ranges[:, None] * direction_from_angles(slant, look, np.array([SPEED, 0.0, 0.0])) - true


def test_spread_in_the_body_frame_is_reproduced_one_way_only() -> None:
    """3.40, 0.40, 4.61 m give table III; table III, drawn independently, gives 1.2 m instead of 0.40 m."""
    rng, n = np.random.default_rng(6), 40000
    look = np.radians(10.3) * rng.standard_normal(n)
    ahead = np.array([SPEED, 0.0, 0.0])
    true = 2550.0 * direction_from_angles(np.zeros(n), look, ahead)
    moved = true + rng.standard_normal((n, 3)) * [3.40, 0.40, 4.61]
    ranges = np.linalg.norm(moved, axis=1)
    slant, measured_look = angles_from_direction(moved / ranges[:, None], ahead)
    assert ranges.std() == pytest.approx(4.54, rel=0.02)
    assert slant.std() == pytest.approx(0.0013, rel=0.04)
    assert (measured_look - look).std() == pytest.approx(3.60e-4, rel=0.04)
    to_right = look > 0
    assert np.corrcoef((ranges - 2550.0)[to_right], (measured_look - look)[to_right])[0, 1] == pytest.approx(
        -0.7, abs=0.15
    )
    noise = rng.standard_normal((3, n)) * [[0.0013], [3.60e-4], [4.54]]
    spread = body_errors(noise[0], look + noise[1], 2550.0 + noise[2], true).std(axis=0)
    assert spread == pytest.approx([3.32, 1.2, 4.47], rel=0.03)


def test_same_generator_same_bytes() -> None:
    at = poses([0.0, 10.0])
    first, again = (EXACT.measure(FLAT, at, np.random.default_rng(1)).look_angle.tobytes() for _ in range(2))
    assert first == again


# ------------------------------------------------------------------------------------------------------------ validity


def test_three_antennas_say_the_look_angle_or_that_they_cannot() -> None:
    at = poses([3.0, -14.0])
    good = measured(at, sensor=InterferometricAltimeter(baselines=Baselines(0.07, 0.15, 0.35)))
    assert good.look_angle == pytest.approx(np.radians([3.0, -14.0]), abs=5e-5) and good.valid.all()
    equal = measured(at, sensor=InterferometricAltimeter(baselines=Baselines(0.07, 0.25, 0.25)))
    assert (equal.validity == Validity.AMBIGUOUS).all()
    assert np.isnan(equal.slant_range).all() and np.isnan(equal.direction_s).all() and np.isnan(equal.look_angle).all()


def test_without_a_velocity_there_is_no_plane() -> None:
    at = poses([0.0, 0.0])
    still = Poses.stationary(at.origins_l, at.mats_ls)
    assert (measured(still).validity == Validity.UNKNOWN).all() and np.isnan(measured(still).slant_range).all()
    at.vels_l[1] = [SPEED, 0.0, 0.0]  # to the right, along the antennas
    assert measured(at).validity.tolist() == [Validity.VALID, Validity.UNKNOWN]
    at.vels_l[1] = [0.0, 0.0, -5.0]  # straight down: the plane is level, and nothing in it is below
    assert measured(at).validity.tolist() == [Validity.VALID, Validity.UNKNOWN]
    assert np.isnan(direction_from_angles(0.1, 0.2, [0.0, 0.0, 5.0])).all()


def test_noise_makes_no_negative_range() -> None:
    at = poses(np.zeros(60))
    at.origins_l[:, 2] = 3.0
    returns = InterferometricAltimeter(rays=(2, 3)).measure(FLAT, at, np.random.default_rng(2))
    assert 0.1 < (returns.validity == Validity.TOO_NEAR).mean() < 0.45  # of 4.54 m a quarter is below -3 m
    assert returns.valid.any() and returns.slant_range[returns.valid].min() >= 0.0
    assert np.isnan(returns.slant_range[~returns.valid]).all()


def test_antennas_that_cannot_tell_the_whole_field_of_view_are_refused() -> None:
    """With equal baselines and a limit of 7 deg a point at 12 deg would be told at -4.1 deg, and believed."""
    narrow = Baselines(0.07, 0.25, 0.25, look_limit=np.radians(7.0))
    sine = np.sin(np.radians(12.0)) - 0.07 / 0.25
    assert narrow.resolve(narrow.phases(np.radians(12.0)))[0] == pytest.approx(np.arcsin(sine), abs=1e-9)
    with pytest.raises(ValueError, match="look_limit"):
        InterferometricAltimeter(baselines=narrow)
    fits = InterferometricAltimeter(field_of_view=np.radians(14.0), baselines=narrow)
    assert measured(poses(5.0), sensor=fits).look_angle == pytest.approx(np.radians(5.0), abs=5e-5)
    noisy = Baselines(0.07, 0.25, 0.25, phase_sd=0.01, look_limit=np.radians(7.0))
    with pytest.raises(ValueError, match="look_limit"):
        InterferometricAltimeter(field_of_view=np.radians(14.0), baselines=noisy)


def test_beyond_its_range_there_is_no_return() -> None:
    at = poses([0.0, 0.0])
    at.origins_l[1, 2] = 900.0
    returns = measured(at, sensor=InterferometricAltimeter(max_range=950.0))
    assert returns.validity.tolist() == [Validity.NO_RETURN, Validity.VALID]


def test_ground_that_nobody_knows_within_the_range_is_no_measurement() -> None:
    """A hole in the strip, or the edge of the coverage; an edge farther away than the nearest point does not matter."""
    at = poses(np.zeros(5))
    at.origins_l[0, 0] = 200.0  # over the hole
    at.origins_l[1, 1] = 1000.0  # its strip runs north of the hole
    at.origins_l[2, 0] = 5000.0  # outside
    at.origins_l[3, :2] = -1600.0, 1000.0  # a ray 30 deg to the left leaves the coverage after 800 m
    at.origins_l[4, :2] = -1495.0, 1000.0  # after 1010 m
    returns = measured(at, plane(hole=True))
    reasons = [Validity.HOLE, Validity.VALID, Validity.OUTSIDE, Validity.OUTSIDE, Validity.VALID]
    assert returns.validity.tolist() == reasons
    assert returns.slant_range[[1, 4]] == pytest.approx(HEIGHT, abs=1e-6)


def test_many_poses_are_measured_like_each_alone_and_none_like_nothing() -> None:
    narrow = InterferometricAltimeter(rays=(2, 3))
    at = poses(np.linspace(-20.0, 20.0, 203))
    together = measured(at, sensor=narrow)
    for k in (0, 199, 200, 202):
        alone = measured(Poses(at.origins_l[[k]], at.mats_ls[[k]], at.vels_l[[k]]), sensor=narrow)
        assert alone.slant_range[0] == together.slant_range[k] and alone.look_angle[0] == together.look_angle[k]
    none = Poses(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)))
    assert measured(none).slant_range.shape == (0,) and measured(none).direction_s.shape == (0, 3)


def test_a_pose_underground_or_nowhere_has_its_reason() -> None:
    at = poses([0.0, 0.0])
    at.origins_l[:, 2] = -500.0, np.nan
    returns = measured(at)
    assert returns.validity.tolist() == [Validity.BURIED, Validity.UNKNOWN] and np.isnan(returns.slant_range).all()


def test_wrong_figures_are_refused() -> None:
    for bad in (
        {"swath_width": -0.1},
        {"field_of_view": 0.0},
        {"range_sd": -1.0},
        {"look_angle_sd": np.nan},
        {"max_range": 0.0},
        {"rays": (1, 61)},
    ):
        with pytest.raises(ValueError, match=next(iter(bad))):
            InterferometricAltimeter(**bad)
