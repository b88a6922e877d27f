"""Three altimeters on one flight: what each measured, and what it should have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.ranging.laser import Laser
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import NARROW, WIDE
from fti.ranging.sensor import RangingSensor
from fti.study._flights import Flight
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]

#: Radar altimeters for aircraft end at 762 m (2500 ft); those of the source's figures do not, nor do these [m].
FARTHEST_M = 4000.0
#: Half power off the boresight: 15 deg, and 35 deg in roll; 0.4 W, receiver noise as it comes with the sensor.
SENSORS: dict[str, RangingSensor] = {
    "pencil": Laser(max_range=FARTHEST_M),
    "narrow": RadarAltimeter(antenna=NARROW, max_range=FARTHEST_M),
    "wide": RadarAltimeter(antenna=WIDE, max_range=FARTHEST_M),
}


@dataclass(frozen=True, eq=False)
class Flown:
    """A flight over a ground.  nadir : height above it (n,) [m]; measured : of each sensor (n,) [m], NaN: nothing."""

    flight: Flight
    nadir: Array
    measured: dict[str, Array]

    def error(self, name: str) -> Array:
        """Measured minus nadir [m]."""
        return self.measured[name] - self.nadir


def fly(flight: Flight, ground: Terrain) -> Flown:
    """Measure all along the flight, without noise."""
    east, north, up = flight.origins_l.T
    poses = flight.poses()
    measured = {name: sensor.measure(ground, poses).slant_range for name, sensor in SENSORS.items()}
    return Flown(flight, up - ground.up(east, north), measured)
