"""Errors of the quantities of each topic against the ground truth, with the stated sigmas.

Truth: ``fti.hil.truth_log``.  Messages are compared at their time of validity.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Ints
from fti.config import Vector
from fti.geodesy.rotations import mat_from_rpy
from fti.geodesy.wgs84 import metres_per_radian
from fti.hil.oracle.flag_definitions import GROUND_DRIFT, HEIGHT, INTEGRITY, SOLUTION
from fti.hil.oracle.required_outputs import (
    FILTER,
    FIX,
    GLIDE,
    GROUND_FIX,
    HEIGHT_BELOW,
    LOCATION,
    VALIDITY,
    VERTICAL,
)
from fti.hil.tables.limits import ScoreLimits
from fti.post.score.series import TopicSeries
from fti.post.score.truth_table import TruthTable

#: Outputs that must state a sigma with each value that has a sigma field.
STATE_SIGMAS = frozenset((FILTER, FIX, VERTICAL, GLIDE, GROUND_FIX))


@dataclass(frozen=True, slots=True)
class QuantityError:
    """The error of one quantity in each message of a topic.

    error : measured minus true, or a distance, shape (n,), NaN where it is unknown
    sd    : stated 1-sigma, same shape, NaN where none is stated; limit : maximum error where none is stated
    must_state : each value must have a sigma
    unit  : of error, sd and limit
    """

    name: str
    unit: str
    error: Array
    sd: Array
    limit: float
    must_state: bool = False


class Comparison:
    """One topic against the truth.

    limits : of the scenario; arm_b : lever arm from P to the topic's device, body frame [m]
    stated : sigmas that every source of the navigation solution states; fix_m : maximum error of a radio fix [m]
    """

    def __init__(
        self,
        series: TopicSeries,
        truth: TruthTable,
        limits: ScoreLimits,
        arm_b: Vector,
        *,
        stated: frozenset[str] = frozenset(),
        fix_m: float = 0.0,
    ) -> None:
        self._series, self._truth, self._limits, self._stated = series, truth, limits, stated
        self._horizontal_m = max(limits.horizontal_m, fix_m) if series.topic == FIX else limits.horizontal_m
        self._t: Ints = series.valid_ns
        self._arm_n = self._arm_ned(arm_b)

    def errors(self) -> list[QuantityError]:
        """Every quantity of the topic that the truth has; validities of sources have none."""
        topic = self._series.topic
        if topic in (SOLUTION, FILTER, FIX, VERTICAL):
            return [*self._position(), *self._velocity(), *self._attitude()]
        alone = {
            LOCATION: self._location,
            GROUND_FIX: self._ground_fix,
            GROUND_DRIFT: self._ground_drift,
            GLIDE: self._glide_slope,
            INTEGRITY: self._integrity,
        }
        if topic in alone:
            return list(alone[topic]())
        if topic.startswith((HEIGHT_BELOW, f"{HEIGHT}/")):
            return list(self._height(topic.removeprefix(HEIGHT_BELOW).rpartition("/")[2]))
        of_source = topic.startswith(f"{VALIDITY}/")
        return [] if of_source else list(self._measurement(*topic.strip("/").split("/")))

    # ------------------------------------------------------------------------------------------------ navigation

    def _position(self) -> Iterator[QuantityError]:
        yield self._horizontal(self._column("lat"), self._column("lon"), self._column("horizontal_sd"))
        yield self._altitude("altitude", "alt")

    def _integrity(self) -> Iterator[QuantityError]:
        yield self._plain(("window end", "m"), "s_end", "s", self._limits.horizontal_m)

    def _ground_fix(self) -> Iterator[QuantityError]:
        """With the sigma of the fix on the map, and that of the map."""
        fix_sd = np.maximum(self._column("north_sd"), self._column("east_sd"))
        sd = np.hypot(fix_sd, self._column("map_sd"))
        yield self._horizontal(self._column("lat"), self._column("lon"), sd)

    def _ground_drift(self) -> Iterator[QuantityError]:
        """The estimated mounting, of which a sound sensor has no error; the drift is that of the filter."""
        yaw, sd = np.rad2deg(self._column("yaw")), np.rad2deg(self._column("yaw_sd"))
        yield QuantityError("mounting", "deg", yaw, sd, self._limits.heading_deg, must_state=True)

    def _velocity(self) -> Iterator[QuantityError]:
        for name in ("vel_north", "vel_east", "vel_down"):
            sd = f"{name}_sd" if self._series.topic == VERTICAL else "vel_sd"
            yield self._plain((name, "m/s"), name, name, self._limits.velocity_mps, sd)

    def _attitude(self) -> Iterator[QuantityError]:
        limits = self._limits
        for name in ("roll", "pitch"):
            yield self._angle(name, name, "tilt_sd", limits.attitude_deg)
        yield self._angle("heading", "heading", "heading_sd", limits.heading_deg)

    def _location(self) -> Iterator[QuantityError]:
        lat, lon = np.deg2rad(self._column("latitude")), np.deg2rad(self._column("longitude"))
        yield self._horizontal(lat, lon, self._column("no sigma"))
        yield self._plain(("altitude", "m"), "altitude", "alt", self._limits.vertical_m)

    def _glide_slope(self) -> Iterator[QuantityError]:
        limits = self._limits
        yield self._plain(("along the track", "m"), "s", "s", limits.horizontal_m)
        yield self._plain(("beside the track", "m"), "y", "y", limits.horizontal_m)
        yield self._plain(("height above the path", "m"), "dh", "dh", limits.vertical_m, "dh_sd")
        yield self._plain(("navigated height above the path", "m"), "dh_nav", "dh", limits.vertical_m)
        yield self._angle("deviation", "deviation", "sd", limits.deviation_deg)

    def _height(self, name: str) -> Iterator[QuantityError]:
        """The height vertically below; for an altimeter of that name also its measured and predicted range."""
        error, limits = self._column("height_agl") - self._true("height_agl"), self._limits
        yield QuantityError("height below", "m", error, self._column("sd"), limits.vertical_m, must_state=True)
        if not name:
            return
        # the spread covers terrain between two rows of the truth and within the position error; an invalid sigma stays
        here, spread = self._true("range_" + name), self._true("most_range_" + name) - self._true("least_range_" + name)
        stated = self._column("nearest_sd")
        sd = np.where(stated > 0.0, np.hypot(stated, np.nan_to_num(spread) / 2.0), stated)
        predicted = self._column("predicted") - here
        for quantity, error, one_sigma in (
            ("measured range", self._column("raw") - here, sd),
            ("predicted range", predicted, self._column("predicted_sd")),
        ):
            yield QuantityError(quantity, "m", error, one_sigma, limits.vertical_m, must_state=True)

    # ----------------------------------------------------------------------------------------------- measurements

    def _measurement(self, device: str, kind: str) -> Iterator[QuantityError]:
        limits = self._limits
        if kind == "position":
            yield from self._position()
            yield self._altitude("altitude above sea", "alt_msl")
        elif kind == "velocity":
            for axis in ("north", "east", "down"):
                yield self._plain((f"vel_{axis}", "m/s"), axis, f"vel_{axis}", limits.velocity_mps)
            yield self._plain(("ground speed", "m/s"), "ground_speed", "ground_speed", limits.velocity_mps)
        elif kind == "attitude":
            yield from self._attitude()
        elif kind in ("range", "radio_height"):
            field = "slant_range" if kind == "range" else "height_agl"
            yield self._plain(("measured range", "m"), field, "range_" + device, limits.vertical_m)
        elif kind == "airspeed":
            yield self._plain(("true airspeed", "m/s"), "tas", "tas", limits.airspeed_mps)

    # ------------------------------------------------------------------------------------------------------ tools

    def _must_state(self, sd: str) -> bool:
        """Must each value have a sigma?  Filters state one for each output; devices may state none."""
        topic = self._series.topic
        return bool(sd) and (topic in STATE_SIGMAS or (topic == SOLUTION and sd in self._stated))

    def _arm_ned(self, arm_b: Vector) -> Array:
        """A lever arm north, east, down at each message [m], shape (n, 3); NaN outside the flight."""
        if not any(arm_b):
            return np.zeros((len(self._t), 3))
        return np.asarray(mat_from_rpy(*(self._true(name) for name in ("roll", "pitch", "heading"))) @ np.array(arm_b))

    def _column(self, name: str) -> Array:
        return self._series.column(name)

    def _true(self, name: str) -> Array:
        return self._truth.at(name, self._t)

    def _plain(self, name_unit: tuple[str, str], field: str, true: str, limit: float, sd: str = "") -> QuantityError:
        error = self._column(field) - self._true(true)
        return QuantityError(*name_unit, error, self._column(sd), limit, self._must_state(sd))

    def _angle(self, name: str, field: str, sd: str, limit_deg: float) -> QuantityError:
        error = self._column(field) - self._true(field)
        wrapped = np.rad2deg((error + math.pi) % (2.0 * math.pi) - math.pi)
        sigma = np.rad2deg(self._column(sd))
        return QuantityError(name, "deg", wrapped, sigma, limit_deg, self._must_state(sd))

    def _altitude(self, name: str, field: str) -> QuantityError:
        """Altitude at the device, which is above P by the upward component of its lever arm."""
        error = self._column(field) - self._true(field) + self._arm_n[:, 2]
        must = self._must_state("vertical_sd")
        return QuantityError(name, "m", error, self._column("vertical_sd"), self._limits.vertical_m, must)

    def _horizontal(self, lat: Array, lon: Array, sd: Array) -> QuantityError:
        """Horizontal distance, from latitude and longitude [rad]."""
        true_lat = self._true("lat")
        per_lat, per_lon = metres_per_radian(np.nan_to_num(true_lat), np.nan_to_num(self._true("alt")))
        lon_error = (lon - self._true("lon") + math.pi) % (2.0 * math.pi) - math.pi
        north, east = (lat - true_lat) * per_lat, lon_error * per_lon
        distance = np.hypot(north - self._arm_n[:, 0], east - self._arm_n[:, 1])
        must = self._must_state("horizontal_sd")
        return QuantityError("horizontal", "m", distance, sd, self._horizontal_m, must)
