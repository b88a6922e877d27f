"""The environment that simulated sensors measure: flight, terrain and air."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.config import Device
from fti.errors import ConfigError
from fti.geodesy.atmosphere import GAS_CONSTANT, ISA_PRESSURE, ISA_TEMPERATURE, Atmosphere
from fti.geodesy.formulas import metres_per_radian
from fti.geodesy.local import LocalFrame
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.faults.descriptions import describe
from fti.hil.flight.factory import FlightSite, make_flight
from fti.hil.flight.trajectory import FlightState, SplineFlight
from fti.hil.scenario import Scenario
from fti.hil.tables.fault_types import Obstacle, TerrainShift, WholeFlightFault
from fti.nav.integrity.approach import ApproachPath
from fti.ranging.exposure import epoch_times, point_rays
from fti.ranging.laser import Laser
from fti.ranging.nearest import NearestReturn
from fti.ranging.sensor import Poses, RangingSensor, Returns, sensor_poses
from fti.ranging.weather import fog
from fti.terrain.terrain import Terrain

CHECK_PERIOD_S = 1.0
HEAT_RATIO = 1.4
LASER_RANGE = 2000.0
#: Reflectance for which data sheets state the range of a laser, and a common pulse length [s].
LASER_REFLECTANCE, PULSE_S = 0.2, 10e-9
#: The position itself, and one metre east, west, north and south of it.
SIDE_OFFSETS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])


def impact_pressure(tas: ArrayLike, p_static: ArrayLike, temperature: ArrayLike) -> Array:
    """q_c [Pa] of subsonic flow at a true airspeed [m/s]; isentropic, source: ISO 2533 constants."""
    mach_sq = np.asarray(tas) ** 2 / (HEAT_RATIO * GAS_CONSTANT * np.asarray(temperature))
    return np.asarray(np.asarray(p_static) * ((1.0 + 0.2 * mach_sq) ** 3.5 - 1.0))


def calibrated_airspeed(q_c: ArrayLike) -> Array:
    """CAS [m/s] of an impact pressure [Pa]."""
    ratio = np.asarray(q_c) / ISA_PRESSURE + 1.0
    return np.asarray(np.sqrt(5.0 * HEAT_RATIO * GAS_CONSTANT * ISA_TEMPERATURE * (ratio ** (1 / 3.5) - 1.0)))


class Environment:
    """The ground truth of one scenario.

    scenario : sensor models read its seed, settings and faults
    path : the published approach, whether it is flown or not; terrain : the terrain data of the unit under test;
    undulation : geoid above WGS84 [m]; progress : called with each step of computing the flight
    Raises ConfigError or MissingError for a flight that cannot be computed, or that is below the ground.
    """

    def __init__(
        self,
        scenario: Scenario,
        path: ApproachPath,
        terrain: Terrain,
        undulation: float,
        progress: Callable[[str], None] = lambda _: None,
    ) -> None:
        air = scenario.air
        self.scenario = scenario
        self.path = path
        try:
            ground = true_ground(terrain, scenario.terrain_shifts)
            self.terrain = add_obstacles(ground, path, scenario.obstacles)
        except ValueError as error:
            raise ConfigError(f"{scenario.source_name}: fault: {error}") from None
        self.undulation = undulation
        station = path.airfield.threshold_alt_m - undulation
        self.atmosphere = Atmosphere(air.qnh_hpa * 100.0, air.isa_deviation_k, station)
        build = make_flight(scenario, FlightSite(path, self.terrain, self.atmosphere, undulation, progress))
        self._flight = build.flight
        self._surfaces_t, self._surfaces = build.surfaces_t, build.surfaces
        self.duration = self._flight.end
        #: Remarks on the flight, for the user before it begins.
        self.remarks = (
            build.remarks
            + _check_coverage(build.flight, ground, scenario.source_name)
            + tuple(_faults_beyond_flight(scenario, self.duration))
        )
        self._radars = functools.cache(NearestReturn)

    def state(self, t: Array) -> FlightState:
        """Truth at t [s], shape (n,)."""
        return self._flight.state(t)

    def surfaces(self, t: Array) -> dict[str, Array]:
        """Deflections of the control surfaces [rad] at t [s] by name; empty for a flight without control surfaces."""
        return {name: np.interp(t, self._surfaces_t, angles) for name, angles in self._surfaces.items()}

    def radar_ranges(self, t: Array, beam_width: float, device: Device) -> Array:
        """Leading-edge range [m] of a radar altimeter at times t [s]; NaN without return.  beam_width : full [rad]."""
        return self.returns(self._radars(beam_width), t, device).slant_range

    def laser_ranges(self, t: Array, device: Device) -> Array:
        """Slant range [m] along the boresight of a laser altimeter at times t [s]; NaN without return."""
        return self.returns(self.laser(device), t, device).slant_range

    def laser(self, device: Device) -> Laser:
        """An ideal laser of range ``LASER_RANGE``; in fog one with the range that its device states in clear air."""
        air = self.scenario.air
        if air.visibility_m is None:
            return Laser(max_range=LASER_RANGE)
        reach = device.altimeter.range_m[1] if device.altimeter else LASER_RANGE
        top = self.path.airfield.threshold_alt_m + air.fog_top_m - self.terrain.frame.alt0
        return Laser(
            max_range=reach, reflectance=LASER_REFLECTANCE, pulse_length=PULSE_S, weather=(fog(air.visibility_m, top),)
        )  # fmt: skip

    def returns(self, sensor: RangingSensor, t: Array, device: Device) -> Returns:
        """Returns of a sensor with the mounting of the device at times t [s], without noise of the instrument."""
        return sensor.measure(self.terrain, self._poses(t, device))

    def point_rays(self, times: Array, directions_s: Array, device: Device) -> tuple[Array, Array]:
        """Origins [m] and unit vectors in the terrain's frame, each (n, 3), of points of a scanner or imager.

        times : when each is measured, (n,) [s], at most a few milliseconds after the flight;  directions_s : (n, 3)
        """
        epochs = epoch_times(float(times.min()), float(times.max()))
        return point_rays(epochs, self._poses(np.minimum(epochs, self.duration), device), times, directions_s)

    def range_bounds(self, t: Array, device: Device, within: float) -> tuple[Array, Array, Array]:
        """Range [m] of an altimeter at times t [s], and the smallest and largest of the ranges at its position and
        ``within`` [m] east, west, north and south of it, in the attitude of that time.
        """
        limits = device.altimeter
        if limits is None:
            raise ValueError(f"device {device.name!r} has no [device.altimeter] table")
        is_laser = limits.kind == "laser"
        sensor = self.laser(device) if is_laser else self._radars(math.radians(limits.beam_deg))
        poses = self._poses(t, device)
        ranges = [
            sensor.measure(self.terrain, replace(poses, origins_l=poses.origins_l + offset)).slant_range
            for offset in within * SIDE_OFFSETS
        ]
        return ranges[0], np.fmin.reduce(ranges), np.fmax.reduce(ranges)

    def _poses(self, t: Array, device: Device) -> Poses:
        now = self.state(t)
        position, rpy = (now.lat, now.lon, now.alt), (now.roll, now.pitch, now.heading)
        return sensor_poses(self.terrain.frame, position, rpy, device.lever_arm_b, mounting(device), now.vel_n)

    def ground(self, state: FlightState) -> Array:
        """Height of the surface below the aircraft above the ellipsoid [m]."""
        return self.terrain.height(state.lat, state.lon)


def _faults_beyond_flight(scenario: Scenario, duration: float) -> Iterator[str]:
    """Remarks on faults that begin or end after the flight."""
    for i, fault in enumerate(scenario.fault):
        if isinstance(fault, WholeFlightFault) or fault.to_s <= duration:
            continue
        event = f"begins at {fault.from_s:g} s" if fault.from_s >= duration else f"ends at {fault.to_s:g} s"
        yield f"fault[{i}], {describe(fault)}, {event}, but the flight ends at {duration:.0f} s"


def _check_coverage(flight: SplineFlight, terrain: Terrain, title: str) -> tuple[str, ...]:
    """Remarks on the terrain below a flight, checked once a second.

    A flight may leave the terrain data: altimeters have no return there, as over a hole of an elevation model.
    title : of the scenario, for the message.  Raises ConfigError for a flight below the ground.
    """
    t = np.arange(flight.begin, flight.end, CHECK_PERIOD_S)
    state = flight.state(t)
    height = state.alt - terrain.height(state.lat, state.lon)
    unknown = np.isnan(height)
    if np.any(height < 0.0):
        k = int(np.nanargmin(height))
        raise ConfigError(f"{title}: flight: {-height[k]:.0f} m below the ground at {t[k]:.0f} s")
    if not unknown.any():
        return ()
    first = t[int(np.argmax(unknown))]
    share = 100.0 * float(np.mean(unknown))
    return (f"no terrain data below {share:.0f} % of the flight, first at {first:.0f} s: no ranges there",)


def mounting(device: Device) -> Array:
    """mat_bs of a device."""
    roll, pitch, yaw = (math.radians(a) for a in device.rpy_bs_deg)
    return mat_from_rpy(roll, pitch, yaw)


def true_ground(terrain: Terrain, shifts: Sequence[TerrainShift]) -> Terrain:
    """The true ground if ``terrain`` is displaced from it by these shifts: the same posts in a shifted frame."""
    if not shifts:
        return terrain
    north, east, up = (sum(getattr(shift, name) for shift in shifts) for name in ("north_m", "east_m", "up_m"))
    frame = terrain.frame
    per_lat, per_lon = metres_per_radian(frame.lat0, frame.alt0)
    moved = LocalFrame(frame.lat0 - north / per_lat, frame.lon0 - east / per_lon, frame.alt0 - up)
    return replace(terrain, frame=moved)


def add_obstacles(terrain: Terrain, path: ApproachPath, obstacles: Sequence[Obstacle]) -> Terrain:
    """The terrain with boxes on it, aligned with the track; at least one post each.

    Raises ValueError for a box that is outside the terrain or lies between its posts.
    """
    if not obstacles:
        return terrain
    layer = terrain.finest
    heights = layer.heights.copy()
    grid = np.stack(np.broadcast_arrays(layer.east[None, :], layer.north[:, None], 0.0), axis=-1)
    lat, lon, _ = terrain.frame.to_geodetic(grid)
    s, y = path.to_path(lat, lon)
    for box in obstacles:
        along, across = np.abs(s - path.x_gpi - box.before_threshold_m), np.abs(y - box.right_m)
        inside = (along <= box.length_m / 2) & (across <= box.width_m / 2)
        if not inside.any():
            raise ValueError(
                f"an obstacle {box.before_threshold_m:g} m before the threshold and {box.right_m:g} m right of it "
                f"is outside the terrain, or between its posts, which are {layer.cell_m:g} m apart"
            )
        heights[inside] += box.height_m
    return terrain.with_finest(heights)
