"""One stream for each quantity of an autopilot, where several of its messages or sensors carry it.

The autopilot's estimate (33, then 32) comes before its receiver (24, 113): it goes on when that has no fix.  What only
the receiver tells, sigmas and the undulation, stays with the estimate for as long as the receiver has a fix, and
``SOURCE_TIMEOUT_NS`` longer.  Of several sensors that look down the one with the lowest ``id`` comes first.  What gives way
becomes Readings, see ``_source_priority``; the Reading "distance_sensor" is the ``id`` of another that counts now.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from fti.drivers._source_priority import SOURCE_TIMEOUT_NS, SourcePriority, ranks_of
from fti.types import Measurement, Position, RadioHeight, Range, Reading, Stamp, Velocity

RECEIVER = ("GPS_RAW_INT", "HIL_GPS")
ORDER = (("GLOBAL_POSITION_INT",), ("LOCAL_POSITION_NED",), RECEIVER)
RANKS = ranks_of({Position: ORDER, Velocity: ORDER})
DISTANCE = "DISTANCE_SENSOR"


class SourceSelector:
    """Remembers which message and which sensor counts.

    distance_id : the only sensor of distance that is heard; None: all
    """

    def __init__(self, distance_id: int | None) -> None:
        self._distance_id = distance_id
        self._source_priority = SourcePriority()
        self._sensor: int | None = None
        self._fix: dict[type, Measurement] = {}  # what the receiver told last

    def select(self, name: str, fields: Any, found: list[Measurement]) -> list[Measurement]:
        """The measurements of a message, without those that give way."""
        if name == DISTANCE:
            return self._select_distance(fields.id, found)
        ranks = RANKS.get(name)
        if ranks is None:
            return found
        if name in RECEIVER:
            self._fix |= {type(m): m for m in found if isinstance(m, Position | Velocity) and m.valid}
        else:
            found = [self._completed(m) for m in found]
        return self._source_priority.select(name, ranks, found)

    def _completed(self, m: Measurement) -> Measurement:
        """The estimate, with what its receiver knows of it."""
        fix = self._fix.get(type(m))
        if fix is None or not 0 <= m.stamp.t_rx_ns - fix.stamp.t_rx_ns <= SOURCE_TIMEOUT_NS:
            return m
        if isinstance(m, Position) and isinstance(fix, Position):
            undulation = fix.undulation if m.alt is None else None
            return replace(m, undulation=undulation, horizontal_sd=fix.horizontal_sd, vertical_sd=fix.vertical_sd)
        return replace(m, sd=fix.sd) if isinstance(m, Velocity) and isinstance(fix, Velocity) else m

    def _select_distance(self, sensor: int, found: list[Measurement]) -> list[Measurement]:
        if self._distance_id not in (None, sensor):
            return []
        out = self._source_priority.select(f"{DISTANCE}_{sensor}", {Range: sensor, RadioHeight: sensor}, found)
        if any(isinstance(m, Range | RadioHeight) for m in out):
            if self._sensor not in (None, sensor):
                stamp = Stamp(out[0].stamp.t_rx_ns)
                out.append(Reading(stamp=stamp, name="distance_sensor", value=float(sensor)))
            self._sensor = sensor
        return out
