"""Navigation satellites in their nominal orbits, and their directions and ranges from a receiver on the Earth.

Circular orbits in Walker constellations: GPS 24 satellites in 6 planes (SPS Performance Standard, 5th edition),
GLONASS 24 in 3 (ICD 5.1), Galileo 24 in 3 (OS Service Definition 1.3).  Their positions are plausible, not those of the
real satellites.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.constants import SPEED_OF_LIGHT
from fti.geodesy.formulas import EARTH_RATE

#: Gravitational constant of the Earth [m^3/s^2] (IS-GPS-200).
GM = 3.986005e14
#: Channels of the 24 GLONASS slots (two satellites on opposite sides of an orbit share one).
GLONASS_CHANNELS = (1, -4, 5, 6, 1, -4, 5, 6, -2, -7, 0, -1, -2, -7, 0, -1, 4, -3, 3, 2, 4, -3, 3, 2)
#: Between two channels of GLONASS on L1 [Hz] (ICD 5.1, 3.3.1.1).
L1_STEP_HZ = 0.5625e6


class Walker(NamedTuple):
    """A system: semi-major axis [m], inclination [rad], planes, satellites in each, phasing, carrier of L1 (of GLONASS:
    of channel 0) [Hz]."""

    system: str
    radius: float
    inclination: float
    planes: int
    in_plane: int
    phasing: int
    carrier: float
    signal: str


SYSTEMS = (
    Walker("gps", 26_559.7e3, np.deg2rad(55.0), 6, 4, 2, 1575.42e6, "L1C"),
    Walker("glonass", 25_508.0e3, np.deg2rad(64.8), 3, 8, 1, 1602.0e6, "L1C"),
    Walker("galileo", 29_600.3e3, np.deg2rad(56.0), 3, 8, 1, 1575.42e6, "L1C"),
)


class SatellitesInView(NamedTuple):
    """Satellites in view, arrays of shape (n,): index of the satellite, azimuth, elevation [rad], range [m], its rate
    [m/s]."""

    which: NDArray[np.int64]
    azimuth: Array
    elevation: Array
    distance: Array
    rate: Array

    def select(self, mask: NDArray[np.bool_]) -> SatellitesInView:
        """The satellites of a mask, shape (n,)."""
        return SatellitesInView(
            self.which[mask], self.azimuth[mask], self.elevation[mask], self.distance[mask], self.rate[mask]
        )


class Constellation:
    """All satellites; ``keys`` [(system, number)], ``carriers`` [Hz] and ``signals`` in the order of the index."""

    def __init__(self) -> None:
        self.keys = [(w.system, i + 1) for w in SYSTEMS for i in range(w.planes * w.in_plane)]
        self.carriers = np.array([_carrier(w, i) for w in SYSTEMS for i in range(w.planes * w.in_plane)])
        self.signals = [w.signal for w in SYSTEMS for _ in range(w.planes * w.in_plane)]
        orbits = [_orbits(w) for w in SYSTEMS]
        self._radius, self._rate, self._inclination, self._node, self._phase = np.concatenate(orbits, axis=1)

    def state(self, t: float | Array) -> tuple[Array, Array]:
        """Positions and velocities at t [s], shape (n, 3) [m], [m/s], in axes that do not turn with the Earth."""
        angle = self._phase + self._rate * t
        along = np.stack(
            [np.cos(angle), np.sin(angle) * np.cos(self._inclination), np.sin(angle) * np.sin(self._inclination)]
        )
        tangent = np.stack(
            [-np.sin(angle), np.cos(angle) * np.cos(self._inclination), np.cos(angle) * np.sin(self._inclination)]
        )
        position, velocity = (
            self._radius * _rotate(along, self._node),
            self._radius * self._rate * _rotate(tangent, self._node),
        )
        return position.T, velocity.T

    def satellites_in_view(
        self, t: float, position_e: Array, velocity_e: Array, mat_en: Array, mask: float
    ) -> SatellitesInView:
        """Satellites above ``mask`` [rad] at time t [s], with the signal's travel time.

        position_e, velocity_e : receiver, shape (3,) [m], [m/s], e frame; mat_en : its level axes, n to e
        """
        turn = EARTH_RATE * t
        here = _rotate(position_e, turn)
        moving = _rotate(velocity_e + np.cross([0.0, 0.0, EARTH_RATE], position_e), turn)
        at, _ = self.state(t)
        for _ in range(2):
            at, velocity = self.state(t - np.linalg.norm(at - here, axis=1) / SPEED_OF_LIGHT)
        line = at - here
        distance = np.linalg.norm(line, axis=1)
        unit = line / distance[:, None]
        level = _rotate(unit.T, -turn).T @ mat_en  # north, east, down
        elevation = -np.arcsin(level[:, 2])
        index = np.flatnonzero(elevation > mask)
        azimuth = np.arctan2(level[:, 1], level[:, 0]) % (2 * np.pi)
        rate = np.sum((velocity - moving) * unit, axis=1)
        return SatellitesInView(index, azimuth[index], elevation[index], distance[index], rate[index])

    def directions(self, t: Array, position_e: Array, mats_en: Array) -> tuple[Array, Array]:
        """Azimuth and elevation [rad] of all satellites, (n, satellites), at times t (n,) [s]; error 1e-5 rad, because
        the signal's travel time is neglected.

        position_e : receiver, shape (n, 3) [m], e frame; mats_en : its level axes, n to e, shape (n, 3, 3)
        """
        turn = EARTH_RATE * t
        at = _rotate(self.state(t[:, None])[0].T, -turn[:, None])
        line_e = at - position_e.T[:, :, None]
        north, east, down = np.einsum("cns,ncl->lns", line_e, mats_en) / np.linalg.norm(line_e, axis=0)
        return np.arctan2(east, north) % (2 * np.pi), -np.arcsin(down)


def _carrier(w: Walker, index: int) -> float:
    return w.carrier + (L1_STEP_HZ * GLONASS_CHANNELS[index] if w.system == "glonass" else 0.0)


def _orbits(w: Walker) -> Array:
    """Radius, rate, inclination, node and phase of each satellite, shape (5, n)."""
    plane, slot = np.divmod(np.arange(w.planes * w.in_plane), w.in_plane)
    node = 2 * np.pi * plane / w.planes
    phase = 2 * np.pi * (slot / w.in_plane + w.phasing * plane / (w.planes * w.in_plane))
    same = np.ones(len(plane))
    return np.stack([w.radius * same, np.sqrt(GM / w.radius**3) * same, w.inclination * same, node, phase])


def _rotate(vector: Array, angle: float | Array) -> Array:
    """Vectors, shape (3,) or (3, n), rotated about the axis of the Earth."""
    x, y, z = vector
    return np.stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), z])


def dilution(azimuth: Array, elevation: Array) -> tuple[float, float, float]:
    """Horizontal, vertical and position dilution of precision of satellites in these directions [rad].

    Raises ValueError with fewer than four, or when they do not fix a position.
    """
    level = np.cos(elevation)
    design = np.stack(
        [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation), np.ones_like(azimuth)], axis=1
    )
    if len(design) < 4 or np.linalg.matrix_rank(design) < 4:
        raise ValueError("these satellites do not fix a position")
    q = np.diag(np.linalg.inv(design.T @ design))
    return float(np.sqrt(q[0] + q[1])), float(np.sqrt(q[2])), float(np.sqrt(q[:3].sum()))
