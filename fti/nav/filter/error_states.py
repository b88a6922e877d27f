"""States of the filter: errors of navigation, of the inertial unit, and of the aiding sources.

    0-2 position e [m]   3-5 velocity e [m/s]   6-8 turn e [rad]   9-11 accelerometer bias b   12-14 gyro bias b
    and then, as configured, first-order Gauss-Markov errors of the aiding sources (``Drift``)

With nine states the two biases are left out.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from fti.arrays import Array
from fti.nav.inertial.ins_error_model import ACCEL, BIASED, IMU_ERROR_MODELS, ImuErrorModel


class Extra(StrEnum):
    """A slow error of an aiding source: measured minus true [m]; a scale is a share of the height.

    WIND_NORTH, WIND_EAST : the wind, in the direction of the air flow [m/s];  AIRSPEED_SCALE : share of the airspeed
    SIDESLIP, MAGNETIC_HEADING : steady angles [rad], wind from the right, measured minus true heading
    MARK_X, MARK_Y, MARK_Z : a position of the past, e, from its reference point [m] (``position_mark``)
    MAP_NORTH, MAP_EAST : horizontal error of the map
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
    MARK_X = "mark_x"
    MARK_Y = "mark_y"
    MARK_Z = "mark_z"
    MAP_NORTH = "map_north"
    MAP_EAST = "map_east"


#: Scale factors (xx, yy, zz) and alignment of the gyros: share of the rate about the second axis that the first one
#: measures in excess.
GYRO_MATRIX = tuple(f"gyro_{measured}{rate}" for measured in "xyz" for rate in "xyz")

#: Names of the states of a look begin and its first one ends so.
LOOK, FIRST = "look", ".position_x"


@dataclass(frozen=True, slots=True)
class Drift:
    """A first-order Gauss-Markov error, correlated over time, over the distance flown, or both.

    sd [m, m/s, rad, of a scale 1]; period_s [s]: correlation time; length_m [m]: correlation length over the ground
    first_sd : sigma at the start, None: sd; for offsets that are unknown at first and hardly change afterwards
    sound_sd : sigma of a sound source; a source with larger errors is excluded (``exclusion``); None: never
    Raises ValueError if one is not positive.
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
#: Share of the variance that several receivers have in common: orbits, clocks, ionosphere, troposphere.
COMMON_SHARE = 0.8
#: An altimeter's bias and scale, and the error of an elevation model.
ALTIMETER_DRIFT = Drift(0.5, period_s=300.0)
SCALE_DRIFT = Drift(0.01, period_s=3600.0)
DEM_DRIFT = Drift(1.5, length_m=300.0)
#: Prior of each aiding altimeter.  It is wide: with satellites of 3 m, an altimeter with an error of 10 m moves the
#: height by 10 m 3^2 / (3^2 + 10^2) = 0.8 m only, and its error is estimated.  The bias changes by 1.8 m in a minute,
#: much faster than that of a sound altimeter; otherwise the filter would take a bias change that passes the gate for a
#: climb.  The scale changes by 1 % in an hour.  ``sound_sd``: 0.5 m of the altimeter with 1.5 m of the elevation; 1 %.
#: Measured in docs/decisions/0034-altimeters-in-the-filter.md.
ALTIMETER_BIAS = Drift(10.0, period_s=3750.0, sound_sd=1.6)
ALTIMETER_SCALE = Drift(0.03, period_s=32_400.0, sound_sd=0.01)
#: A pressure altitude as a height above the ellipsoid: 10 hPa are 83 m, the undulation is up to 100 m; it changes by
#: metres in minutes.
BARO_DRIFT = Drift(10.0, period_s=1800.0, first_sd=150.0)
#: Temperature error of the standard atmosphere: 9 K cause 3 % of each climb.
BARO_SCALE_DRIFT = Drift(0.03, period_s=3600.0)

#: Horizontal wind, unknown at first.  Over 18 km (300 s at 60 m/s) each component changes by 2.7 m/s, one sigma; the
#: measured change at one altitude is 1.6 m/s (Lindborg 1999, J. Fluid Mech. 388, eq. 45: 3.6e-3 r^(2/3) m^2/s^2).
#: The rest is for climbs: 2 m/s and more over 1 km.
WIND_DRIFT = Drift(20.0, length_m=2e6)
#: Residual position error of pitot and static ports, and of the air temperature: FAR 23.1323(b) allows 3 %.
AIRSPEED_SCALE_DRIFT = Drift(0.03, period_s=3600.0)
#: Trim, a propeller's swirl, mounting of the inertial unit: assumed.
SIDESLIP_DRIFT = Drift(math.radians(1.5), period_s=600.0)
#: Uncompensated iron, declination, current in wires: assumed, 4 deg.  The error of iron changes with the heading, so
#: within the duration of a turn.
MAGNETIC_HEADING_DRIFT = Drift(math.radians(4.0), period_s=200.0)
#: Slow errors of an aiding airspeed and magnetic heading.
AIRSPEED_DRIFTS: dict[str, Drift] = {
    Extra.WIND_NORTH: WIND_DRIFT,
    Extra.WIND_EAST: WIND_DRIFT,
    Extra.AIRSPEED_SCALE: AIRSPEED_SCALE_DRIFT,
    Extra.SIDESLIP: SIDESLIP_DRIFT,
}
HEADING_DRIFTS: dict[str, Drift] = {Extra.MAGNETIC_HEADING: MAGNETIC_HEADING_DRIFT}


def receiver_drifts(receivers: Sequence[str]) -> dict[str, Drift]:
    """Slow errors of positions: one for a single receiver; for several, a common one and one of each receiver."""
    if len(receivers) < 2:
        return dict(GNSS_DRIFTS) if receivers else {}
    drifts = {name: _part(drift, COMMON_SHARE) for name, drift in GNSS_DRIFTS.items()}
    for receiver in receivers:
        own = zip(own_drifts(receiver), GNSS_DRIFTS.values(), strict=True)
        drifts |= {name: _part(drift, 1.0 - COMMON_SHARE) for name, drift in own}
    return drifts


def own_drifts(receiver: str) -> tuple[str, str, str]:
    """Names of the slow errors of one of several receivers: north, east, down."""
    return f"{receiver}.north", f"{receiver}.east", f"{receiver}.down"


def _part(drift: Drift, share: float) -> Drift:
    return replace(drift, sd=drift.sd * math.sqrt(share))


@dataclass(frozen=True)
class FilterModel:
    """The states of the filter and their assumed uncertainty.

    unit   : the inertial unit
    biased : fifteen states, else nine
    extras : slow errors of the sources, in this order after the others: an ``Extra``, or the name of one source
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
        """Number of states."""
        return self.base + len(self.extras)

    @functools.cached_property
    def columns(self) -> dict[str, int]:
        """Columns of the extras; others are not states."""
        return {extra: self.base + at for at, extra in enumerate(self.extras)}

    @functools.cached_property
    def looks(self) -> tuple[int, ...]:
        """First columns of the looks: position and turn of the past (``look_mark``)."""
        return tuple(column for name, column in self.columns.items() if name.startswith(LOOK) and name.endswith(FIRST))

    @functools.cached_property
    def drifts(self) -> Array:
        """For the kernels, shape (k, 4): sd [m], 1 / period [1/s], 1 / length [1/m]; number in
        ``GYRO_MATRIX``, -1 for others.
        """
        elements = {name: number for number, name in enumerate(GYRO_MATRIX)}
        rows = [[d.sd, 1.0 / d.period_s, 1.0 / d.length_m, elements.get(name, -1)] for name, d in self.extras.items()]
        return np.array(rows).reshape(-1, 4)


def outage_model(unit: ImuErrorModel, extras: Mapping[str, Drift], *, biased: bool = True) -> FilterModel:
    """A filter for minutes without fixes: constant biases with flicker noise; states for scale and alignment of gyros.

    Turns in one direction add up their errors, which noise does not.  Raises ValueError for a unit without them.
    """
    factor, alignment = Drift(unit.gyro.factor), Drift(unit.gyro.alignment)
    matrix = {name: factor if name[-1] == name[-2] else alignment for name in GYRO_MATRIX}
    return FilterModel(unit.for_outages(), biased, {**extras, **matrix})
