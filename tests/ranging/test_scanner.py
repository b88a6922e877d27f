from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.error_model import RangeError
from fti.ranging.imager import RangeImager
from fti.ranging.laser import Laser
from fti.ranging.scanner import RangeScanner, max_pulse_rate, points_l, time_to_overlap
from fti.ranging.sensor import Poses, Validity
from fti.terrain.terrain import Terrain
from tests.planes import count_casts, looking_down, plane, to_plane

Array = NDArray[np.float64]

FLAT = plane()
SCANNER = RangeScanner()
#: 81 measurements in 80 deg, and half of each facet's sweep is dead time.
EVEN = RangeScanner(
    pulse_rate=9600.0, line_rate=np.radians(1.0) * 9600.0 / np.pi, field_of_view=np.radians(80.0), facets=4
)


def rough(seed: int = 3) -> Terrain:
    heights = np.random.default_rng(seed).normal(0.0, 8.0, (401, 401))
    return Terrain.from_array(heights, 5.0, east0=-1000.0, north0=-1000.0)


def flight_poses(t: Array) -> Poses:
    """60 m/s to the north, rolling, pitching and turning."""
    mats = MAT_ENU_NED @ mat_from_rpy(0.3 * np.sin(2.0 * t), 0.1 * np.sin(t), 0.2 * t)
    origins = np.stack((5.0 * np.sin(t), 60.0 * t, 300.0 + 5.0 * np.cos(t)), axis=-1)
    vels = np.stack((5.0 * np.cos(t), np.full_like(t, 60.0), -5.0 * np.sin(t)), axis=-1)
    return Poses(origins, mats, vels)


# -------------------------------------------------------------------------------------------------------------- rates


def test_a_pulse_must_be_back_before_the_next_one_leaves() -> None:
    """Eq. 2.36: 150 kHz at 1000 m, 149.896 kHz to be exact; and just above it is refused."""
    assert f"{max_pulse_rate(1000.0):.0f}" == "149896" and round(max_pulse_rate(1000.0), -3) == 150_000.0
    assert RangeScanner(pulse_rate=149_896.0).pulse_rate == 149_896.0
    with pytest.raises(ValueError, match="<= 149896"):
        RangeScanner(pulse_rate=150_000.0)
    with pytest.raises(ValueError, match="<= 67036"):  # a white surface is seen from 2236 m
        RangeScanner(Laser(1000.0, reflectance=0.2), pulse_rate=100_000.0)


def test_angle_step_without_dead_time_is_that_of_the_source() -> None:
    """Eq. 5.1: alpha n_l / f_s, when the field of view is all that a facet sweeps: 80 deg, 9 facets."""
    whole = RangeScanner(facets=9)
    assert whole.angle_step == pytest.approx(np.radians(80.0) * 50.0 / 10_000.0, rel=1e-12)
    assert len(whole.angles) in (199, 200, 201)


@pytest.mark.parametrize(("height", "speed", "pitch"), [(100.0, 60.0, 0.0), (400.0, 80.0, 0.35)])
def test_square_grid_needs_the_line_rate_of_the_source(height: float, speed: float, pitch: float) -> None:
    """Eq. 5.5 for a facet without dead time, and both distances are equal then."""
    whole = RangeScanner(facets=9)
    expected = np.sqrt(10_000.0 * speed * np.cos(pitch) / (2.0 * np.tan(np.radians(40.0)) * height))
    value = float(whole.square_line_rate(height, speed, pitch))
    assert value == pytest.approx(expected, rel=1e-12)
    square = RangeScanner(facets=9, line_rate=value)
    assert square.in_line_distance(height, pitch) == pytest.approx(square.line_distance(speed))


def test_two_lines_overlap_after_the_distance_of_their_boresights() -> None:
    """Fig. 5.6: 20 deg ahead and straight down; the boresights meet level ground 109.2 m apart from 300 m."""
    meets = []
    for pitch in (np.radians(20.0), 0.0):
        boresight = mat_from_rpy(0.0, pitch, 0.0)[:, 2]  # north, east, down
        meets.append(300.0 * boresight[0] / boresight[2])
    assert meets[0] - meets[1] == pytest.approx(109.19, abs=0.01)
    found = float(time_to_overlap(300.0, 170.0, (np.radians(20.0), 0.0)))
    assert found == pytest.approx((meets[0] - meets[1]) / 170.0, rel=1e-12)
    assert float(time_to_overlap(300.0, 170.0, (0.0, np.radians(20.0)))) == -found


@pytest.mark.parametrize(
    ("bad", "what"),
    [
        ({"pulse_rate": 0.0}, "pulse_rate"),
        ({"line_rate": np.nan}, "line_rate"),
        ({"facets": 2}, "facets"),
        ({"facets": 8.5}, "facets"),
        ({"facets": 10}, "field_of_view"),
        ({"field_of_view": 0.0}, "field_of_view"),
        ({"line_rate": 9000.0}, "lines without a pulse"),
    ],
)
def test_impossible_scanners_are_refused(bad: dict[str, Any], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        RangeScanner(**bad)


# ----------------------------------------------------------------------------------------------------------- footprint


def test_line_over_level_ground() -> None:
    """Height over the cosine, neighbours h da / cos^2 apart, and their mean as eq. 5.2 with the dead time."""
    found = EVEN.measure(FLAT, looking_down(250.0))
    angles = EVEN.angles
    assert angles[[0, 40, -1]] == pytest.approx(np.radians([-40.0, 0.0, 40.0]), abs=1e-12) and len(angles) == 81
    assert found.slant_range[0] == pytest.approx(250.0 / np.cos(angles), rel=1e-9)
    across = points_l(looking_down(250.0), found)[0, :, 0]  # heading north: right is east
    apart = np.diff(across)
    assert apart.mean() == pytest.approx(float(EVEN.in_line_distance(250.0)), rel=1e-9)
    between = 0.5 * (angles[1:] + angles[:-1])
    assert apart == pytest.approx(250.0 * EVEN.angle_step / np.cos(between) ** 2, rel=1e-3)


def test_a_pitched_scanner_spreads_its_line() -> None:
    """Eq. 5.2: 1 / cos of the mounting's pitch."""
    at = looking_down(250.0, pitch=0.4)
    across = points_l(at, EVEN.measure(FLAT, at))[0, :, 0]
    assert np.diff(across).mean() == pytest.approx(float(EVEN.in_line_distance(250.0, 0.4)), rel=1e-9)


def test_lines_follow_each_other() -> None:
    """Eq. 5.3: v / n_l along the track, measured between the middles of lines; half of the time is dead."""
    scanner = RangeScanner(pulse_rate=10_000.0, line_rate=40.0, facets=8, field_of_view=np.radians(45.0))
    at = looking_down([200.0, 200.0], speed=60.0)
    at.origins_l[1, 1] += 60.0
    scan = scanner.scan(FLAT, [0.0, 1.0], at)
    assert len(scan.times) == pytest.approx(10_000 / 2, abs=41)
    nadir = np.abs(scan.returns.direction_s[:, 1]) < 1e-9
    north = scan.points_l()[nadir, 1]
    assert len(north) == 40 and np.diff(north) == pytest.approx(np.full(39, scanner.line_distance(60.0)), rel=1e-9)
    steps = np.diff(scan.times)
    assert np.sort(np.unique(np.round(steps * 1e4))).tolist() == [1.0, 126.0]  # within a line, and across the dead time


@pytest.mark.parametrize(("slope_east", "slope_north"), [(0.2, -0.1), (-0.3, 0.4)])
def test_a_slope_has_the_closed_form(slope_east: float, slope_north: float) -> None:
    t = np.linspace(0.0, 1.0, 51)
    found = SCANNER.scan(plane(slope_east, slope_north), t, flight_poses(t))
    rays = (found.poses.mats_ls @ found.returns.direction_s[..., None])[..., 0]
    expected = to_plane(found.poses.origins_l, rays, slope_east, slope_north)
    assert len(found.times) > 8000 and np.abs(found.returns.slant_range / expected - 1.0).max() < 1e-9


# ------------------------------------------------------------------------------------------------------- georeferencing


def test_points_lie_on_the_terrain_when_the_poses_are_exact() -> None:
    """1e-6 m, on rough ground, first and last returns."""
    t = np.linspace(0.0, 1.0, 101)
    ground = rough()
    at = flight_poses(t)
    points = points_l(at, SCANNER.measure(ground, at))
    assert points.shape == (101, len(SCANNER.angles), 3)
    assert np.abs(points[..., 2] - ground.up(points[..., 0], points[..., 1])).max() < 1e-6
    both = RangeScanner(Laser(1000.0, returns="both")).scan(ground, t, at)
    assert both.points_l().shape == (len(both.times), 2, 3)
    assert np.abs(both.points_l()[..., 2] - ground.up(*np.moveaxis(both.points_l()[..., :2], -1, 0))).max() < 1e-6


def test_interpolated_poses_put_points_where_the_flight_was() -> None:
    """Navigation at 50 Hz, 1.2 rad/s^2 of roll and up to 470 m of range: the bound of the slerp is 60 urad, 28 mm."""
    t = np.linspace(0.0, 2.0, 101)
    found = SCANNER.scan(FLAT, t, flight_poses(t))
    exact = flight_poses(found.times)
    assert np.abs(found.poses.origins_l - exact.origins_l).max() < 1e-8  # a line would be 0.25 mm off
    moved = found.poses.origins_l + (found.poses.mats_ls @ (found.returns.direction_s * 470.0)[..., None])[..., 0]
    true = exact.origins_l + (exact.mats_ls @ (found.returns.direction_s * 470.0)[..., None])[..., 0]
    error = np.linalg.norm(moved - true, axis=1)
    assert 0.005 < error.max() < 1.2 * 0.02**2 / 8 * 470.0 * 1.1


def test_nothing_is_measured_where_navigation_is_lost() -> None:
    t = np.linspace(0.0, 1.0, 11)
    lost = flight_poses(t)
    lost.origins_l[5] = np.nan
    found = SCANNER.scan(FLAT, t, lost)
    hidden = (found.times > 0.4) & (found.times < 0.6)
    assert (found.returns.validity[hidden] == Validity.UNKNOWN).all() and found.returns.valid[~hidden].all()


def test_the_last_pulse_is_measured_whatever_the_rounding() -> None:
    """Ten times 0.02 s is a little less than 0.2 s; the pulse that leaves then is the last, not one beyond."""
    t = np.array([0.0, *np.cumsum(np.full(10, 0.02))])
    scan = RangeScanner(pulse_rate=50_000.0, line_rate=52.5, facets=9).scan(FLAT, t, flight_poses(t))
    assert scan.times[-1] == t[-1] < 0.2 and scan.returns.valid.all()


def test_the_same_generator_gives_the_same_scan() -> None:
    t = np.linspace(0.0, 0.5, 6)
    noisy = RangeScanner(Laser(1000.0, error=RangeError(noise_sd=0.02)))
    one, same, other = (
        noisy.scan(FLAT, t, flight_poses(t), np.random.default_rng(k)).returns.slant_range for k in (1, 1, 2)
    )
    assert one.tobytes() == same.tobytes() != other.tobytes()
    exact = noisy.scan(FLAT, t, flight_poses(t)).returns.slant_range
    assert (one - exact).std() == pytest.approx(0.02, rel=0.1)


@pytest.mark.parametrize("times", [[], [0.0]])
def test_a_scan_goes_on_between_two_epochs(times: list[float]) -> None:
    with pytest.raises(ValueError, match=f"a scan has {len(times)} epochs"):
        RangeScanner().scan(FLAT, times, flight_poses(np.array(times)))


def test_each_measure_casts_all_its_rays_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """No loop over rays: one call of the ray caster for a scan, a set of lines, a matrix, and a footprint."""
    called = count_casts(monkeypatch)
    t, wide = np.linspace(0.0, 1.0, 11), Laser(1000.0, divergence=1e-3, returns="both")
    scan = RangeScanner(wide).scan(FLAT, t, flight_poses(t))
    SCANNER.measure(FLAT, flight_poses(t))
    RangeImager(pixels=(7, 5)).measure(FLAT, flight_poses(t))
    assert called == [19 * len(scan.times), 11 * len(SCANNER.angles), 11 * 35]
