"""Creates the flight from the table ``[flight]`` of a scenario: one function per kind."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fti.arrays import Array
from fti.errors import ConfigError
from fti.geodesy.atmosphere import Atmosphere
from fti.hil.flight.approach import ApproachPlan, Manoeuvre, approach_flight
from fti.hil.flight.jsbsim.fdm import Weather
from fti.hil.flight.jsbsim.flight import fly
from fti.hil.flight.recorded_flight import recorded_flight
from fti.hil.flight.trajectory import SplineFlight
from fti.hil.flight.waypoints import Waypoint, waypoint_flight
from fti.hil.tables.fault_types import OffTrack
from fti.hil.tables.flights import ApproachFlight, RecordedFlight, WaypointFlight
from fti.hil.tables.jsbsim_options import JsbsimFlight
from fti.hil.tables.schema import Scenario
from fti.nav.integrity.approach import ApproachPath
from fti.terrain.terrain import Terrain


@dataclass(frozen=True, slots=True)
class FlightSite:
    """Site of a flight: published approach of the airfield, terrain, atmosphere, geoid above WGS84 [m].

    progress : called with each step of computing a flight
    """

    path: ApproachPath
    terrain: Terrain
    atmosphere: Atmosphere
    undulation: float
    progress: Callable[[str], None] = lambda _: None


@dataclass(frozen=True, slots=True)
class FlightBuild:
    """A flight, from 0 to ``flight.end`` [s], and remarks for the user.

    surfaces : deflections [rad] of control surfaces by name at ``surfaces_t`` [s], for flights that compute them
    """

    flight: SplineFlight
    remarks: tuple[str, ...] = ()
    surfaces_t: Array = field(default_factory=lambda: np.empty(0))
    surfaces: Mapping[str, Array] = field(default_factory=dict)


def make_flight(scenario: Scenario, site: FlightSite) -> FlightBuild:
    """The flight of a scenario.

    Raises ConfigError or MissingError for errors in the table, or in the files that it names.
    """
    return MAKERS[type(scenario.flight)](scenario.flight, scenario, site)


def approach_plan(table: ApproachFlight, scenario: Scenario) -> ApproachPlan:
    """Parameters of the approach flight: from the table, the wind, and the faults that lead off the track."""
    return ApproachPlan(
        start=table.start_m,
        duration=table.duration_s,
        speed=table.speed_mps,
        wander=table.wander_m,
        wander_height=table.wander_height_m,
        gust=table.gust_mps,
        wind_n=scenario.air.wind_n,
        manoeuvres=tuple(
            Manoeuvre(f.right_m, f.from_s, f.to_s, f.turn_s) for f in scenario.fault if isinstance(f, OffTrack)
        ),
    )


def _approach(table: ApproachFlight, scenario: Scenario, site: FlightSite) -> FlightBuild:
    path = site.path
    flight = approach_flight(path, path.x_gpi, approach_plan(table, scenario), scenario.seed)
    return FlightBuild(flight.section(0.0, table.duration_s))


def _waypoints(table: WaypointFlight, scenario: Scenario, site: FlightSite) -> FlightBuild:
    del site  # the waypoints are absolute positions
    waypoints = [
        Waypoint(math.radians(w.lat_deg), math.radians(w.lon_deg), w.alt_m, w.speed_mps) for w in table.waypoint
    ]
    try:
        return FlightBuild(waypoint_flight(waypoints, math.radians(table.bank_deg), scenario.air.wind_n))
    except ValueError as error:
        raise ConfigError(f"{scenario.source_name}: flight.{error}") from None


def _recorded(table: RecordedFlight, scenario: Scenario, site: FlightSite) -> FlightBuild:
    del site  # the recording has absolute positions
    flight, remark = recorded_flight(table, scenario.air.wind_n)
    return FlightBuild(flight, (remark,))


def _jsbsim(table: JsbsimFlight, scenario: Scenario, site: FlightSite) -> FlightBuild:
    air = Weather(scenario.air.wind_n, site.atmosphere, site.undulation, table.turbulence, scenario.seed)
    try:
        run = fly(table, air, site.path, site.terrain, site.progress)
    except ConfigError as error:
        raise ConfigError(f"{scenario.source_name}: {error}") from None
    flight = SplineFlight.from_samples(run.samples).section(0.0, run.duration)
    remark = f"JSBSim aircraft {table.aircraft} flies route {table.route} in {run.duration:.0f} s"
    return FlightBuild(flight, (remark,), run.samples.t, run.surfaces())


#: Functions that create the flight, by the type of the table.
MAKERS: dict[type, Callable[[Any, Scenario, FlightSite], FlightBuild]] = {
    ApproachFlight: _approach,
    WaypointFlight: _waypoints,
    RecordedFlight: _recorded,
    JsbsimFlight: _jsbsim,
}
