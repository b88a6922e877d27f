"""Checks a flight against the terrain data below it.

A flight may leave the terrain data: altimeters have no return there, as over a hole of an elevation model, and a remark
is issued before the flight.  A flight below the ground is an error.
"""

from __future__ import annotations

import numpy as np

from fti.errors import ConfigError
from fti.hil.flight.trajectory import SplineFlight
from fti.terrain.terrain import Terrain

CHECK_PERIOD_S = 1.0


def check_coverage(flight: SplineFlight, terrain: Terrain, title: str) -> tuple[str, ...]:
    """Remarks on the terrain below a flight, checked once a second.

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
