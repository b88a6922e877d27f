"""Frames and signs of what Foxglove's map and 3D panels show.  Oracles: pyproj, scipy and plain directions."""

from __future__ import annotations

import json
import math
from typing import Any

import jsonschema
import numpy as np
import pyproj
import pytest
from scipy.spatial.transform import Rotation

from fti.logger.schemas import foxglove_schema
from fti.publish.foxglove_scene import MAX_TRACK_POINTS, SCENE_SCHEMAS, Scene
from tests.publish.bus_messages import solution
from tests.publish.solutions import LON_DEG, T_NS

SECOND_NS = 1_000_000_000


def scene_of(*solutions: Any) -> dict[str, Any]:
    """The messages of the last solution."""
    scene = Scene()
    for each in solutions:
        messages = dict(scene.messages(each))
    return messages


def axes_of(messages: dict[str, Any]) -> np.ndarray[Any, Any]:
    """Columns: forward, left and up of the aircraft in east, north, up."""
    q = messages["/nav/transform"]["rotation"]
    return np.asarray(Rotation.from_quat([q["x"], q["y"], q["z"], q["w"]]).as_matrix())


def test_every_message_fits_its_schema() -> None:
    messages = scene_of(solution(), solution(T_NS + 3 * SECOND_NS, lat=0.9))
    assert messages.keys() == SCENE_SCHEMAS.keys()
    for topic, message in messages.items():
        jsonschema.validate(message, json.loads(foxglove_schema(SCENE_SCHEMAS[topic]).data))
    assert messages["/nav/pose"]["pose"]["orientation"] == messages["/nav/transform"]["rotation"]
    assert messages["/nav/transform"]["child_frame_id"] == messages["/nav/location"]["frame_id"] == "p"


def test_a_fix_has_heading_and_velocity_east_north_up() -> None:
    fix = scene_of(solution())["/nav/location"]
    assert fix["heading"] == pytest.approx(math.pi / 2)
    assert fix["velocity"] == pytest.approx({"x": 50.0, "y": 86.60254, "z": 2.0})
    without = scene_of(solution(attitude_valid=False))["/nav/location"]
    assert "heading" not in without and "velocity" in without


@pytest.mark.parametrize(
    ("attitude", "forward", "left", "up"),
    [
        ({"roll": 0.0, "pitch": 0.0, "heading": 0.0}, (0, 1, 0), (-1, 0, 0), (0, 0, 1)),
        ({"roll": 0.0, "pitch": 0.0, "heading": math.pi / 2}, (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ({"roll": 0.0, "pitch": math.pi / 6, "heading": 0.0}, (0, 3**0.5 / 2, 0.5), (-1, 0, 0), (0, -0.5, 3**0.5 / 2)),
        ({"roll": math.pi / 6, "pitch": 0.0, "heading": 0.0}, (0, 1, 0), (-(3**0.5) / 2, 0, 0.5), (0.5, 0, 3**0.5 / 2)),
    ],
    ids=["north", "east", "nose up", "right wing down"],
)
def test_signs_of_the_attitude(attitude: dict[str, Any], forward: Any, left: Any, up: Any) -> None:
    axes = axes_of(scene_of(solution(**attitude)))
    np.testing.assert_allclose(axes.T, [forward, left, up], atol=1e-12)


def test_any_attitude_and_place_agree_with_pyproj_and_scipy() -> None:
    """Far from the origin the axes of the map are not north and down there: some degrees at 400 km."""
    first = solution()
    far = solution(lat=math.radians(52.8), lon=math.radians(11.0), alt=900.0, roll=-0.3, pitch=0.2, heading=4.0)
    messages = scene_of(first, far)
    assert first.lat and first.lon and first.alt and far.lat and far.lon and far.alt
    to_map = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
        f"+lat_0={math.degrees(first.lat)} +lon_0={math.degrees(first.lon)} +h_0={first.alt}"
    )
    position = messages["/nav/pose"]["pose"]["position"]
    expected = to_map.transform(math.degrees(far.lon), math.degrees(far.lat), far.alt)
    np.testing.assert_allclose([position[axis] for axis in "xyz"], expected, atol=1e-3)
    body = Rotation.from_euler("ZYX", [4.0, 0.2, -0.3]).as_matrix()  # forward, right, down in north, east, down
    steps = np.eye(3) @ body.T  # 1 m along each body axis, north, east, down there
    ecef = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978")
    here = np.array(ecef.transform(math.degrees(far.lat), math.degrees(far.lon), far.alt))
    sl, cl, so, co = math.sin(far.lat), math.cos(far.lat), math.sin(far.lon), math.cos(far.lon)
    north, east, down = (
        np.array([-sl * co, -sl * so, cl]),
        np.array([-so, co, 0.0]),
        np.array([-cl * co, -cl * so, -sl]),
    )
    back = pyproj.Transformer.from_crs("EPSG:4978", "EPSG:4979")
    for axis, step, sign in zip(axes_of(messages).T, steps, (1, -1, -1), strict=True):
        lat, lon, alt = back.transform(*(here + 1000.0 * sign * (step[0] * north + step[1] * east + step[2] * down)))
        end = to_map.transform(lon, lat, alt)
        np.testing.assert_allclose((np.array(end) - expected) / 1000.0, axis, atol=1e-6)


def test_pose_needs_a_valid_attitude_and_all_a_valid_position() -> None:
    assert scene_of(solution(), solution(T_NS + 1, attitude_valid=False)).keys() == {"/nav/location"}
    assert scene_of(solution(), solution(T_NS + 1, valid=False)).keys() == set()


def test_a_track_has_a_gap_where_the_position_was_invalid() -> None:
    flight = [solution(T_NS + i * SECOND_NS, lat=0.9 + i * 1e-4, valid=not 4 <= i < 7) for i in range(11)]
    geometry = json.loads(scene_of(*flight)["/nav/track"]["geojson"])["geometry"]
    assert geometry["type"] == "MultiLineString"
    assert [len(line) for line in geometry["coordinates"]] == [4, 4]
    assert geometry["coordinates"][0][1] == [
        pytest.approx(LON_DEG, abs=1e-6),
        pytest.approx(math.degrees(0.9001), abs=1e-6),
    ]


def test_a_long_track_keeps_its_begin_and_stays_short() -> None:
    scene, longest = Scene(), 0
    for i in range(5000):
        messages = dict(scene.messages(solution(T_NS + i * SECOND_NS, lat=0.9 + i * 1e-6)))
        if "/nav/track" in messages:
            (line,) = json.loads(messages["/nav/track"]["geojson"])["geometry"]["coordinates"] or [[]]
            longest = max(longest, len(line))
    assert MAX_TRACK_POINTS / 2 < longest <= MAX_TRACK_POINTS
    assert line[0][1] == pytest.approx(math.degrees(0.9), abs=1e-6)
    assert line[-1][1] == pytest.approx(math.degrees(0.9 + 4999e-6), abs=1e-3)
