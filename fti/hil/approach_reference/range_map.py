"""Lookup tables of the ranges of receivers along an approach, for thousands of simulated approaches.

A lattice has z = alt - range on the glide path over s (5 m), y (12.5 m), roll minus the bank of the track, and pitch
(3 deg), with linear interpolation, and edge values outside: more than 3 sigma of a nominal track, 2 to 3 of its
attitude.  Each receiver of each terrain has one; the rays of a terrain are cast once for all its receivers.  z hardly
depends on the height flown, or on the crab of a round beam: these are neglected.  A test limits the error.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.hil.approach_reference.approaches import NOMINAL, AltimeterModel, TerrainGround, approach_altitude
from fti.hil.approach_reference.options import TaskRunner, run_serially
from fti.hil.approach_reference.receivers import ReceiverVariant, measure, stated_receiver
from fti.kernel import kernel
from fti.nav.integrity.approach import ApproachPath
from fti.terrain.terrain import Terrain

#: Steps and starts of s, y [m], and of roll and pitch about their means [rad]; s is symmetric beyond s_max.
STEP_S, STEP_Y, STEP_TILT = 5.0, 12.5, float(np.radians(3.0))
BEGIN_S, BEGIN_Y, BEGIN_TILT = -225.0, -50.0, -STEP_TILT
#: Length of the track that one task traces [m].
PIECE_M = 250.0


@dataclass(frozen=True, eq=False)
class MappedGround:
    """Ground as lattices of z [m], one for each receiver of each terrain, shape (len(s), len(y), 3, 3)."""

    path: ApproachPath
    altimeter: AltimeterModel
    lattices: tuple[NDArray[np.float32], ...]

    def ranges(self, pose: Array, rng: np.random.Generator) -> Array:
        """Ranges [m] along poses, rows s, y, alt, roll, pitch, crab; NaN without a return."""
        lattice = self.lattices[rng.integers(len(self.lattices))]
        s, y, alt, roll, pitch = pose[:5]
        roll_error = roll - self.path.bank(s)
        return np.asarray(alt - _look_up(lattice, s, y, roll_error, pitch - NOMINAL.pitch_mean))


def map_ground(
    ground: TerrainGround, s_max: float, progress: Callable[[float], None], run_all: TaskRunner = run_serially
) -> MappedGround:
    """Trace the lattices up to s_max [m].  progress : called with the completed share.

    The receivers of the ground are distributed over its terrains; without receivers the stated one is used.
    """
    receivers = ground.receivers or (stated_receiver(ground.altimeter.sensor),) * len(ground.terrains)
    s_axis, pieces = _axes(s_max)[0], []
    size = round(PIECE_M / STEP_S)
    for number in range(len(ground.terrains)):
        own = receivers[number :: len(ground.terrains)]
        pieces += [(number, own, s_axis[at : at + size]) for at in range(0, len(s_axis), size)]
    found = run_all(functools.partial(_trace, ground), pieces, progress)
    lattices = list[NDArray[np.float32]]()
    for number in range(len(ground.terrains)):
        whole = np.concatenate([z for z, piece in zip(found, pieces, strict=True) if piece[0] == number], axis=1)
        lattices += list(whole)
    return MappedGround(ground.path, ground.altimeter, tuple(lattices))


def _axes(s_max: float) -> tuple[Array, Array, Array]:
    return (
        np.arange(BEGIN_S, s_max - BEGIN_S + 1.0, STEP_S),
        np.arange(BEGIN_Y, -BEGIN_Y + 1.0, STEP_Y),
        np.array([-STEP_TILT, 0.0, STEP_TILT]),
    )


def _trace(ground: TerrainGround, piece: tuple[int, tuple[ReceiverVariant, ...], Array]) -> NDArray[np.float32]:
    """Lattices of a piece of the track over one terrain, shape (receivers, len(s), len(y), 3, 3)."""
    number, receivers, s_axis = piece
    terrain: Terrain = ground.terrains[number]
    _, y_axis, tilt = _axes(0.0)
    s, y = (axis.ravel() for axis in np.meshgrid(s_axis, y_axis, indexing="ij"))
    alt = approach_altitude(ground.path, s, np.zeros_like(s))
    level = np.zeros_like(s)
    pose = np.stack((s, y, alt, ground.path.bank(s), level + NOMINAL.pitch_mean, level))
    tilts = np.stack(np.meshgrid(tilt, tilt, indexing="ij"), axis=-1).reshape(-1, 2)
    z = alt[:, None, None] - measure(receivers, terrain, ground.poses(terrain, pose), tilts)
    return np.moveaxis(z, -1, 0).reshape(-1, len(s_axis), len(y_axis), 3, 3).astype(np.float32)


@kernel
def _look_up(z: NDArray[np.float32], s: Array, y: Array, roll: Array, pitch: Array) -> Array:
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
