"""Flights of JSBSim for tests: over the flat country of tests.hil.worlds, or over hills."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fti.geodesy.atmosphere import Atmosphere
from fti.hil.flight.jsbsim.fdm import Weather
from fti.hil.flight.jsbsim.flight import JsbsimRun, fly
from fti.hil.tables.jsbsim_options import JsbsimFlight
from fti.terrain.terrain import Terrain
from tests.hil.worlds import AIRFIELD, flat_terrain, path

UNDULATION = 47.0


def hills() -> Terrain:
    """Ridges of 120 m, 2.4 km apart, across the track of the airfield; the threshold in a valley."""
    places = np.arange(-8000.0, 8001.0, 50.0)
    course = math.radians(AIRFIELD.course_deg)
    along = places[None, :] * math.sin(course) + places[:, None] * math.cos(course)
    ground = 60.0 * (1.0 - np.cos(2.0 * np.pi * along / 2400.0))
    return Terrain.from_array(
        ground,
        50.0,
        lat0=math.radians(48.0),
        lon0=math.radians(11.0),
        alt0=500.0,
        east0=-8000.0,
        north0=-8000.0,
    )


def jsbsim_run(
    wind_n: tuple[float, float] = (0.0, 0.0),
    seed: int = 1,
    atmosphere: Atmosphere | None = None,
    terrain: Terrain | None = None,
    **flight: Any,
) -> JsbsimRun:
    settings = JsbsimFlight.model_validate({"kind": "jsbsim", **flight})
    weather = Weather(wind_n, atmosphere or Atmosphere(), UNDULATION, settings.turbulence, seed)
    return fly(settings, weather, path(), terrain or flat_terrain(100.0))


def crosswind(speed: float) -> tuple[float, float]:
    """Velocity of air that comes from the left of the approach [m/s]."""
    to_right = math.radians(AIRFIELD.course_deg + 90.0)
    return speed * math.cos(to_right), speed * math.sin(to_right)


def before_right(flight: JsbsimRun) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Path length before the intercept point and offset to the right of the track [m] of the samples."""
    return path().to_path(flight.samples.lat, flight.samples.lon)


def during(flight: JsbsimRun) -> NDArray[np.bool_]:
    """Which samples are of the flight, not of its margins."""
    t = flight.samples.t
    return np.asarray((t >= 0.0) & (t <= flight.duration))
