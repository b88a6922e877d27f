"""A magnetometer: the Earth's field as a tilted dipole, seen from the case, with the iron of the aircraft."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.geodesy.rotations import mat_from_rpy
from fti.hil.flight.trajectory import State
from fti.hil.world import World, mounting
from fti.service.binding import BoundDevice
from fti.types import MagneticField, Measurement, Stamp

Array = NDArray[np.float64]

#: First degree of the International Geomagnetic Reference Field, IGRF-13, epoch 2020 [T]: g10, g11, h11.
DIPOLE = (-29404.8e-9, -1450.9e-9, 4652.5e-9)
EARTH_RADIUS = 6371.2e3


def earth_field_n(lat: Array, lon: Array, alt: Array) -> Array:
    """The Earth's field [T], north, east, down, shape (n, 3), of the dipole alone.

    lat, lon [rad], alt [m]; the sphere stands for the ellipsoid.  What a dipole leaves out is a fifth of the field
    and some ten degrees of its direction: enough for a line, not for a compass.  Source: IGRF-13, degree 1.
    """
    g10, g11, h11 = DIPOLE
    across = g11 * np.cos(lon) + h11 * np.sin(lon)
    north = -g10 * np.cos(lat) + across * np.sin(lat)
    east = g11 * np.sin(lon) - h11 * np.cos(lon)
    down = -2.0 * (g10 * np.sin(lat) + across * np.cos(lat))
    scale = (EARTH_RADIUS / (EARTH_RADIUS + alt)) ** 3
    return np.asarray(np.stack([north, east, down], axis=1) * scale[:, None])


def earth_field_b(state: State) -> Array:
    """The same [T] in the body frame, shape (n, 3)."""
    mat_nb = mat_from_rpy(state.roll, state.pitch, state.heading)
    return np.asarray(np.einsum("nji,nj->ni", mat_nb, earth_field_n(state.lat, state.lon, state.alt)))


class Magnetometer:
    """Three axes of a magneto-resistive sensor.

    Errors: iron of the aircraft that turns with it, scale (data sheet of the HMR2300: 0.5 % of 1 G), noise of a count.
    """

    rate_hz = 20.0
    time_scale = None
    IRON_SD, SCALE_SD, NOISE_SD = 1.0e-6, 0.003, 7e-9  # [T], -, [T]

    def __init__(self, bound: BoundDevice, world: World, t: Array, rng: np.random.Generator) -> None:
        field_b = earth_field_b(world.state(t)) + rng.normal(0.0, self.IRON_SD, 3)
        field_s = field_b @ mounting(bound.device)
        noise = rng.normal(0.0, self.NOISE_SD, (len(t), 3))
        self._field = field_s * (1.0 + rng.normal(0.0, self.SCALE_SD, 3)) + noise

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The field in the axes of the case."""
        x, y, z = map(float, self._field[k])
        return [MagneticField(stamp=stamp, field_b=(x, y, z))]
