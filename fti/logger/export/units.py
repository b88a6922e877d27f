"""Units of all recorded numbers, for exports.

Units are SI (``m/s^2``); ``1`` is dimensionless.  A name has the same unit in all classes of ``fti.types``, except for
the exceptions by class.
"""

from __future__ import annotations

import typing

from fti import types
from fti.logger.derived_log import LOCATION_TOPIC, snake_case

NONE = "1"

_BY_NAME = {
    "rad": "roll pitch heading roll_sd pitch_sd heading_sd tilt_sd track aoa aos deflection azimuth elevation lat lon "
    "deviation tilt_pl heading_pl",
    "m": "alt alt_msl alt_press undulation horizontal_sd vertical_sd hpl vpl slant_range height_agl height_error "
    "height_error_sd shift shift_sd s_begin s_end alert_limit_v alert_limit_s protection_level_v "
    "protection_level_s s y dh dh_sd dh_nav distance height_difference pseudorange "
    "pseudorange_sd predicted predicted_sd nearest nearest_sd compensated compensated_sd wheels",
    "m/s": "north east down ground_speed cas ias tas vel_north vel_east vel_down vel_sd vel_down_sd",
    "m/s^2": "accel_b",
    "rad/s": "gyro_b",
    "Pa": "p_static q_c setting_pa",
    "T": "field_b",
    "DDM": "localizer_ddm glide_slope_ddm",
    "dB-Hz": "cn0_dbhz",
    "cycles": "carrier_phase carrier_phase_sd",
    "Hz": "doppler",
    "s": "lock_time",
    NONE: "number used hdop vdop pdop t1_ratio t2_ratio t3_ratio t4_ratio observability dots",
}
_UNITS = {name: unit for unit, names in _BY_NAME.items() for name in names.split()}
_BY_CLASS: dict[str, dict[str, str]] = {
    "velocity": {"sd": "m/s"},
    "range": {"sd": "m"},
    "radio_height": {"sd": "m"},
    "height_below_aircraft": {"sd": "m"},
    "static_pressure": {"sd": "Pa"},
    "impact_pressure": {"sd": "Pa"},
    "temperature": {"static": "K", "total": "K"},
    "surface_deflection": {"raw": NONE},
    "calibration": {"raw": NONE},
    "reading": {"value": "unit"},  # the unit is in the column of this name
    "receiver_clock": {"offset": "s", "offset_sd": "s", "drift": "s/s", "drift_sd": "s/s"},
    "ephemeris": {
        **dict.fromkeys(("week", "issue", "e"), NONE),
        **dict.fromkeys(("toc", "toe", "af0", "tgd"), "s"),
        **{"af1": "s/s", "af2": "s/s^2", "sqrt_a": "m^0.5"},
        **dict.fromkeys(("m0", "omega0", "i0", "omega", "cuc", "cus", "cic", "cis"), "rad"),
        **dict.fromkeys(("delta_n", "omega_dot", "idot"), "rad/s"),
        **dict.fromkeys(("crc", "crs", "accuracy"), "m"),
    },
    "height_above_ground": {"raw": "m", "sd": "m"},
    "glide_slope": {"sd": "rad"},
}
_BY_TOPIC: dict[str, dict[str, str]] = {
    LOCATION_TOPIC: {"latitude": "deg", "longitude": "deg", "altitude": "m", "position_covariance": "m^2"},
}
#: Units by the suffix of a name, as in the notes of the service.
_BY_SUFFIX = {"ns": "ns", "nsec": "ns", "ms": "ms", "s": "s", "sec": "s", "hz": "Hz", "mb": "MB", "bytes": "B"}
_UNITS_BY_SUFFIX = {"ddm": "DDM", "dbhz": "dB-Hz", "pa": "Pa"}
_CLASSES = frozenset(
    snake_case(cls.__name__) for union in (types.Measurement, types.Output) for cls in typing.get_args(union)
)


def unit_of(topic: str, column: str) -> str | None:
    """Unit of a column (``stamp.t_rx_ns``, ``accel_b.0``) of a topic; None when it has none or is not a number."""
    name = next((part for part in reversed(column.split(".")) if not part.isdigit()), column)
    return (
        _BY_TOPIC.get(topic, {}).get(name)
        or _BY_CLASS.get(_class_of(topic), {}).get(name)
        or _UNITS.get(name)
        or _BY_SUFFIX.get(name.rpartition("_")[2])
    )


def _class_of(topic: str) -> str:
    """``height_above_ground`` of ``/nav/height_above_ground/radar``, ``attitude`` of ``/ins/attitude``."""
    return next((part for part in topic.split("/")[2:3] if part in _CLASSES), "")


def with_unit(column: str, unit: str | None) -> str:
    """Head of a column: ``height_agl [m]``; without a unit if the name has it (``t_rx_ns``) or it is dimensionless."""
    suffix = column.rpartition("_")[2]
    names_unit = suffix != column and unit in (_BY_SUFFIX.get(suffix), _UNITS_BY_SUFFIX.get(suffix))
    return column if names_unit or unit in (None, NONE) else f"{column} [{unit}]"
