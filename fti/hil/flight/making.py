"""From the table ``[flight]`` of a scenario to the flight: one function per kind, one table of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fti.errors import ConfigError
from fti.hil.faults.kinds import OffTrack
from fti.hil.flight.approach import Manoeuvre, Plan, approach_flight
from fti.hil.flight.recorded import recorded_flight
from fti.hil.flight.trajectory import SplineFlight
from fti.hil.flight.waypoints import Waypoint, waypoint_flight
from fti.hil.scenario.flights import ApproachFlight, RecordedFlight, WaypointFlight
from fti.hil.scenario.schema import Scenario
from fti.nav.approach import ApproachPath


@dataclass(frozen=True, slots=True)
class Made:
    """A flight, from 0 to ``flight.end`` [s], and what is to be told about how it was made."""

    flight: SplineFlight
    remarks: tuple[str, ...] = ()


def make_flight(scenario: Scenario, path: ApproachPath) -> Made:
    """The flight of a scenario.  path : the approach of its airfield.

    Raises ConfigError or MissingError with what is wrong in the table, or in what it names.
    """
    return MAKERS[type(scenario.flight)](scenario.flight, scenario, path)


def approach_plan(table: ApproachFlight, scenario: Scenario) -> Plan:
    """How the approach is flown: the table, the wind, and the faults that lead off the track."""
    return Plan(
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


def _approach(table: ApproachFlight, scenario: Scenario, path: ApproachPath) -> Made:
    flight = approach_flight(path, path.x_gpi, approach_plan(table, scenario), scenario.seed)
    return Made(flight.during(0.0, table.duration_s))


def _waypoints(table: WaypointFlight, scenario: Scenario, path: ApproachPath) -> Made:
    del path  # the waypoints say where
    waypoints = [
        Waypoint(math.radians(w.lat_deg), math.radians(w.lon_deg), w.alt_m, w.speed_mps) for w in table.waypoint
    ]
    try:
        return Made(waypoint_flight(waypoints, math.radians(table.bank_deg), scenario.air.wind_n))
    except ValueError as error:
        raise ConfigError(f"{scenario.title}: flight.{error}") from None


def _recorded(table: RecordedFlight, scenario: Scenario, path: ApproachPath) -> Made:
    del path  # the recording says where
    flight, remark = recorded_flight(table, scenario.air.wind_n)
    return Made(flight, (remark,))


#: What makes a flight of each table: called with the table, its scenario and the approach.
MAKERS: dict[type, Callable[[Any, Scenario, ApproachPath], Made]] = {
    ApproachFlight: _approach,
    WaypointFlight: _waypoints,
    RecordedFlight: _recorded,
}
