"""The standard atmosphere, and air with another pressure at sea level and another temperature.

Where the air is dT warmer than the standard at the same pressure, the hydrostatic equation stretches every layer:

    dz = (1 + dT / T(H)) dH,    T(H) = T_0 - L H
    z - z_s = H - H_s + dT / L ln(T(H_s) / T(H)),    H_s = z_s + H(QNH)

with the pressure altitude H and the height z_s of the QNH station: a set altimeter is exact there at any temperature,
and has errors above it.  In air 20 K colder than standard it reads 22 m too much at 300 m above the station.  Valid in
the troposphere: below a pressure altitude of 11 km.

Source: ISO 2533 (constants, pressure and temperature by height); ICAO Doc 8168, volume I, part III (temperature
corrections).  Heights are taken as geopotential: the geometric one is 0.05 % larger at 3 km.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array

#: Sea level temperature [K], pressure [Pa], lapse [K/m], gas constant [J/(kg K)].
ISA_TEMPERATURE, ISA_PRESSURE, ISA_LAPSE, GAS_CONSTANT = 288.15, 101325.0, 0.0065, 287.05287
ISA_EXPONENT = 9.80665 / (ISA_LAPSE * GAS_CONSTANT)
#: Newton steps to the pressure altitude; each squares the relative error, initially 0.1.
_STEPS = 4


@dataclass(frozen=True, slots=True)
class Atmosphere:
    """Air of one pressure at sea level and one deviation from the standard temperature.

    qnh       : altimeter setting of the station [Pa]
    deviation : warmer than the standard at the same pressure [K]
    station   : height of the station above mean sea level [m]
    """

    qnh: float = ISA_PRESSURE
    deviation: float = 0.0
    station: float = 0.0

    def alt_msl(self, alt_press: ArrayLike) -> Array:
        """Height above mean sea level [m] where an altimeter on the standard setting shows ``alt_press`` [m]."""
        above = np.asarray(alt_press, dtype=np.float64)
        at_station = self.station + pressure_altitude(self.qnh)
        stretch = self.deviation / ISA_LAPSE * np.log(_standard(at_station) / _standard(above))
        return np.asarray(self.station + above - at_station + stretch)

    def pressure_altitude(self, alt_msl: ArrayLike) -> Array:
        """What an altimeter on the standard setting shows [m] at a height above mean sea level [m]."""
        wanted = np.asarray(alt_msl, dtype=np.float64)
        altitude = wanted + pressure_altitude(self.qnh)
        for _ in range(_STEPS):
            altitude = altitude + (wanted - self.alt_msl(altitude)) / (1.0 + self.deviation / _standard(altitude))
        return np.asarray(altitude)

    def p_static(self, alt_msl: ArrayLike) -> Array:
        """Static pressure [Pa] at a height above mean sea level [m]."""
        standard = _standard(self.pressure_altitude(alt_msl))
        return np.asarray(ISA_PRESSURE * (standard / ISA_TEMPERATURE) ** ISA_EXPONENT)

    def temperature(self, alt_msl: ArrayLike) -> Array:
        """Static air temperature [K] at a height above mean sea level [m]."""
        return np.asarray(_standard(self.pressure_altitude(alt_msl)) + self.deviation)


def _standard(alt_press: ArrayLike) -> Array:
    """Temperature of the standard atmosphere [K] at a pressure altitude [m]."""
    return np.asarray(ISA_TEMPERATURE - ISA_LAPSE * np.asarray(alt_press, dtype=np.float64))


def pressure_altitude(p_static: ArrayLike) -> Array:
    """Altitude [m] in the standard atmosphere of a static pressure [Pa]."""
    return np.asarray(ISA_TEMPERATURE / ISA_LAPSE * (1.0 - (np.asarray(p_static) / ISA_PRESSURE) ** (1 / ISA_EXPONENT)))
