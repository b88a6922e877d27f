"""Selects one source for each quantity of an autopilot that several messages or sensors carry.

The autopilot's estimate (33, then 32) has priority over its receiver (24, 113): it continues without a fix.  Quantities
of the receiver only, sigmas and the undulation, are added to the estimate while the receiver has a fix, and
``SOURCE_TIMEOUT_NS`` longer.  Of several downward sensors the one with the lowest ``id`` has priority.  Measurements of
other sources become Readings, see ``_source_priority``; the Reading "distance_sensor" is the ``id`` of a new source.
"""

from __future__ import annotations

from typing import Any

from msgspec.structs import replace

from fti.drivers._source_priority import SOURCE_TIMEOUT_NS, SourcePriority, ranks_of
from fti.messages.measurements import Measurement, Position, RadioHeight, Range, Reading, Stamp, Velocity

RECEIVER = ("GPS_RAW_INT", "HIL_GPS")
ORDER = (("GLOBAL_POSITION_INT",), ("LOCAL_POSITION_NED",), RECEIVER)
RANKS = ranks_of({Position: ORDER, Velocity: ORDER})
DISTANCE = "DISTANCE_SENSOR"


class SourceSelector:
    """Keeps the present source message and distance sensor.

    distance_id : the only distance sensor that is used; None: all
    """

    def __init__(self, distance_id: int | None) -> None:
        self._distance_id = distance_id
        self._source_priority = SourcePriority()
        self._sensor: int | None = None
        self._fix: dict[type, Measurement] = {}  # last valid fix of the receiver

    def select(self, name: str, fields: Any, measurements: list[Measurement]) -> list[Measurement]:
        """The measurements of a message; those of other sources converted to Readings."""
        if name == DISTANCE:
            return self._select_distance(fields.id, measurements)
        ranks = RANKS.get(name)
        if ranks is None:
            return measurements
        if name in RECEIVER:
            self._fix |= {type(m): m for m in measurements if isinstance(m, Position | Velocity) and m.valid}
        else:
            measurements = [self._completed(m) for m in measurements]
        return self._source_priority.select(name, ranks, measurements)

    def _completed(self, m: Measurement) -> Measurement:
        """The estimate, with sigmas and undulation of the receiver."""
        fix = self._fix.get(type(m))
        if fix is None or not 0 <= m.stamp.t_rx_ns - fix.stamp.t_rx_ns <= SOURCE_TIMEOUT_NS:
            return m
        if isinstance(m, Position) and isinstance(fix, Position):
            undulation = fix.undulation if m.alt is None else None
            return replace(m, undulation=undulation, horizontal_sd=fix.horizontal_sd, vertical_sd=fix.vertical_sd)
        return replace(m, sd=fix.sd) if isinstance(m, Velocity) and isinstance(fix, Velocity) else m

    def _select_distance(self, sensor: int, measurements: list[Measurement]) -> list[Measurement]:
        if self._distance_id not in (None, sensor):
            return []
        out = self._source_priority.select(f"{DISTANCE}_{sensor}", {Range: sensor, RadioHeight: sensor}, measurements)
        if any(isinstance(m, Range | RadioHeight) for m in out):
            if self._sensor not in (None, sensor):
                stamp = Stamp(out[0].stamp.t_rx_ns)
                out.append(Reading(stamp=stamp, name="distance_sensor", value=float(sensor)))
            self._sensor = sensor
        return out
