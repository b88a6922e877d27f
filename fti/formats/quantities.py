"""Quantities by name, for protocols with user-defined message tables (ARINC 429 labels, DBC).

A quantity is a field of a measurement class; a unit is a factor and an offset to SI.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from fti.constants import FOOT, NAUTICAL_MILE, STANDARD_GRAVITY
from fti.formats.unit_factors import DEGREE, FOOT_PER_MINUTE, HECTOPASCAL, INCH_HG, KELVIN_AT_0_C, KNOT
from fti.geodesy.formulas import wrap_heading
from fti.messages.measurements import (
    Airspeed,
    Attitude,
    Deviation,
    DmeRange,
    FlowAngles,
    ImpactPressure,
    Measurement,
    Position,
    PressureAltitude,
    RadioHeight,
    Range,
    Stamp,
    StaticPressure,
    SurfaceDeflection,
    Temperature,
    Velocity,
)

#: Unit as written in a DBC or label set: (factor, offset) to SI.
UNITS = {
    "m": (1.0, 0.0),
    "ft": (FOOT, 0.0),
    "NM": (NAUTICAL_MILE, 0.0),
    "m/s": (1.0, 0.0),
    "kt": (KNOT, 0.0),
    "km/h": (1 / 3.6, 0.0),
    "ft/min": (FOOT_PER_MINUTE, 0.0),
    "rad": (1.0, 0.0),
    "deg": (DEGREE, 0.0),
    "rad/s": (1.0, 0.0),
    "deg/s": (DEGREE, 0.0),
    "m/s2": (1.0, 0.0),
    "g": (STANDARD_GRAVITY, 0.0),
    "Pa": (1.0, 0.0),
    "hPa": (HECTOPASCAL, 0.0),
    "mbar": (HECTOPASCAL, 0.0),
    "inHg": (INCH_HG, 0.0),
    "K": (1.0, 0.0),
    "degC": (1.0, KELVIN_AT_0_C),
    "ddm": (1.0, 0.0),
}
DIMENSIONS = (
    ("m", "ft", "NM"),
    ("m/s", "kt", "km/h", "ft/min"),
    ("rad", "deg"),
    ("rad/s", "deg/s"),
    ("m/s2", "g"),
    ("Pa", "hPa", "mbar", "inHg"),
    ("K", "degC"),
    ("ddm",),
)


@dataclass(frozen=True, slots=True)
class Quantity:
    """One field of one measurement class.

    unit  : the SI unit; sign : -1 if the wire has the opposite sign; constant : fixed fields of the measurement
    """

    measurement: type[Any]
    field: str
    unit: str
    sign: int = 1
    constant: tuple[tuple[str, object], ...] = ()

    def make(self, stamp: Stamp, value: float | None, valid: bool) -> Measurement | None:
        """The measurement that carries this value; None when there is no value and the class must have one."""
        if value is None and self.field in _REQUIRED:
            return None
        measurement: Measurement = self.measurement(
            stamp=stamp, valid=valid, **dict(self.constant), **{self.field: self._signed(value)}
        )
        return measurement

    def maker(self) -> Callable[[Stamp, float, bool], Measurement]:
        """``make`` for existing values, for buses with thousands of messages a second."""
        kind: Callable[..., Measurement] = self.measurement
        make, name = partial(kind, **dict(self.constant)), self.field
        if self.sign == 1 and name not in ("heading", "track"):
            return lambda stamp, value, valid: make(stamp=stamp, valid=valid, **{name: value})
        return lambda stamp, value, valid: make(stamp=stamp, valid=valid, **{name: self._signed(value)})

    def pick(self, measurement: Measurement) -> float | None:
        """The value of this quantity in a measurement; None if the measurement does not carry it."""
        if type(measurement) is not self.measurement:
            return None
        for name, constant in self.constant:
            if getattr(measurement, name) != constant:
                return None
        value: float | None = getattr(measurement, self.field)
        return value if value is None or self.sign == 1 else value * self.sign

    def is_empty(self, measurement: Measurement) -> bool:
        """Is the measurement of this class, invalid and without any value?"""
        return (
            type(measurement) is self.measurement
            and not getattr(measurement, "valid", True)
            and all(getattr(measurement, name) == value for name, value in self.constant)
            and all(getattr(measurement, name) is None for name in measurement.__struct_fields__ if name in _VALUES)
        )

    def _signed(self, value: float | None) -> float | None:
        if value is None:
            return None
        return wrap_heading(value) if self.field in ("heading", "track") else value * self.sign


_REQUIRED = frozenset({"p_static", "q_c", "alt_press"})
STANDARD_PA = 101_325.0

QUANTITIES = {
    "radio_height": Quantity(RadioHeight, "height_agl", "m"),
    "slant_range": Quantity(Range, "slant_range", "m"),
    "roll": Quantity(Attitude, "roll", "rad"),
    "pitch": Quantity(Attitude, "pitch", "rad"),
    "true_heading": Quantity(Attitude, "heading", "rad"),
    "latitude": Quantity(Position, "lat", "rad"),
    "longitude": Quantity(Position, "lon", "rad"),
    "altitude": Quantity(Position, "alt", "m"),
    "altitude_msl": Quantity(Position, "alt_msl", "m"),
    "north_velocity": Quantity(Velocity, "north", "m/s"),
    "east_velocity": Quantity(Velocity, "east", "m/s"),
    "vertical_speed": Quantity(Velocity, "down", "m/s", sign=-1),  # the wire counts up
    "ground_speed": Quantity(Velocity, "ground_speed", "m/s"),
    "track": Quantity(Velocity, "track", "rad"),
    "static_pressure": Quantity(StaticPressure, "p_static", "Pa"),
    "impact_pressure": Quantity(ImpactPressure, "q_c", "Pa"),
    "pressure_altitude": Quantity(PressureAltitude, "alt_press", "m", constant=(("setting_pa", STANDARD_PA),)),
    "baro_corrected_altitude": Quantity(PressureAltitude, "alt_press", "m", constant=(("setting_pa", None),)),
    "calibrated_airspeed": Quantity(Airspeed, "cas", "m/s"),
    "indicated_airspeed": Quantity(Airspeed, "ias", "m/s"),
    "true_airspeed": Quantity(Airspeed, "tas", "m/s"),
    "static_air_temperature": Quantity(Temperature, "static", "K"),
    "total_air_temperature": Quantity(Temperature, "total", "K"),
    "angle_of_attack": Quantity(FlowAngles, "aoa", "rad"),
    "sideslip": Quantity(FlowAngles, "aos", "rad"),
    "localizer_deviation": Quantity(Deviation, "localizer_ddm", "ddm"),
    "glide_slope_deviation": Quantity(Deviation, "glide_slope_ddm", "ddm"),
}
_FLAPS = ("flaps", "left_flap", "right_flap")
_CONTROLS = ("stick_aileron", "stick_elevator", "pedals", "rudder_trim", "elevator_trim")
for _surface in ("rudder", "stabilizer", "elevator", "left_aileron", "right_aileron", *_FLAPS, *_CONTROLS):
    QUANTITIES[f"{_surface}_position"] = Quantity(
        SurfaceDeflection, "deflection", "rad", constant=(("surface", _surface),)
    )
for _n in range(1, 5):
    QUANTITIES[f"dme_{_n}_distance"] = Quantity(DmeRange, "slant_range", "m", constant=(("station", f"dme_{_n}"),))

_VALUES = frozenset(q.field for q in QUANTITIES.values())


def to_si(quantity: str, unit: str) -> tuple[float, float]:
    """Factor and offset from a unit of the wire.  Raises ValueError if the unit does not fit the quantity."""
    si = QUANTITIES[quantity].unit
    allowed = next(group for group in DIMENSIONS if si in group)
    if unit not in allowed:
        raise ValueError(f"{quantity}: unit {unit!r}; allowed here: {', '.join(allowed)}")
    return UNITS[unit]
