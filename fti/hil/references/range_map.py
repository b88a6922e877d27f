"""What an altimeter sees along an approach, traced once on a lattice: thousands of approaches by looking it up.

The lattice holds z = alt - range on the glide path over s (5 m), y (10 m), roll off the track's bank and pitch (3 deg);
between its points it is linear, beyond it its edge counts: over 4 sigma of a nominal track, 2 to 3 of its attitude.
z hardly depends on the height flown, or on the crab of a round beam: these are left out.  A test says how far it is
from tracing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.hil.references.approaches import NOMINAL, AltimeterModel, TerrainGround, flown_altitude
from fti.nav.integrity.approach import ApproachPath
from fti.terrain.kernel import kernel

Array = NDArray[np.float64]

#: Steps and begins of s, y [m], and of roll and pitch [rad] about their means; s goes as far beyond its end.
STEP_S, STEP_Y, STEP_TILT = 5.0, 10.0, float(np.radians(3.0))
BEGIN_S, BEGIN_Y, BEGIN_TILT = -50.0, -20.0, -STEP_TILT


@dataclass(frozen=True, eq=False)
class MappedGround:
    """Ground as a lattice of z [m], one for each terrain, shape (len(s), len(y), 3, 3)."""

    path: ApproachPath
    altimeter: AltimeterModel
    lattices: tuple[Array, ...]

    def ranges(self, pose: Array, rng: np.random.Generator) -> Array:
        """Ranges [m] along poses, rows s, y, alt, roll, pitch, crab; NaN where the lattice has none."""
        lattice = self.lattices[rng.integers(len(self.lattices))]
        s, y, alt, roll, pitch = pose[:5]
        off = roll - self.path.bank(s)
        return np.asarray(alt - _look_up(lattice, s, y, off, pitch - NOMINAL.pitch_mean))


def map_ground(ground: TerrainGround, s_max: float, told: Callable[[float], None]) -> MappedGround:
    """Trace the lattices up to s_max [m].  told : the share that is done."""
    lattices = []
    for terrain in ground.terrains:
        lattices.append(_trace(TerrainGround(ground.path, ground.altimeter, (terrain,)), s_max))
        told(len(lattices) / len(ground.terrains))
    return MappedGround(ground.path, ground.altimeter, tuple(lattices))


def _axes(s_max: float) -> tuple[Array, Array, Array, Array]:
    tilts = np.array([-STEP_TILT, 0.0, STEP_TILT])
    return (
        np.arange(BEGIN_S, s_max - BEGIN_S + 1.0, STEP_S),
        np.arange(BEGIN_Y, -BEGIN_Y + 1.0, STEP_Y),
        tilts,
        tilts,
    )


def _trace(ground: TerrainGround, s_max: float) -> Array:
    s, y, roll, pitch = np.meshgrid(*_axes(s_max), indexing="ij")
    alt = flown_altitude(ground.path, s, np.zeros_like(s))
    roll += ground.path.bank(s)
    pose = np.stack([axis.ravel() for axis in (s, y, alt, roll, pitch + NOMINAL.pitch_mean, np.zeros_like(s))])
    return np.asarray(alt - ground.ranges(pose, np.random.default_rng(0)).reshape(s.shape))


@kernel
def _look_up(z: Array, s: Array, y: Array, roll: Array, pitch: Array) -> Array:
    found = np.empty(len(s))
    for k in range(len(s)):
        u = min(max((s[k] - BEGIN_S) / STEP_S, 0.0), z.shape[0] - 1.001)
        v = min(max((y[k] - BEGIN_Y) / STEP_Y, 0.0), z.shape[1] - 1.001)
        w = min(max((roll[k] - BEGIN_TILT) / STEP_TILT, 0.0), z.shape[2] - 1.001)
        x = min(max((pitch[k] - BEGIN_TILT) / STEP_TILT, 0.0), z.shape[3] - 1.001)
        total = 0.0
        for corner in range(16):
            i, j, m, n = int(u) + corner % 2, int(v) + corner // 2 % 2, int(w) + corner // 4 % 2, int(x) + corner // 8
            weight = (1.0 - abs(u - i)) * (1.0 - abs(v - j)) * (1.0 - abs(w - m)) * (1.0 - abs(x - n))
            total += weight * z[i, j, m, n]
        found[k] = total
    return found
