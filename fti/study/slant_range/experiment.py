"""Three altimeters on both flights over both grounds: measured range and true height of each sample."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from dataclasses import dataclass

from fti.arrays import Array
from fti.hil.flight.leg_flight import SampledFlight
from fti.ranging.laser import Laser
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import NARROW, WIDE
from fti.ranging.sensor import RangingSensor
from fti.study.slant_range.scenarios import RangingScenario, approach, low_level
from fti.terrain.terrain import Terrain

#: Maximum range [m].  Radar altimeters for aircraft end at 762 m (2500 ft), those of the source's figures do not.
FARTHEST_M = 4000.0
#: Orders of the domes: 2051 rays for results, 8101 rays for plots, so that single rays do not show.
ORDER, FINE = 20, 40
#: Period of measurements on the approach and on the low-level flight [s].
EVERY_S = {"approach": 3.0, "low_level": 0.5}
SCENARIOS: dict[str, Callable[[int, float], RangingScenario]] = {"approach": approach, "low_level": low_level}
GROUNDS = ("flat", "rough")


@functools.cache
def sensors(order: int) -> dict[str, RangingSensor]:
    """Half power 15 deg off the boresight, and 35 deg in roll; receiver noise as in the radar model."""
    narrow = RadarAltimeter(antenna=NARROW, order=order, max_range=FARTHEST_M)
    return {
        "pencil": Laser(max_range=FARTHEST_M),
        "narrow": narrow,
        "wide": dataclasses.replace(narrow, antenna=WIDE),
    }


@dataclass(frozen=True, eq=False)
class AltimeterFlight:
    """A flight over terrain.  nadir : height above it (n,) [m]; measured : by sensor (n,) [m], NaN: no return."""

    flight: SampledFlight
    nadir: Array
    measured: dict[str, Array]

    def error(self, name: str) -> Array:
        """Measured minus nadir [m]."""
        return self.measured[name] - self.nadir


#: A flight of each kind over each ground: of (kind, ground).
Run = dict[tuple[str, str], AltimeterFlight]


def fly_all(seed: int) -> Run:
    """Both flights, over both grounds."""
    scenarios = {kind: make(seed, EVERY_S[kind]) for kind, make in SCENARIOS.items()}
    return {
        (kind, ground): fly(scenario.flight, scenario.ground(ground))
        for kind, scenario in scenarios.items()
        for ground in GROUNDS
    }


def fly(flight: SampledFlight, ground: Terrain, order: int = ORDER) -> AltimeterFlight:
    """Measure along the flight; receiver noise enters by its mean."""
    east, north, up = flight.origins_l.T
    poses = flight.poses()
    measured = {name: sensor.measure(ground, poses).slant_range for name, sensor in sensors(order).items()}
    return AltimeterFlight(flight, up - ground.up(east, north), measured)
