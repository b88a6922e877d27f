"""What Foxglove's map and 3D panels show: position, pose, and track of the aircraft, from the navigation solution.

Only a valid solution gives them; pose and transform need a valid attitude as well.

Frames, both right-handed as Foxglove has them:

    map   east, north, up [m] in the tangent plane at the first valid position; up is no height far from there
    p     at point P of the aircraft: x forward, y left, z up.  Body axes of fti are forward, right, down
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator

from fti.geodesy import formulas
from fti.geodesy.formulas import Vector
from fti.logger import foxglove
from fti.logger.foxglove import Json
from fti.messages.outputs import NavSolution
from fti.messages.topics import LOCATION_TOPIC

MAP_FRAME, BODY_FRAME = "map", "p"
POSE_TOPIC, TRANSFORM_TOPIC, TRACK_TOPIC = "/nav/pose", "/nav/transform", "/nav/track"
#: Topic -> name of its Foxglove schema.
SCENE_SCHEMAS = {
    LOCATION_TOPIC: "LocationFix",
    POSE_TOPIC: "PoseInFrame",
    TRANSFORM_TOPIC: "FrameTransform",
    TRACK_TOPIC: "GeoJSON",
}
#: Topics whose newest message is wrong as soon as the solution is not valid.
PRESENT_TOPICS = (LOCATION_TOPIC, POSE_TOPIC, TRANSFORM_TOPIC)
#: Body axes of Foxglove in those of fti.
FORWARD, LEFT, UP = (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)
TRACK_PERIOD_NS = 2_000_000_000
#: Points of the track; when they are reached, every second one is dropped.
MAX_TRACK_POINTS = 1000
FIRST_POINT_PERIOD_NS = 1_000_000_000
#: Digits of a degree: 0.1 m.
DEGREE_DIGITS = 6


class Scene:
    """Messages for map and 3D panels.  The origin of the map frame is the first valid position."""

    def __init__(self) -> None:
        self._origin: LocalOrigin | None = None
        self._track = Track()

    def messages(self, solution: NavSolution) -> Iterator[tuple[str, Json]]:
        """Topic and message of each; none but the track without a valid position."""
        fix = foxglove.location(solution)
        if fix:
            yield LOCATION_TOPIC, fix
            yield from self._pose(solution, fix["timestamp"])
        point = (fix["longitude"], fix["latitude"]) if fix else None
        if self._track.add(solution.t_ns, point):
            yield TRACK_TOPIC, {"geojson": self._track.geojson()}

    def _pose(self, solution: NavSolution, timestamp: Json) -> Iterator[tuple[str, Json]]:
        lat, lon, alt = solution.lat, solution.lon, solution.alt
        roll, pitch, heading = solution.roll, solution.pitch, solution.heading
        assert lat is not None and lon is not None and alt is not None
        self._origin = self._origin or LocalOrigin(lat, lon, alt)
        if not solution.attitude_valid or roll is None or pitch is None or heading is None:
            return
        position = _named(self._origin.position(lat, lon, alt), "xyz")
        rotation = _named(self._origin.rotation((lat, lon), (roll, pitch, heading)), "wxyz")
        pose = {"position": position, "orientation": rotation}
        yield POSE_TOPIC, {"timestamp": timestamp, "frame_id": MAP_FRAME, "pose": pose}
        frames = {"parent_frame_id": MAP_FRAME, "child_frame_id": BODY_FRAME}
        yield TRANSFORM_TOPIC, {"timestamp": timestamp, **frames, "translation": position, "rotation": rotation}


def _named(values: tuple[float, ...], names: str) -> Json:
    return dict(zip(names, values, strict=True))


class LocalOrigin:
    """Origin of the frame ``map``: lat, lon [rad], alt above the ellipsoid [m]."""

    def __init__(self, lat: float, lon: float, alt: float) -> None:
        self._origin_e = formulas.ecef_from_geodetic(lat, lon, alt)
        self._mat_en = formulas.mat_en(lat, lon)

    def position(self, lat: float, lon: float, alt: float) -> Vector:
        """East, north, up [m] of a position."""
        x, y, z = formulas.ecef_from_geodetic(lat, lon, alt)
        x0, y0, z0 = self._origin_e
        return self._to_map((x - x0, y - y0, z - z0))

    def rotation(self, place: tuple[float, float], attitude: Vector) -> formulas.Quaternion:
        """Quaternion w, x, y, z that rotates vectors from ``p`` to ``map``.

        place : lat, lon [rad];  attitude : roll, pitch, heading [rad]
        """
        mat_en, mat_nb = formulas.mat_en(*place), formulas.mat_nb(*attitude)
        x, y, z = (self._to_map(formulas.rotate(mat_en, formulas.rotate(mat_nb, axis))) for axis in (FORWARD, LEFT, UP))
        return formulas.quat_from_mat(((x[0], y[0], z[0]), (x[1], y[1], z[1]), (x[2], y[2], z[2])))

    def _to_map(self, vector_e: Vector) -> Vector:
        north, east, down = formulas.rotate_back(self._mat_en, vector_e)
        return east, north, -down


class Track:
    """The flown track as GeoJSON, with a gap where the position was not valid; its length is bounded."""

    def __init__(self) -> None:
        self._parts: list[list[tuple[float, float]]] = []
        self._period_ns = FIRST_POINT_PERIOD_NS
        self._is_open = False
        self._point_ns = self._shown_ns = -math.inf

    def add(self, t_ns: int, point: tuple[float, float] | None) -> bool:
        """Add longitude and latitude [deg]; None while they are not valid.  Is the track to be shown again?"""
        if point is None:
            self._is_open = False
        elif not self._is_open or t_ns - self._point_ns >= self._period_ns:
            if not self._is_open:
                self._parts.append([])
            self._is_open, self._point_ns = True, t_ns
            self._parts[-1].append((round(point[0], DEGREE_DIGITS), round(point[1], DEGREE_DIGITS)))
            if sum(map(len, self._parts)) > MAX_TRACK_POINTS:
                self._thin_out()
        if t_ns - self._shown_ns < TRACK_PERIOD_NS or not self._parts:
            return False
        self._shown_ns = t_ns
        return True

    def _thin_out(self) -> None:
        """Drop every second point, and parts that are shorter than two points."""
        self._period_ns *= 2
        thinned = [part[::2] for part in self._parts]
        self._parts = [part for part in thinned[:-1] if len(part) > 1] + thinned[-1:]

    def geojson(self) -> str:
        """The track as a GeoJSON feature; longitude first, as RFC 7946 has it."""
        lines = [part for part in self._parts if len(part) > 1]
        geometry = {"type": "MultiLineString", "coordinates": lines}
        return json.dumps({"type": "Feature", "properties": {"name": "track"}, "geometry": geometry})
