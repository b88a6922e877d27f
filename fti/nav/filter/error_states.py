"""What the filter estimates: errors of navigation, of the inertial unit, and of what aids.

    0-2 position e [m]   3-5 velocity e [m/s]   6-8 turn e [rad]   9-11 accelerometer bias b   12-14 gyro bias b
    and then, as many as are asked for, first-order Gauss-Markov errors of what aids (``Drift``)

With nine states the two biases are left out.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from fti.nav.inertial.ins_error_model import ACCEL, BIASED, IMU_ERROR_MODELS, ImuErrorModel

Array = NDArray[np.float64]


class Extra(StrEnum):
    """A slow error of something that aids: what it says minus what is [m]; of a scale its share of the height.

    WIND_NORTH, WIND_EAST : the wind itself, where the air moves to [m/s];  AIRSPEED_SCALE : share of the airspeed
    SIDESLIP, MAGNETIC_HEADING : steady angles [rad], wind from the right, measured minus true heading
    """

    GNSS_NORTH = "gnss_north"
    GNSS_EAST = "gnss_east"
    GNSS_DOWN = "gnss_down"
    BARO = "baro"
    BARO_SCALE = "baro_scale"
    ALTIMETER = "altimeter"
    ALTIMETER_SCALE = "altimeter_scale"
    DEM = "dem"
    WIND_NORTH = "wind_north"
    WIND_EAST = "wind_east"
    AIRSPEED_SCALE = "airspeed_scale"
    SIDESLIP = "sideslip"
    MAGNETIC_HEADING = "magnetic_heading"


@dataclass(frozen=True, slots=True)
class Drift:
    """A first-order Gauss-Markov error, correlated over time, or over the way flown, or both.

    sd [m, m/s, rad, of a scale 1]; period_s [s]: correlation time; length_m [m]: correlation length over the ground
    first_sd : sigma at the start, None: sd.  An offset that is not known at all at first, and hardly changes then
    sound_sd : of a sound source, where one whose error is not like that is to be excluded (``exclusion``); None: never
    Raises ValueError where one is not positive.
    """

    sd: float
    period_s: float = math.inf
    length_m: float = math.inf
    first_sd: float | None = None
    sound_sd: float | None = None

    def __post_init__(self) -> None:
        sound = self.sd if self.sound_sd is None else self.sound_sd
        if not min(self.sd, self.period_s, self.length_m, self.first, sound) > 0.0:
            raise ValueError(f"{self}: each must be > 0")

    @property
    def first(self) -> float:
        """Sigma at the start."""
        return self.sd if self.first_sd is None else self.first_sd


#: GNSS without augmentation: correlated over some minutes.
GNSS_DRIFTS: dict[str, Drift] = {
    Extra.GNSS_NORTH: Drift(1.5, period_s=200.0),
    Extra.GNSS_EAST: Drift(1.5, period_s=200.0),
    Extra.GNSS_DOWN: Drift(2.5, period_s=200.0),
}
#: Of several receivers, the share of the variance that is common to them: orbits, clocks, ionosphere, troposphere.
COMMON_SHARE = 0.8
#: An altimeter's bias and scale, and the error of an elevation model.
ALTIMETER_DRIFT = Drift(0.5, period_s=300.0)
SCALE_DRIFT = Drift(0.01, period_s=3600.0)
DEM_DRIFT = Drift(1.5, length_m=300.0)
#: What the filter assumes of each altimeter that aids.  So wide a prior that beside satellites of 3 m an altimeter
#: which is 10 m wrong is estimated and not believed: it moves the height by 10 m 3^2 / (3^2 + 10^2) = 0.8 m.  The bias
#: wanders by 1.8 m in a minute, much faster than that of a sound altimeter: a change of it that the gate lets pass is
#: otherwise taken for a climb.  The scale wanders by 1 % in an hour.  ``sound_sd``: 0.5 m of its own with 1.5 m of the
#: elevation's; 1 %.  Measured in docs/decisions/0034-altimeters-in-the-filter.md.
ALTIMETER_BIAS = Drift(10.0, period_s=3750.0, sound_sd=1.6)
ALTIMETER_SCALE = Drift(0.03, period_s=32_400.0, sound_sd=0.01)
#: A pressure altitude as a height above the ellipsoid: 10 hPa are 83 m, the undulation is up to 100 m; it changes by
#: metres in minutes.
BARO_DRIFT = Drift(10.0, period_s=1800.0, first_sd=150.0)
#: The air is warmer or colder than the standard atmosphere: 9 K make 3 % of each climb.
BARO_SCALE_DRIFT = Drift(0.03, period_s=3600.0)

#: Horizontal wind.  It is not known at all at first.  Over 18 km (300 s at 60 m/s) each component changes by 2.7 m/s,
#: one sigma; measured at one altitude are 1.6 m/s (Lindborg 1999, J. Fluid Mech. 388, eq. 45: 3.6e-3 r^(2/3) m^2/s^2).
#: The rest is for climbs: 1 km of them makes 2 m/s and more.
WIND_DRIFT = Drift(20.0, length_m=2e6)
#: What is left of the position error of pitot and static ports, and of the air temperature: FAR 23.1323(b) allows 3 %.
AIRSPEED_SCALE_DRIFT = Drift(0.03, period_s=3600.0)
#: Trim, a propeller's swirl, mounting of the inertial unit: assumed.
SIDESLIP_DRIFT = Drift(math.radians(1.5), period_s=600.0)
#: Iron that is not compensated, declination, current in wires: assumed, 4 deg.  Of iron the error changes with the
#: heading, so within the time of a turn.
MAGNETIC_HEADING_DRIFT = Drift(math.radians(4.0), period_s=200.0)
#: Slow errors beside which an airspeed and a magnetic heading aid.
AIRSPEED_DRIFTS: dict[str, Drift] = {
    Extra.WIND_NORTH: WIND_DRIFT,
    Extra.WIND_EAST: WIND_DRIFT,
    Extra.AIRSPEED_SCALE: AIRSPEED_SCALE_DRIFT,
    Extra.SIDESLIP: SIDESLIP_DRIFT,
}
HEADING_DRIFTS: dict[str, Drift] = {Extra.MAGNETIC_HEADING: MAGNETIC_HEADING_DRIFT}


def receiver_drifts(receivers: Sequence[str]) -> dict[str, Drift]:
    """Slow errors of positions: of one receiver all in one, of several a common one and one of each receiver."""
    if len(receivers) < 2:
        return dict(GNSS_DRIFTS) if receivers else {}
    found = {name: _part(drift, COMMON_SHARE) for name, drift in GNSS_DRIFTS.items()}
    for receiver in receivers:
        own = zip(own_drifts(receiver), GNSS_DRIFTS.values(), strict=True)
        found |= {name: _part(drift, 1.0 - COMMON_SHARE) for name, drift in own}
    return found


def own_drifts(receiver: str) -> tuple[str, str, str]:
    """Names of the slow errors of one of several receivers: north, east, down."""
    return f"{receiver}.north", f"{receiver}.east", f"{receiver}.down"


def _part(drift: Drift, share: float) -> Drift:
    return replace(drift, sd=drift.sd * math.sqrt(share))


@dataclass(frozen=True)
class FilterModel:
    """What is estimated, and how uncertain it is said to be.

    unit   : the inertial unit
    biased : fifteen states, else nine
    extras : slow errors of what aids, in this order behind the others: of ``Extra``, or of one source by its own name
    """

    unit: ImuErrorModel = IMU_ERROR_MODELS["tactical"]
    biased: bool = True
    extras: dict[str, Drift] = field(default_factory=dict)

    @functools.cached_property
    def base(self) -> int:
        """States before the extras."""
        return BIASED if self.biased else ACCEL

    @functools.cached_property
    def size(self) -> int:
        """States in all."""
        return self.base + len(self.extras)

    @functools.cached_property
    def columns(self) -> dict[str, int]:
        """Of the extras; who is not in it is no state."""
        return {extra: self.base + at for at, extra in enumerate(self.extras)}

    @functools.cached_property
    def drifts(self) -> Array:
        """For the kernels, shape (k, 3): sd [m], 1 / period [1/s], 1 / length [1/m]."""
        return np.array([[d.sd, 1.0 / d.period_s, 1.0 / d.length_m] for d in self.extras.values()]).reshape(-1, 3)
