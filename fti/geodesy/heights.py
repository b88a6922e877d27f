"""Heights with their vertical reference, to prevent errors of 47 m (geoid) or 83 m (altimeter setting).

    Height(536.2, MSL("egm96")) - Height(489.0, ELLIPSOID)      ValueError: mixed

A difference of two heights of one kind is a length (a plain number); a height plus a length is a height.  Everything
else raises.  Named functions convert between kinds; their arguments are the needed data:

    to_ellipsoid, to_msl             the geoid
    to_ellipsoid_by_message          the undulation of the same message
    pressure_to_msl, msl_to_pressure the air: QNH, its station and the temperature
    reset_altimeter                  the new setting, as on an altimeter
    above_ground, from_ground        the height of the terrain at the position
    to_point                         the lever arm and the attitude

All values [m], all settings [Pa]; arrays or numbers.  A height has no position: conversions take it as an argument.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.arrays import Array
from fti.geodesy.atmosphere import ISA_PRESSURE, Atmosphere, pressure_altitude
from fti.geodesy.geoid import Geoid
from fti.geodesy.rotations import rotate
from fti.messages.outputs import Datum, Point


@dataclass(frozen=True, slots=True)
class HeightKind:
    """The vertical reference of a height, and its parameter.

    detail : geoid model for MSL (or ``receiver``: the one inside a GNSS receiver), altimeter setting [Pa] for
             PRESSURE, reference point of the aircraft for AGL, None for the ellipsoid
    """

    datum: Datum
    detail: str | float | Point | None = None

    def __str__(self) -> str:
        match self.datum:
            case Datum.ELLIPSOID:
                return "ELLIPSOID"
            case Datum.PRESSURE:
                return f"PRESSURE({float(self.detail or 0.0) / 100.0:g} hPa)"
            case _:
                return f"{self.datum.name}({self.detail})"


#: Above the WGS84 ellipsoid.
ELLIPSOID = HeightKind(Datum.ELLIPSOID)
#: The model of MSL of a receiver that does not state its model.
RECEIVER = "receiver"


def MSL(model: str) -> HeightKind:  # noqa: N802 - a kind of height, like ELLIPSOID
    """Above mean sea level by a geoid model."""
    return HeightKind(Datum.MSL, model)


def PRESSURE(setting: float = ISA_PRESSURE) -> HeightKind:  # noqa: N802
    """Indication of an altimeter set to a pressure [Pa].  Raises ValueError if it is not positive."""
    if not setting > 0.0:
        raise ValueError(f"altimeter setting = {setting} Pa: must be positive")
    return HeightKind(Datum.PRESSURE, float(setting))


def AGL(point: Point) -> HeightKind:  # noqa: N802
    """Above the ground right below one point of the aircraft."""
    return HeightKind(Datum.AGL, point)


@dataclass(frozen=True, slots=True, eq=False)
class Height:
    """One height or an array of heights, with their vertical reference.

    metres : float or ndarray (read-only) [m]
    Raises ValueError for a difference or comparison of two kinds, and for a sum of two heights.
    """

    metres: float | Array
    kind: HeightKind

    __hash__ = None  # type: ignore[assignment]  # it may hold an array
    #: numpy leaves ``array + height`` and ``array - height`` to this class.
    __array_ufunc__ = None

    def __post_init__(self) -> None:
        values = np.array(self.metres, dtype=np.float64)
        values.flags.writeable = False
        object.__setattr__(self, "metres", values if values.ndim else float(values))

    def __str__(self) -> str:
        return f"{self.metres} m {self.kind}"

    def __add__(self, length: ArrayLike) -> Height:
        if isinstance(length, Height):
            raise ValueError(f"{length.kind} cannot be added to {self.kind}: only a length can be added to a height")
        return Height(self.metres + np.asarray(length, dtype=np.float64), self.kind)

    __radd__ = __add__

    def __sub__(self, other: Height | ArrayLike) -> float | Array | Height:
        if not isinstance(other, Height):
            return Height(self.metres - np.asarray(other, dtype=np.float64), self.kind)
        self.must_match(other, "subtracted from")
        return self.metres - other.metres

    def __rsub__(self, other: ArrayLike) -> Height:
        raise ValueError(f"a height, {self.kind}, cannot be subtracted from a length")

    def __lt__(self, other: Height) -> bool | NDArray[np.bool_]:
        return self._compare(other, np.less)

    def __le__(self, other: Height) -> bool | NDArray[np.bool_]:
        return self._compare(other, np.less_equal)

    def __gt__(self, other: Height) -> bool | NDArray[np.bool_]:
        return self._compare(other, np.greater)

    def __ge__(self, other: Height) -> bool | NDArray[np.bool_]:
        return self._compare(other, np.greater_equal)

    def __eq__(self, other: object) -> bool | NDArray[np.bool_]:  # type: ignore[override]
        return self._compare(other, np.equal) if isinstance(other, Height) else NotImplemented

    def _compare(self, other: Height, how: Callable[..., NDArray[np.bool_]]) -> bool | NDArray[np.bool_]:
        if not isinstance(other, Height):
            raise ValueError(f"a height, {self.kind}, cannot be compared with a plain number")
        self.must_match(other, "compared with")
        result = how(self.metres, other.metres)
        return result if np.ndim(result) else bool(result)

    def must_match(self, other: Height, what: str) -> None:
        """Raises ValueError when the other height is of another kind; what : the operation, for the message."""
        if other.kind != self.kind:
            raise ValueError(f"{other.kind} cannot be {what} {self.kind}: convert one of the heights first")


def _metres(height: Height, datum: Datum, wanted: str) -> float | Array:
    """The values of a height that must have this datum."""
    if height.kind.datum is not datum:
        raise ValueError(f"{wanted} needs a height of the kind {datum.name}, not {height.kind}")
    return height.metres


# ------------------------------------------------------------------------------------------------------------ geoid


def to_ellipsoid(height: Height, lat: ArrayLike, lon: ArrayLike, geoid: Geoid) -> Height:
    """A height above mean sea level at lat, lon [rad] as one above the ellipsoid.

    Raises ValueError when the height refers to another geoid model.
    """
    metres = _metres(height, Datum.MSL, "to_ellipsoid")
    if height.kind.detail != geoid.model:
        raise ValueError(f"{height.kind} cannot be converted with the geoid {geoid.model}")
    return Height(metres + geoid.undulation(lat, lon), ELLIPSOID)


def to_msl(height: Height, lat: ArrayLike, lon: ArrayLike, geoid: Geoid) -> Height:
    """A height above the ellipsoid at lat, lon [rad] as one above mean sea level."""
    return Height(_metres(height, Datum.ELLIPSOID, "to_msl") - geoid.undulation(lat, lon), MSL(geoid.model))


def to_ellipsoid_by_message(height: Height, undulation: ArrayLike) -> Height:
    """A height above mean sea level of any model, with the undulation [m] of the same message.

    The receiver subtracted the same undulation, so the error of its geoid cancels.
    """
    return Height(_metres(height, Datum.MSL, "to_ellipsoid_by_message") + np.asarray(undulation), ELLIPSOID)


# --------------------------------------------------------------------------------------------------------- pressure


def reset_altimeter(height: Height, setting: float) -> Height:
    """Indication of the altimeter set to another pressure [Pa]: 83 m more for 10 hPa more, at sea level."""
    metres = _metres(height, Datum.PRESSURE, "reset_altimeter")
    return Height(metres + _standard(height.kind) - _standard(PRESSURE(setting)), PRESSURE(setting))


def pressure_to_msl(height: Height, air: Atmosphere, model: str) -> Height:
    """The height above mean sea level at an altimeter indication.

    air : QNH, its station and the temperature; model : of the mean sea level that the station's height refers to
    """
    metres = _metres(height, Datum.PRESSURE, "pressure_to_msl")
    return Height(air.alt_msl(metres + _standard(height.kind)), MSL(model))


def msl_to_pressure(height: Height, air: Atmosphere, setting: float) -> Height:
    """Indication of an altimeter set to a pressure [Pa] at a height above mean sea level."""
    shown = air.pressure_altitude(_metres(height, Datum.MSL, "msl_to_pressure")) - _standard(PRESSURE(setting))
    return Height(shown, PRESSURE(setting))


def _standard(kind: HeightKind) -> float:
    """Pressure altitude [m] at which an altimeter of this setting shows 0."""
    return float(pressure_altitude(float(kind.detail or 0.0)))


# ---------------------------------------------------------------------------------------------------------- terrain


def above_ground(height: Height, ground: Height, point: Point) -> Height:
    """Height of a point of the aircraft above the ground below it; both heights of one kind, ELLIPSOID or MSL.

    ground : of the terrain at the same latitude and longitude, as from ``Terrain.height`` (above the ellipsoid)
    """
    _must_be_ground(ground, "above_ground")
    height.must_match(ground, "subtracted from")
    return Height(height.metres - ground.metres, AGL(point))


def from_ground(height: Height, ground: Height) -> Height:
    """A height above ground as one of the kind of the ground height: ELLIPSOID or MSL."""
    metres = _metres(height, Datum.AGL, "from_ground")
    _must_be_ground(ground, "from_ground")
    return ground + metres


def _must_be_ground(ground: Height, wanted: str) -> None:
    """Raises ValueError for a ground height by pressure (up to 7 % error in cold air) or AGL."""
    if ground.kind.datum not in (Datum.ELLIPSOID, Datum.MSL):
        raise ValueError(f"{wanted} needs the ground height above ELLIPSOID or MSL, not {ground.kind}")


def to_point(height: Height, point: Point, lever_arm_b: ArrayLike, mat_nb: ArrayLike) -> Height:
    """Converts a height above ground from one point of the aircraft to another, above the same ground.

        h(point) = h + (0 0 1) mat_nb lever_arm_b

    lever_arm_b : ndarray, shape (..., 3) [m]  from ``point`` to the point of the given height, body frame
    mat_nb      : ndarray, shape (..., 3, 3)   attitude, body to north, east, down
    Source      : Spiegel 2018, eq. 2.38 ff., with the lever arm from the reference point to the sensor throughout
    """
    return Height(_metres(height, Datum.AGL, "to_point") + rotate(mat_nb, lever_arm_b)[..., 2], AGL(point))
