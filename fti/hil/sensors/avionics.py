"""Units with configurable messages: ARINC 429 labels, signals of a DBC.

The model provides all its quantities; the encoder sends those that the configuration enables.
"""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.devices import BoundDevice
from fti.hil.environment import Environment
from fti.hil.flight.trajectory import FlightState
from fti.hil.sensors.air_data import AirData
from fti.hil.sensors.altimeters import RadarAltimeterModel
from fti.hil.sensors.errors import gauss_markov_noise
from fti.hil.sensors.gnss_reception import NAVIGATION, Reception
from fti.messages.measurements import Attitude, Measurement, Position, Satellites, Stamp, Velocity


class HeadingReference:
    """A heading reference, less accurate than an inertial navigation system, with a satellite receiver."""

    ATTITUDE_SD, HEADING_SD = np.deg2rad(0.3), np.deg2rad(0.8)

    def __init__(
        self, bound: BoundDevice, state: FlightState, world: Environment, t: Array, rng: np.random.Generator
    ) -> None:
        roll = state.roll + gauss_markov_noise(t, self.ATTITUDE_SD, 60.0, rng)
        pitch = state.pitch + gauss_markov_noise(t, self.ATTITUDE_SD, 60.0, rng)
        heading = (state.heading + gauss_markov_noise(t, self.HEADING_SD, 60.0, rng)) % (2 * np.pi)
        self._rpy = np.column_stack([roll, pitch, heading])
        self._receiver = Reception(bound, NAVIGATION, world, t, rng)

    def attitude(self, k: int, stamp: Stamp) -> Attitude:
        """Roll, pitch and heading of sample k."""
        roll, pitch, heading = self._rpy[k].tolist()
        return Attitude(stamp=stamp, roll=roll, pitch=pitch, heading=heading)

    def position(self, k: int, stamp: Stamp) -> Position:
        """Position of sample k from the receiver."""
        return self._receiver.position(k, stamp)

    def velocity(self, k: int, stamp: Stamp) -> Velocity:
        """Velocity of sample k from the receiver."""
        return self._receiver.velocity(k, stamp)

    def satellites(self, k: int, stamp: Stamp) -> Satellites:
        """Satellites used and dilution of precision of sample k."""
        return self._receiver.satellites(k, stamp)


class Avionics:
    """Heading reference, air-data computer and, if the device is an altimeter, radar altimeter in one unit."""

    rate_hz = 20.0
    time_scale = None

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        state = world.state(t)
        self._reference = HeadingReference(bound, state, world, t, rng)
        self._air = AirData(bound, state, world, t, rng)
        self._radar = RadarAltimeterModel(bound, world, t, rng) if bound.device.altimeter else None

    def air(self, k: int) -> tuple[float, float, float]:
        """Static and impact pressure [Pa] and static temperature [K] of sample k."""
        return self._air.pressures(k)

    @property
    def setting_pa(self) -> float:
        """Altimeter setting [Pa]."""
        return self._air.setting_pa

    def position(self, k: int, stamp: Stamp) -> Position:
        """Position of sample k from the receiver."""
        return self._reference.position(k, stamp)

    def satellites(self, k: int, stamp: Stamp) -> Satellites:
        """Satellites used and dilution of precision of sample k."""
        return self._reference.satellites(k, stamp)

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """All measurements of sample k; the encoder sends the enabled ones."""
        reference = self._reference
        measurements: list[Measurement] = [
            reference.attitude(k, stamp),
            reference.position(k, stamp),
            reference.velocity(k, stamp),
            *self._air.measure(k, stamp),
        ]
        return measurements + (self._radar.measure(k, stamp) if self._radar else [])
