"""Units on ARINC 429, with the measurements of all built-in label sets.

Localizer and glide slope are those of the scenario's approach: 0.00145 DDM for a metre at the threshold, with the
antenna 300 m behind the runway, and 0.0875 DDM for 0.12 of the glide angle (ICAO Annex 10, volume I, 3.1.3.7.1 and
3.1.5.6.2); bends 0.005 and 0.01 DDM, within the limits of 3.1.3.4 and 3.1.5.4 for a facility of category I.
"""

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array
from fti.devices import BoundDevice
from fti.drivers.arinc429 import Options, enabled_labels
from fti.hil.environment import Environment
from fti.hil.flight.trajectory import FlightState
from fti.hil.sensors.avionics import Avionics
from fti.hil.sensors.dme import Interrogator
from fti.hil.sensors.errors import gauss_markov_noise
from fti.hil.sensors.imu_grades import ImuSettings
from fti.hil.sensors.inertial import inertial_samples
from fti.hil.sensors.magnetometer import declination
from fti.hil.sensors.sensor_settings import settings_of
from fti.messages.measurements import Deviation, DeviceStatus, Measurement, Reading, Stamp, Temperature, TimeScale

#: SI units of the readings; others are dimensionless.
UNITS = {
    "magnetic_heading": "rad",
    "roll_rate": "rad/s",
    "pitch_rate": "rad/s",
    "yaw_rate": "rad/s",
    "longitudinal_acceleration": "m/s2",
    "lateral_acceleration": "m/s2",
    "normal_acceleration": "m/s2",
    "inertial_altitude": "m",
    "total_pressure": "Pa",
    "baro_setting": "Pa",
    "horizontal_integrity_limit": "m",
    "vertical_integrity_limit": "m",
}

#: Readings of the inertial sensors besides the attitude; accelerations forward, right, up.
INERTIAL = (
    "magnetic_heading",
    "roll_rate",
    "pitch_rate",
    "yaw_rate",
    "longitudinal_acceleration",
    "lateral_acceleration",
    "normal_acceleration",
    "inertial_altitude",
)
#: Mode 01100 is navigation, 01000 acquisition (label 273; Esterline CMA-5024).
MODE_NAVIGATION, MODE_ACQUISITION = 12.0, 8.0
#: Integrity limits against sigma, horizontal (non-precision approach) and vertical: RTCA DO-229, J.2.1.
K_HORIZONTAL, K_VERTICAL = 6.18, 5.33
MAX_SATELLITES = 15  # in four bits


class IlsReceiver:
    """Localizer and glide-slope deviation on the scenario's approach."""

    ANTENNA_BEHIND_RUNWAY_M = 300.0
    DDM_PER_M, DDM_AT_012_GLIDE = 0.00145, 0.0875
    LOCALIZER_BEND, GLIDE_BEND, BEND_S = 0.005, 0.01, 4.0

    def __init__(self, state: FlightState, world: Environment, t: Array, rng: np.random.Generator) -> None:
        path = world.path
        s, y = path.to_path(state.lat, state.lon)
        to_antenna = path.airfield.runway_length_m + self.ANTENNA_BEHIND_RUNWAY_M
        distance = np.maximum(s - path.x_gpi + to_antenna, 1.0)
        localizer = -self.DDM_PER_M * y * to_antenna / distance + gauss_markov_noise(
            t, self.LOCALIZER_BEND, self.BEND_S, rng
        )
        elevation = np.arctan2(state.alt - path.alt_path(0.0), s)
        glide = self.DDM_AT_012_GLIDE * (elevation - path.glide) / (0.12 * path.glide)
        glide = np.where(s > 0.0, glide + gauss_markov_noise(t, self.GLIDE_BEND, self.BEND_S, rng), np.nan)
        self._deviations = np.column_stack([localizer, glide])

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """Both deviations; no glide slope over the runway."""
        localizer, glide = self._deviations[k].tolist()
        return [Deviation(stamp=stamp, localizer_ddm=localizer, glide_slope_ddm=None if math.isnan(glide) else glide)]


class ArincUnit:
    """Heading reference, air data, altimeter, receivers of DME, ILS and GNSS; only enabled labels are sent."""

    rate_hz = 20.0
    time_scale = TimeScale.BOOT

    def __init__(self, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator) -> None:
        state = world.state(t)
        self._avionics = Avionics(bound, world, t, rng)
        self._receivers = (Interrogator(state, world, t, rng), IlsReceiver(state, world, t, rng))
        grade = settings_of(ImuSettings, world.scenario, bound.device.name).grade
        force, rates = inertial_samples(grade, bound, world, state, rng)
        heading = (state.heading - declination(state)) % (2 * np.pi)
        alt_msl = state.alt - world.undulation + gauss_markov_noise(t, 5.0, 300.0, rng)
        upward = [1.0, 1.0, -1.0]  # of the normal acceleration: gravity in level flight
        self._rows = np.column_stack([heading, rates, force * upward, alt_msl])
        options = bound.options
        equipment = enabled_labels(options).equipment if isinstance(options, Options) else None
        self._equipment = {"equipment_id": float(int(equipment, 16))} if equipment else {}

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """All measurements, then equipment identifier and status."""
        measurements = self._avionics.measure(k, stamp)
        for receiver in self._receivers:
            measurements += receiver.measure(k, stamp)
        static, impact, temperature = self._avionics.air(k)
        mach = math.sqrt(5.0 * ((impact / static + 1.0) ** (1 / 3.5) - 1.0))
        readings: dict[str, float | None] = {"mach": mach, "total_pressure": static + impact}
        readings["baro_setting"] = self._avionics.setting_pa
        readings |= dict(zip(INERTIAL, self._rows[k].tolist(), strict=True)) | self._equipment
        measurements += _readings(stamp, readings | self._gnss(k, stamp))
        total = temperature * (1.0 + 0.2 * mach**2)
        return [*measurements, Temperature(stamp=stamp, total=total), DeviceStatus(stamp=stamp, ok=True)]

    def _gnss(self, k: int, stamp: Stamp) -> dict[str, float | None]:
        """Status of the receiver; without a fix it computes neither dilution nor integrity limits."""
        sky, position = self._avionics.satellites(k, stamp), self._avionics.position(k, stamp)
        horizontal, vertical = position.horizontal_sd, position.vertical_sd
        used = float(min(sky.used or 0, MAX_SATELLITES))
        return {
            "hdop": sky.hdop,
            "vdop": sky.vdop,
            "horizontal_integrity_limit": None if horizontal is None else K_HORIZONTAL * math.sqrt(2.0) * horizontal,
            "vertical_integrity_limit": None if vertical is None else K_VERTICAL * vertical,
            "satellites_visible": used,
            "satellites_used": used,
            "gnss_mode": MODE_NAVIGATION if position.valid else MODE_ACQUISITION,
        }


def _readings(stamp: Stamp, values: dict[str, float | None]) -> list[Measurement]:
    """Readings by name; one without a value is invalid."""
    return [
        Reading(stamp=stamp, name=name, value=value, unit=UNITS.get(name, ""), valid=value is not None)
        for name, value in values.items()
    ]
