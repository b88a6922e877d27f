"""Units of the columns of exports: those of the types of the messages, and of names that end with a unit."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from functools import cache

from fti.messages.measurements import Airspeed, Attitude, Position, Velocity
from fti.messages.topic_fields import units
from fti.messages.topics import LOCATION_TOPIC, MEASUREMENT_CLASSES, OUTPUT_CLASSES

NONE = "1"

_BY_TOPIC: dict[str, dict[str, str]] = {
    LOCATION_TOPIC: {"latitude": "deg", "longitude": "deg", "altitude": "m", "position_covariance": "m^2"},
}
#: Units by the suffix of a name, as in the notes of the service.
_BY_SUFFIX = {"ns": "ns", "nsec": "ns", "ms": "ms", "s": "s", "sec": "s", "hz": "Hz", "mb": "MB", "bytes": "B"}
_UNITS_BY_SUFFIX = {"ddm": "DDM", "dbhz": "dB-Hz", "pa": "Pa"}
#: Classes whose names other topics, as those of the truth, use in the same meaning.
STATE_CLASSES: tuple[type, ...] = (Attitude, Position, Velocity, Airspeed, *OUTPUT_CLASSES.values())
#: Fields of heights above the ground in recordings of fti 0.1.
_EARLIER = {"compensated": "m", "compensated_sd": "m"}
_CLASSES = {**MEASUREMENT_CLASSES, **OUTPUT_CLASSES}


def unit_of(topic: str, column: str) -> str | None:
    """Unit of a column (``stamp.t_rx_ns``, ``accel_b.0``) of a topic; None when it has none or is not a number."""
    path = [part for part in column.split(".") if not part.isdigit()]
    name = path[-1] if path else column
    return (
        _BY_TOPIC.get(topic, {}).get(name)
        or _units_of(topic).get(".".join(path))
        or _common_units().get(name)
        or _EARLIER.get(name)
        or _BY_SUFFIX.get(name.rpartition("_")[2])
    )


def class_of(topic: str) -> type | None:
    """``HeightAboveGround`` for ``/nav/height_above_ground/radar``, ``Attitude`` for ``/ins/attitude``."""
    return _CLASSES.get(next(iter(topic.split("/")[2:3]), ""))


def _units_of(topic: str) -> Mapping[str, str]:
    cls = class_of(topic)
    return units(cls) if cls else {}


@cache
def _common_units() -> dict[str, str]:
    """Units of names of the aircraft's state that all messages have in the same unit, for the topics of the truth."""
    found: dict[str, set[str]] = defaultdict(set)
    for cls in _CLASSES.values():
        for path, unit in units(cls).items():
            found[path.rpartition(".")[2]].add(unit)
    names = {name for cls in STATE_CLASSES for name in units(cls)}
    return {name: unit for name in names for unit in found[name] if len(found[name]) == 1}


def with_unit(column: str, unit: str | None) -> str:
    """Head of a column: ``height_agl [m]``; without a unit if the name has it (``t_rx_ns``) or it is dimensionless."""
    suffix = column.rpartition("_")[2]
    names_unit = suffix != column and unit in (_BY_SUFFIX.get(suffix), _UNITS_BY_SUFFIX.get(suffix))
    return column if names_unit or unit in (None, NONE) else f"{column} [{unit}]"
