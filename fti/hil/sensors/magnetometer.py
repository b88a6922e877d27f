"""A magnetometer: the Earth's field, distorted by the iron of the aircraft, in the axes of the mounted sensor.

    field_s = (I + scale) R_mis mat_sb ((I + soft) field_b + hard) + noise

Hard iron is fixed in the aircraft; soft iron is magnetised by the Earth's field and distorts it.  The driver's encoder
applies step and range, 6.67 nT and +-2 G for the HMR2300.

Scale: 0.5 % of 1 G at most, noise: a resolution below 70 uG (Honeywell, data sheet 900139, features).  Iron and
misalignment are assumed: those of a light aircraft after a compass swing, the sensor in a wing tip.
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from fti.arrays import Array
from fti.config.keys import ONE, key
from fti.devices import BoundDevice
from fti.geodesy.magnetic import magnetic_field_n
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.environment import Environment, mounting
from fti.hil.flight.trajectory import FlightState
from fti.hil.sensors.sensor_settings import DeviceSettings, settings_of
from fti.hil.tables.fault_base import NotNegative
from fti.messages.measurements import MagneticField, Measurement, Stamp

#: Date of the magnetic model, the middle of its validity, because a flight has no date.
YEAR = 2027.5


def earth_field_n(state: FlightState) -> Array:
    """The Earth's field [T], north, east, down, shape (n, 3)."""
    return magnetic_field_n(state.lat, state.lon, state.alt, YEAR)


def earth_field_b(state: FlightState) -> Array:
    """The Earth's field [T] in the body frame, shape (n, 3)."""
    mat_nb = mat_from_rpy(state.roll, state.pitch, state.heading)
    return np.asarray(np.einsum("nji,nj->ni", mat_nb, earth_field_n(state)))


def declination(state: FlightState) -> Array:
    """Magnetic declination [rad], positive east, shape (n,)."""
    north, east, _ = earth_field_n(state).T
    return np.asarray(np.arctan2(east, north))


class MagnetometerSettings(DeviceSettings):
    """Magnetometers.

    Each error is constant in a flight.
    """

    hard_iron_ut: Annotated[NotNegative, key("1-sigma of the hard-iron error of each axis", "uT")] = 1.0
    soft_iron: Annotated[float, Field(ge=0, le=0.3), key("1-sigma of each element of the soft-iron matrix", ONE)] = (
        0.005
    )
    misalignment_deg: Annotated[
        float, Field(ge=0, le=30), key("1-sigma of each angle of the misalignment of the axes", "deg")
    ] = 0.3


class Magnetometer:
    """Three axes of a magneto-resistive sensor."""

    rate_hz = 20.0
    time_scale = None
    SCALE_SD, NOISE_SD = 0.003, 7e-9  # -, [T]

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        settings = settings_of(MagnetometerSettings, world.scenario, bound.device.name)
        hard = rng.normal(0.0, 1e-6 * settings.hard_iron_ut, 3)
        mat_soft = np.eye(3) + rng.normal(0.0, settings.soft_iron, (3, 3))
        mat_mis = mat_from_rpy(*rng.normal(0.0, math.radians(settings.misalignment_deg), 3))
        gain = 1.0 + rng.normal(0.0, self.SCALE_SD, 3)
        field_b = earth_field_b(world.state(t)) @ mat_soft.T + hard
        noise = rng.normal(0.0, self.NOISE_SD, (len(t), 3))
        self._field = field_b @ mounting(bound.device) @ mat_mis * gain + noise

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The field in the axes of the case."""
        x, y, z = self._field[k].tolist()
        return [MagneticField(stamp=stamp, field_b=(x, y, z))]
