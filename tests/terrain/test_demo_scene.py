import hashlib
import tomllib

import numpy as np
import pytest

from fti.ranging.nearest import NearestReturn
from fti.ranging.sensor import sensor_poses
from fti.terrain.demo_scene import DEMO_AIRFIELD, demo_scene, track_point
from fti.terrain.grid import load_jacksboro
from fti.terrain.synthetic import with_obstacle
from fti.terrain.terrain import Terrain

AIRFIELD = tomllib.loads(DEMO_AIRFIELD.read_text(encoding="utf-8"))
COURSE = np.radians(AIRFIELD["course_deg"])
GLIDE = np.radians(AIRFIELD["glide_deg"])
TCH = AIRFIELD["tch_m"]


@pytest.fixture(scope="module")
def scene() -> Terrain:
    return demo_scene()


def path_up(before: np.ndarray) -> np.ndarray:
    """The glide path in the frame of the scene, where it is straight."""
    return np.asarray(TCH + before * np.tan(GLIDE))


def profile(scene: Terrain, before: np.ndarray, right: float = 0.0) -> np.ndarray:
    """The ground as the radar altimeter sees it from the glide path, or as much to the right of it [m]."""
    east, north = track_point(before, right)
    up = path_up(before)
    place = scene.frame.to_geodetic(np.stack((east, north, up), axis=-1))
    poses = sensor_poses(scene.frame, place, (0.0, 0.0, COURSE))
    return np.asarray(up - NearestReturn().measure(scene, poses).slant_range)


def test_same_seed_same_bytes_another_seed_another_surface(scene: Terrain) -> None:
    digest = hashlib.sha256(scene.finest.heights.tobytes()).hexdigest()
    assert hashlib.sha256(demo_scene.__wrapped__().finest.heights.tobytes()).hexdigest() == digest
    assert np.abs(demo_scene(seed=7).finest.heights - scene.finest.heights).max() > 10


def test_covers_the_approach(scene: Terrain) -> None:
    for right in (-1000.0, 0.0, 1000.0):
        assert np.isfinite(scene.up(*track_point(np.arange(-1700.0, 7500.0, 50.0), right))).all()


def test_course_and_side_are_true(scene: Terrain) -> None:
    """A point on the track lies on the reciprocal of the course from the threshold; right is right."""
    east, north = track_point(3000.0)
    assert np.arctan2(-east, -north) % (2 * np.pi) == pytest.approx(COURSE)
    east_r, north_r = track_point(3000.0, 100.0)
    assert np.arctan2(east_r - east, north_r - north) % (2 * np.pi) == pytest.approx((COURSE + np.pi / 2) % (2 * np.pi))
    lat, lon, _ = scene.frame.to_geodetic([0.0, 0.0, 0.0])
    assert np.degrees(lat) == pytest.approx(AIRFIELD["threshold_lat_deg"])
    assert np.degrees(lon) == pytest.approx(AIRFIELD["threshold_lon_deg"])


def test_runway_is_level_at_the_height_of_the_threshold(scene: Terrain) -> None:
    along, across = np.meshgrid(np.linspace(0, AIRFIELD["runway_length_m"], 241), np.linspace(-60, 60, 25))
    lat, lon, _ = scene.frame.to_geodetic(np.stack((*track_point(-along, across), np.zeros_like(along)), axis=-1))
    expected = AIRFIELD["threshold_alt_m"] + AIRFIELD["runway_slope"] * along
    assert np.abs(scene.height(lat, lon) - expected).max() < 0.005


def test_glide_path_is_clear(scene: Terrain) -> None:
    before, right = np.meshgrid(np.arange(-600.0, 7000.0, 2.5), np.arange(-150.0, 151.0, 5.0))
    clearance = path_up(before) - scene.up(*track_point(before, right))
    assert clearance[before >= 1500].min() >= 60
    assert clearance[before >= 0].min() >= TCH - 0.01  # nowhere closer than over the threshold
    landing = np.arange(-290.0, 0.0, 2.5)
    assert (path_up(landing) - scene.up(*track_point(landing))).min() > 0.0


def test_radar_altimeter_is_in_range_all_the_way(scene: Terrain) -> None:
    before = np.arange(0.0, 6500.0, 10.0)
    height = path_up(before) - profile(scene, before)
    assert np.isfinite(height).all() and height.max() < 305  # below 1000 ft its steps are 20 ft and finer


def windows_of(values: np.ndarray) -> np.ndarray:
    """400 m windows, every 50 m."""
    return np.lib.stride_tricks.sliding_window_view(values, 80)[::10]


def test_along_track_shift_is_observable(scene: Terrain) -> None:
    """In 400 m windows the profile differs from itself 50 m on by metres, once the mean is removed."""
    ground = profile(scene, np.arange(6500.0, 0.0, -5.0))
    sd = windows_of(ground[10:] - ground[:-10]).std(axis=1)
    assert np.median(sd) > 7.0 and sd.min() > 4.0
    assert np.median(windows_of(ground).std(axis=1)) > 8.0


def test_what_crosses_the_track_is_the_same_15_m_beside_it(scene: Terrain) -> None:
    """15 m of track change the profile much less than 50 m along it; 100 m make it another one."""
    before = np.arange(5300.0, 250.0, -5.0)
    ground = profile(scene, before)
    along = windows_of(ground[10:] - ground[:-10]).std(axis=1)
    for right in (-15.0, 15.0):
        across = windows_of((profile(scene, before, right) - ground)[10:]).std(axis=1)
        assert (across < 0.5 * along).all() and np.median(across) < 2.0
    for right in (-100.0, 100.0):
        assert np.median(windows_of(profile(scene, before, right) - ground).std(axis=1)) > 5.0


def test_nothing_repeats_within_the_shifts_that_are_tried(scene: Terrain) -> None:
    """No shift from 50 to 200 m makes a window look like itself."""
    ground = profile(scene, np.arange(5300.0, 250.0, -5.0))
    for lag in range(10, 41):
        assert windows_of(ground[lag:] - ground[:-lag]).std(axis=1).min() > 3.0, lag * 5


def test_trees_are_lower_near_the_runway(scene: Terrain) -> None:
    """Under the approach nothing stands above 2 % from 60 m before the threshold, where path - 65 m is lower."""
    before, right = np.meshgrid(np.arange(60.0, 1400.0, 2.5), np.arange(-140.0, 141.0, 5.0))
    assert (scene.up(*track_point(before, right)) <= np.maximum(0.02 * (before - 60.0), 0.0) + 0.11).all()


def test_low_over_the_last_300_m_the_seen_height_is_the_true_one(scene: Terrain) -> None:
    """No edge of a wood beside the track is nearer than the ground below."""
    before = np.arange(400.0, -290.0, -5.0)
    for right in (-10.0, 0.0, 10.0):
        height = path_up(before) - profile(scene, before, right)
        true = path_up(before) - scene.up(*track_point(before, right))
        low = height < 25.0
        assert low.sum() > 60 and np.abs(height - true)[low].max() < 1.5


def test_real_elevation_is_under_it(scene: Terrain) -> None:
    before, right = np.meshgrid(np.arange(400.0, 7300.0, 40.0), np.arange(-900.0, 901.0, 40.0))
    east, north = track_point(before, right)
    lat, lon, alt = scene.frame.to_geodetic(np.stack((east, north, scene.up(east, north)), axis=-1))
    added = alt - load_jacksboro().height(lat, lon)
    assert abs(np.median(added)) < 5 and np.percentile(added, 1) > -12 and np.percentile(added, 99) < 35
    assert 0.25 < (added > 8.0).mean() < 0.6  # trees and houses


def test_obstacle_stands_where_it_was_put(scene: Terrain) -> None:
    east, north = track_point(3000.0)
    with_it = with_obstacle(scene, float(east), float(north), 150.0, 40.0)
    assert with_it.up(east, north) == pytest.approx(scene.up(east, north) + 150.0)
    changed = np.argwhere(with_it.finest.heights != scene.finest.heights)
    assert 49 <= len(changed) <= 81
    assert np.ptp(changed, axis=0).max() * scene.finest.cell_m <= 40.0
    before = np.arange(2500.0, 3500.0, 10.0)
    raised = profile(with_it, before) - profile(scene, before)
    assert raised.max() > 100 and raised.min() > -0.3 and (raised[np.abs(before - 3000) > 200] < 1e-6).all()


def test_obstacle_elsewhere_or_too_thin_is_refused(scene: Terrain) -> None:
    with pytest.raises(ValueError, match="outside the terrain"):
        with_obstacle(scene, 9e4, 0.0, 100.0, 20.0)
    with pytest.raises(ValueError, match="covers no post"):
        with_obstacle(scene, 2.5, 2.5, 100.0, 1.0)
