"""A small world for tests: a flat country, an airfield on it, and a flight of some seconds."""

from __future__ import annotations

import math

import numpy as np

from fti.hil.environment import Environment
from fti.hil.tables.flights import ApproachFlight
from fti.hil.tables.schema import Scenario
from fti.nav.integrity.approach import Airfield, ApproachPath
from fti.terrain.terrain import Terrain

AIRFIELD = Airfield(
    name="test",
    threshold_lat_deg=48.0,
    threshold_lon_deg=11.0,
    threshold_alt_m=500.0,
    course_deg=250.0,
    runway_length_m=2000.0,
    survey_date="2024-01-01",
)


def path() -> ApproachPath:
    return ApproachPath(AIRFIELD)


def flat_terrain(cell_m: float = 20.0) -> Terrain:
    """Level with the threshold's tangent plane, 6 km to each side."""
    n = round(12000 / cell_m) + 1
    return Terrain.from_array(
        np.zeros((n, n)),
        cell_m,
        lat0=math.radians(48.0),
        lon0=math.radians(11.0),
        alt0=500.0,
        east0=-6000.0,
        north0=-6000.0,
    )


def scenario(**keys: object) -> Scenario:
    return Scenario.model_validate({"title": "test", "description": "", "config": "none", **keys})


def world(duration_s: float = 10.0, start_m: float = 4500.0, **keys: object) -> Environment:
    flight = ApproachFlight(duration_s=duration_s, start_m=start_m)
    return Environment(scenario(flight=flight, **keys), path(), flat_terrain(), undulation=47.0)
