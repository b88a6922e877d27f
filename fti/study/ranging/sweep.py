"""Fig. 2.50: return of level ground over roll and range, with a narrow and a wide antenna."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import NARROW, WIDE
from fti.ranging.radar.beam import trace_beam
from fti.ranging.sensor import Poses
from fti.terrain.terrain import Terrain

ANTENNAS = {"narrow": NARROW, "wide": WIDE}
HEIGHTS_M = (100.0, 400.0, 800.0)
ROLLS_DEG = np.arange(0.0, 75.1, 1.0)
#: Maximum range of an altimeter (2.1.4) [m]; the plots extend beyond it.
D_MAX = 1000.0
FARTHEST_M = 3000.0
ORDER = 40


def highest(roll: ArrayLike, d_max: float = D_MAX) -> Array:
    """Greatest height [m] from which the boresight still meets level ground within d_max [m], at a roll [rad].

        h_max = d_max cos(roll)
    Source: Spiegel 2018, eq. 2.84, which is printed the other way round: d_max = h cos(roll).
    """
    return np.asarray(d_max * np.cos(roll))


@dataclass(frozen=True, eq=False)
class Sweep:
    """Of each roll: spectrum (roll, bin) [received over transmitted power], leading edge and dispersion [m]."""

    height: float
    ranges: Array
    spectra: Array
    edge: Array
    dispersion: Array

    @property
    def error(self) -> Array:
        """Leading edge against the height, over the height."""
        return self.edge / self.height - 1.0


def sweep(antenna: str, height: float) -> Sweep:
    """Roll from 0 to 75 deg at a height [m] over level ground."""
    radar = RadarAltimeter(antenna=ANTENNAS[antenna], order=ORDER, max_range=FARTHEST_M)
    ground = Terrain.from_array(np.zeros((3, 3)), 10_000.0, east0=-10_000.0, north0=-10_000.0)
    roll = np.radians(ROLLS_DEG)
    mats = MAT_ENU_NED @ mat_from_rpy(roll, np.zeros_like(roll), np.zeros_like(roll))
    poses = Poses.stationary(np.tile([0.0, 0.0, height], (len(roll), 1)), mats)
    spectra = radar.spectra(trace_beam(ground, poses, radar.beam, radar.ground, FARTHEST_M))
    returns = radar.measure(ground, poses)
    return Sweep(height, radar.baseband.ranges, spectra, returns.slant_range, returns.dispersion)
