"""Model of air data: probes, tubes and an air-data computer.

    p_s = lag(p + C_p q_c) + error          static port with position error, a share of the impact pressure
    q   = lag(p + q_c) - p_s                pitot minus static pressure, with the opposite position error
    H   = H_standard(p_s)                   altitude at 1013.25 hPa; at a setting B: H - H_standard(B)
    Mach, CAS, TAS                          from q, p_s and the air temperature, subsonic

The flow is the velocity of the flight against the air, gusts included: vanes measure the sideslip of side gusts.

Source: ISO 2533 (constants); Gracey 1980, NASA RP-1046, chapters 2, 3 and 10 (airspeed, position error, lag of tubes);
FAR 23.1325(e): 30 ft per 100 kt of position error are allowed, C_p = 0.07.  C_p of 0.01 and lags of 0.1 s (static) and
0.05 s (pitot) are assumed: a boom with short tubes.  So are the sizes of the errors of transducers and vanes.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from fti.arrays import Array
from fti.config.keys import ONE, key
from fti.devices import BoundDevice
from fti.geodesy.atmosphere import GAS_CONSTANT, ISA_PRESSURE, pressure_altitude
from fti.hil.environment import HEAT_RATIO, Environment, calibrated_airspeed, impact_pressure
from fti.hil.flight.trajectory import FlightState
from fti.hil.sensors.errors import first_order_lag, gauss_markov_noise, white_noise
from fti.hil.sensors.sensor_settings import DeviceSettings, settings_of
from fti.messages.measurements import (
    Airspeed,
    FlowAngles,
    ImpactPressure,
    Measurement,
    PressureAltitude,
    Stamp,
    StaticPressure,
    Temperature,
)

Lag = Annotated[float, Field(ge=0, le=10)]

STANDARD_PA = ISA_PRESSURE


class AirSettings(DeviceSettings):
    """Air-data computers."""

    static_error: Annotated[
        float,
        Field(ge=-0.2, le=0.2),
        key("position error of the static port: share of the impact pressure that it adds", ONE),
    ] = 0.01
    static_lag_s: Annotated[Lag, key("time constant of the static tubes", "s")] = 0.1
    pitot_lag_s: Annotated[Lag, key("time constant of the pitot tubes", "s")] = 0.05
    altimeter_hpa: Annotated[
        Annotated[float, Field(ge=870, le=1085)] | None,
        key("altimeter setting of the crew; none: the QNH of the scenario", "hPa", 1013.25),
    ] = None


class AirData:
    """Pressures, temperature, speeds and flow angles of an air-data computer.

    setting_pa : altimeter setting [Pa]
    """

    PRESSURE_SD, IMPACT_SD, TEMPERATURE_SD, FLOW_SD = 8.0, 6.0, 0.3, np.deg2rad(0.2)

    def __init__(
        self, bound: BoundDevice, state: FlightState, world: Environment, t: Array, rng: np.random.Generator
    ) -> None:
        settings = settings_of(AirSettings, world.scenario, bound.device.name)
        alt_msl = state.alt - world.undulation
        temperature, p = world.atmosphere.temperature(alt_msl), world.atmosphere.p_static(alt_msl)
        q_c = impact_pressure(state.tas, p, temperature)
        at_port = first_order_lag(t, p + settings.static_error * q_c, settings.static_lag_s)
        self.p_static = at_port + gauss_markov_noise(t, self.PRESSURE_SD, 30.0, rng) + white_noise(t, 2.0, rng)
        total = first_order_lag(t, p + q_c, settings.pitot_lag_s)
        self.q_c = np.maximum(total - at_port + white_noise(t, self.IMPACT_SD, rng), 0.0)
        self.temperature = temperature + gauss_markov_noise(t, self.TEMPERATURE_SD, 60.0, rng)
        self.tas = true_airspeed(self.q_c, self.p_static, self.temperature)
        self.aoa = state.aoa + white_noise(t, self.FLOW_SD, rng)
        self.aos = state.aos + white_noise(t, self.FLOW_SD, rng)
        set_hpa = settings.altimeter_hpa
        self.setting_pa = world.atmosphere.qnh if set_hpa is None else 100.0 * set_hpa
        self._at_setting = float(pressure_altitude(self.setting_pa))
        pressures = (self.p_static, self.q_c, pressure_altitude(self.p_static), calibrated_airspeed(self.q_c))
        self._rows = np.column_stack([*pressures, self.tas, self.temperature, self.aoa, self.aos])

    def pressures(self, k: int) -> tuple[float, float, float]:
        """Static and impact pressure [Pa] and static temperature [K] of sample k."""
        p_static, q_c, _, _, _, temperature, _, _ = self._rows[k].tolist()
        return p_static, q_c, temperature

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """All measurements of sample k; altitude first at the standard setting, then at the crew's setting."""
        p_static, q_c, alt_press, cas, tas, temperature, aoa, aos = self._rows[k].tolist()
        return [
            StaticPressure(stamp=stamp, p_static=p_static),
            ImpactPressure(stamp=stamp, q_c=q_c),
            PressureAltitude(stamp=stamp, alt_press=alt_press, setting_pa=STANDARD_PA),
            PressureAltitude(stamp=stamp, alt_press=alt_press - self._at_setting),
            Airspeed(stamp=stamp, cas=cas, ias=cas, tas=tas),
            Temperature(stamp=stamp, static=temperature),
            FlowAngles(stamp=stamp, aoa=aoa, aos=aos),
        ]


def true_airspeed(q_c: ArrayLike, p_static: ArrayLike, temperature: ArrayLike) -> Array:
    """TAS [m/s] of impact and static pressure [Pa] and static air temperature [K], subsonic.

    Inverse of ``impact_pressure``.  Source: Gracey 1980, chapter 3.
    """
    mach_sq = 5.0 * ((np.asarray(q_c) / np.asarray(p_static) + 1.0) ** (1 / 3.5) - 1.0)
    return np.asarray(np.sqrt(mach_sq * HEAT_RATIO * GAS_CONSTANT * np.asarray(temperature)))
