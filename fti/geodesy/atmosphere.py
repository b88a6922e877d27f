"""The standard atmosphere, and one with another pressure at sea level and another temperature.

Source: ISO 2533 (constants, pressure and temperature by height).  Heights are taken as geopotential; the geometric
height is 0.16 % larger at 10 km and 0.05 % at 3 km.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: Sea level temperature [K], pressure [Pa], lapse [K/m], gas constant [J/(kg K)].
ISA_TEMPERATURE, ISA_PRESSURE, ISA_LAPSE, GAS_CONSTANT = 288.15, 101325.0, 0.0065, 287.05287
ISA_EXPONENT = 9.80665 / (ISA_LAPSE * GAS_CONSTANT)


@dataclass(frozen=True, slots=True)
class Atmosphere:
    """Standard atmosphere with another pressure at sea level and another temperature.

    qnh [Pa]; deviation [K] from the standard temperature
    """

    qnh: float = ISA_PRESSURE
    deviation: float = 0.0

    def p_static(self, alt_msl: ArrayLike) -> Array:
        """Static pressure [Pa] at a height above mean sea level [m]."""
        at_qnh = np.asarray(alt_msl) + pressure_altitude(self.qnh)
        return np.asarray(ISA_PRESSURE * (1.0 - ISA_LAPSE * at_qnh / ISA_TEMPERATURE) ** ISA_EXPONENT)

    def temperature(self, alt_msl: ArrayLike) -> Array:
        """Static air temperature [K]."""
        return np.asarray(ISA_TEMPERATURE + self.deviation - ISA_LAPSE * np.asarray(alt_msl))


def pressure_altitude(p_static: ArrayLike) -> Array:
    """Altitude [m] in the standard atmosphere of a static pressure [Pa]."""
    return np.asarray(ISA_TEMPERATURE / ISA_LAPSE * (1.0 - (np.asarray(p_static) / ISA_PRESSURE) ** (1 / ISA_EXPONENT)))
