"""Flies a route with JSBSim and the autopilot, and returns the samples of the flight."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.constants import FOOT
from fti.errors import ConfigError
from fti.geodesy.rotations import mat_en, mat_from_rpy
from fti.geodesy.wgs84 import geodetic_from_ecef
from fti.hil.flight.jsbsim.airframe import AIRFRAMES, INCH, Airframe
from fti.hil.flight.jsbsim.autopilot import Autopilot, GuidanceCommand
from fti.hil.flight.jsbsim.fdm import COLUMNS, PERIOD_S, AircraftState, Fdm, InitialConditions, Row, Weather
from fti.hil.flight.jsbsim.routes import Route, make_route
from fti.hil.flight.jsbsim.track import STEP_M
from fti.hil.flight.trajectory import FlightSamples
from fti.hil.tables.jsbsim_options import JsbsimFlight
from fti.nav.integrity.approach import ApproachPath
from fti.terrain.terrain import Terrain

#: Additional samples before the begin and after the end of the route: splines are less accurate at their ends.
MARGIN_ROWS = 100
#: Look-ahead time of the target point on the track [s].
LOOKAHEAD_S = 6.0
#: Time limit of a route [s].
MAX_DURATION_S = 1800.0
#: Interval of progress messages [s of the flight].
PROGRESS_PERIOD_S = 60.0
#: The aircraft has crashed when P is this far below the ground of the route [m].
GROUND_TOLERANCE_M = 1.0


@dataclass(frozen=True, eq=False)
class JsbsimRun:
    """One flight of JSBSim.

    samples  : position of P, attitude, wind with gusts; 50 per second, t = 0 at the begin of the route
    duration : time at the end of the route [s]; MARGIN_ROWS more samples follow
    columns  : ``fdm.COLUMNS`` at the times of the samples, in JSBSim's units
    """

    samples: FlightSamples
    duration: float
    columns: dict[str, Array]

    def surfaces(self) -> dict[str, Array]:
        """Deflections [rad] at the times of the samples, by the names of the deflection pickups: down and right are +.

        JSBSim's signs are those of the pickups, also for the rudder: a yaw to the left is positive.
        """
        names = ("left_aileron", "right_aileron", "elevator", "rudder")
        return {name: self.columns[name] for name in names} | {"flaps": np.deg2rad(self.columns["flaps"])}


def fly(
    flight: JsbsimFlight,
    weather: Weather,
    path: ApproachPath,
    terrain: Terrain,
    progress: Callable[[str], None] = lambda _: None,
) -> JsbsimRun:
    """Fly a scenario's route.  The result is bit-reproducible on one machine.

    Raises MissingError without JSBSim, and ConfigError for a route that the terrain or the aircraft does not allow.
    """
    airframe = AIRFRAMES[flight.aircraft]
    route = make_route(flight, airframe, path, terrain)
    pilot = _Pilot(airframe, Fdm(airframe, _start(route, path), weather, route.ground.item(0)), route, path)
    rows = _rows(pilot, progress)
    columns = dict(zip(COLUMNS, np.array(rows).T, strict=True))
    columns["t"] = np.arange(-MARGIN_ROWS, len(rows) - MARGIN_ROWS) * PERIOD_S
    return JsbsimRun(_samples(airframe, columns), float(columns["t"][-MARGIN_ROWS - 1]), columns)


def _start(route: Route, path: ApproachPath) -> InitialConditions:
    """Initial state on the track, at the commanded height and approximate speed."""
    (east, north), (next_east, next_north) = route.track.points[:2]
    lat, lon, _ = path.frame.to_geodetic((east, north, 0.0))
    heading = math.atan2(next_east - east, next_north - north) % (2.0 * math.pi)
    return InitialConditions(float(lat), float(lon), route.alt.item(0), heading, route.cas.item(0))


class _RouteGuidance:
    """Guidance along a route: position of the aircraft on it, and commands for the autopilot.

    path : approach in whose local plane the track lies
    """

    def __init__(self, route: Route, path: ApproachPath) -> None:
        self._route = route
        self._mat = [[float(x) for x in row] for row in path.frame.mat_le[:2]]
        self._origin = [float(x) for x in path.frame.origin_e]
        #: Distance along the track [m].
        self.along = 0.0

    def command(self, now: AircraftState) -> GuidanceCommand:
        """Commands for the autopilot; advances along the route.

        The side acceleration gives a circle to the target point:  2 V^2 / L sin(eta),  L = V LOOKAHEAD_S.
        """
        from_origin = [x - x0 for x, x0 in zip(now.position_e, self._origin, strict=True)]
        east, north = (sum(m * x for m, x in zip(row, from_origin, strict=True)) for row in self._mat)
        self.along = self._route.track.along_at(east, north, self.along)
        v_north, v_east, _ = now.vel_n
        speed = max(math.hypot(v_north, v_east), 1.0)
        at_east, at_north = self._route.track.point(self.along + LOOKAHEAD_S * speed)
        to_east, to_north = at_east - east, at_north - north
        eta = math.atan2(v_north * to_east - v_east * to_north, v_east * to_east + v_north * to_north)
        k = self._station()
        low, high = self._route.alt.item(k), self._route.alt.item(k + 1)
        slope = (high - low) / STEP_M
        alt = low + slope * (self.along - k * STEP_M)
        return GuidanceCommand(
            2.0 * speed / LOOKAHEAD_S * math.sin(eta), now.alt - alt, slope * speed, self.at(self._route.cas)
        )

    def at(self, values: Array) -> float:
        """Value of one of the route's arrays at the current station."""
        return values.item(self._station())

    def _station(self) -> int:
        return min(max(int(self.along / STEP_M), 0), len(self._route.alt) - 2)


class _Pilot:
    """One flight: the aircraft, its autopilot and its guidance, step by step."""

    def __init__(self, airframe: Airframe, fdm: Fdm, route: Route, path: ApproachPath) -> None:
        self._fdm, self._route = fdm, route
        self._autopilot, self._guidance = Autopilot(airframe, PERIOD_S), _RouteGuidance(route, path)
        self._steps = 0
        self.has_ended = False

    @property
    def has_begun(self) -> bool:
        """Whether the run-in is over."""
        return self._guidance.along >= self._route.begin

    @property
    def progress_share(self) -> float:
        """Flown share of the track, 0 to 1."""
        return max(self._guidance.along / self._route.end, 0.0)

    def row(self) -> Row:
        """Advance by one step and return the row.  Raises ConfigError for a crash or a time-out."""
        now = self._fdm.sense()
        self._check(now)
        controls = self._autopilot.step(now, self._guidance.command(now))
        at, route = self._guidance.at, self._route
        controls.flaps, controls.gear = at(route.flaps), at(route.gear)
        self._fdm.set_ground(at(route.ground))
        self._fdm.step(controls)
        self._steps += 1
        self.has_ended |= now.on_ground or self._guidance.along >= route.end
        return self._fdm.row()

    def _check(self, now: AircraftState) -> None:
        after = f"{self._steps * PERIOD_S:.0f} s after its start"
        if not now.alt > self._guidance.at(self._route.ground) - GROUND_TOLERANCE_M:
            raise ConfigError(f"flight: the aircraft flew into the ground {after}: the air is too rough for this route")
        if self._steps * PERIOD_S > MAX_DURATION_S:
            raise ConfigError(f"flight: the route is not complete {after}, which is the time limit")


def _rows(pilot: _Pilot, progress: Callable[[str], None]) -> list[Row]:
    """The flight with MARGIN_ROWS before the begin of the route and after its end."""
    before: deque[Row] = deque(maxlen=MARGIN_ROWS)
    while not pilot.has_begun:
        before.append(pilot.row())
    rows = list(before)
    while not pilot.has_ended:
        rows.append(pilot.row())
        if len(rows) % round(PROGRESS_PERIOD_S / PERIOD_S) == 0:
            progress(f"flight: {pilot.progress_share:.0%} flown")
    return rows + [pilot.row() for _ in range(MARGIN_ROWS)]


def _samples(airframe: Airframe, columns: dict[str, Array]) -> FlightSamples:
    """P from the centre of gravity, and the rest in SI."""
    attitude = columns["roll"], columns["pitch"], columns["heading"]
    cg_e = np.stack([columns[axis] for axis in "xyz"], axis=1) * FOOT
    lat, lon, _ = geodetic_from_ecef(cg_e)
    cg = np.stack([columns[f"cg_{axis}"] for axis in "xyz"], axis=1) * INCH
    lever_b = (np.array(airframe.reference) - cg) * np.array([-1.0, 1.0, -1.0])
    lever_e = np.einsum("nij,njk,nk->ni", mat_en(lat, lon), mat_from_rpy(*attitude), lever_b)
    wind_n = np.stack([columns[f"wind_{axis}"] for axis in ("north", "east", "down")], axis=1) * FOOT
    return FlightSamples(columns["t"], *geodetic_from_ecef(cg_e + lever_e), *attitude, wind_n)
