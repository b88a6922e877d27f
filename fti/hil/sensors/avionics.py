"""Units whose messages are a table that the user can change: ARINC 429 labels, the signals of a DBC.

The model offers every quantity that it knows; the encoder sends those that the configuration has enabled.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fti.geodesy.atmosphere import pressure_altitude
from fti.hil.flight.trajectory import State
from fti.hil.sensors.altimeters import RadarAltimeter
from fti.hil.sensors.errors import slow, white
from fti.hil.sensors.reception import NAVIGATION, Reception
from fti.hil.world import World, calibrated_airspeed, impact_pressure
from fti.service.binding import BoundDevice
from fti.types import (
    Airspeed,
    Attitude,
    FlowAngles,
    ImpactPressure,
    Measurement,
    Position,
    PressureAltitude,
    Satellites,
    Stamp,
    StaticPressure,
    Temperature,
    Velocity,
)

Array = NDArray[np.float64]

STANDARD_PA = 101325.0


class AirData:
    """Pressures, temperature, speeds and flow angles of an air-data computer."""

    PRESSURE_SD, IMPACT_SD, TEMPERATURE_SD, FLOW_SD = 8.0, 6.0, 0.3, np.deg2rad(0.2)

    def __init__(self, state: State, world: World, t: Array, rng: np.random.Generator) -> None:
        alt_msl = state.alt - world.undulation
        temperature = world.atmosphere.temperature(alt_msl)
        p_static = world.atmosphere.p_static(alt_msl)
        q_c = impact_pressure(state.tas, p_static, temperature)
        self.p_static = p_static + slow(t, self.PRESSURE_SD, 30.0, rng) + white(t, 2.0, rng)
        self.q_c = np.maximum(q_c + white(t, self.IMPACT_SD, rng), 0.0)
        self.temperature = temperature + slow(t, self.TEMPERATURE_SD, 60.0, rng)
        self.tas = state.tas + slow(t, 0.3, 30.0, rng)
        self.aoa = state.aoa + white(t, self.FLOW_SD, rng)
        self.aos = white(t, self.FLOW_SD, rng)
        self._to_qnh = float(pressure_altitude(world.atmosphere.qnh))

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """All that an air-data computer says."""
        p_static, q_c = float(self.p_static[k]), float(self.q_c[k])
        alt_press, cas = float(pressure_altitude(p_static)), float(calibrated_airspeed(q_c))
        return [
            StaticPressure(stamp=stamp, p_static=p_static),
            ImpactPressure(stamp=stamp, q_c=q_c),
            PressureAltitude(stamp=stamp, alt_press=alt_press, setting_pa=STANDARD_PA),
            PressureAltitude(stamp=stamp, alt_press=alt_press - self._to_qnh),
            Airspeed(stamp=stamp, cas=cas, ias=cas, tas=float(self.tas[k])),
            Temperature(stamp=stamp, static=float(self.temperature[k])),
            FlowAngles(stamp=stamp, aoa=float(self.aoa[k]), aos=float(self.aos[k])),
        ]


class Reference:
    """Attitude of a heading reference, worse than an inertial navigation system, with a satellite receiver in it."""

    ATTITUDE_SD, HEADING_SD = np.deg2rad(0.3), np.deg2rad(0.8)

    def __init__(self, bound: BoundDevice, state: State, world: World, t: Array, rng: np.random.Generator) -> None:
        self.roll = state.roll + slow(t, self.ATTITUDE_SD, 60.0, rng)
        self.pitch = state.pitch + slow(t, self.ATTITUDE_SD, 60.0, rng)
        self.heading = (state.heading + slow(t, self.HEADING_SD, 60.0, rng)) % (2 * np.pi)
        self._receiver = Reception(bound, NAVIGATION, world, t, rng)

    def attitude(self, k: int, stamp: Stamp) -> Attitude:
        """Roll, pitch and heading of sample k."""
        return Attitude(
            stamp=stamp, roll=float(self.roll[k]), pitch=float(self.pitch[k]), heading=float(self.heading[k])
        )

    def position(self, k: int, stamp: Stamp) -> Position:
        """Position of sample k: that of the receiver."""
        return self._receiver.position(k, stamp)

    def velocity(self, k: int, stamp: Stamp) -> Velocity:
        """Velocity of sample k: that of the receiver."""
        return self._receiver.velocity(k, stamp)

    def satellites(self, k: int, stamp: Stamp) -> Satellites:
        """Satellites used and dilution of precision of sample k."""
        return self._receiver.satellites(k, stamp)


class Avionics:
    """Heading reference, air-data computer and, where the device is an altimeter, radar altimeter in one."""

    rate_hz = 20.0
    time_scale = None

    def __init__(self, bound: BoundDevice, world: World, t: Array, rng: np.random.Generator) -> None:
        state = world.state(t)
        self._reference = Reference(bound, state, world, t, rng)
        self._air = AirData(state, world, t, rng)
        self._radar = RadarAltimeter(bound, world, t, rng) if bound.device.altimeter else None

    def air(self, k: int) -> tuple[float, float, float]:
        """Static and impact pressure [Pa] and static temperature [K] of sample k."""
        return float(self._air.p_static[k]), float(self._air.q_c[k]), float(self._air.temperature[k])

    def position(self, k: int, stamp: Stamp) -> Position:
        """Position of sample k: that of the receiver."""
        return self._reference.position(k, stamp)

    def satellites(self, k: int, stamp: Stamp) -> Satellites:
        """Satellites used and dilution of precision of sample k."""
        return self._reference.satellites(k, stamp)

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Everything; what is not enabled is not sent."""
        reference = self._reference
        found: list[Measurement] = [
            reference.attitude(k, stamp),
            reference.position(k, stamp),
            reference.velocity(k, stamp),
            *self._air.measure(k, stamp),
        ]
        return found + (self._radar.measure(k, stamp) if self._radar else [])
