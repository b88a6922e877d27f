"""Faults of position, attitude and their age, applied to the measurements of a device."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Hashable

from msgspec.structs import replace

from fti.geodesy.formulas import wrap_half_turn
from fti.hil.tables.fault_types import AttitudeOffset, Latency, SwappedCoordinates, Undulation
from fti.hil.tables.quantity_names import NAME_FIELDS
from fti.messages.measurements import Attitude, Measurement, Position, RangeScan, Reading

NavigationFault = SwappedCoordinates | Undulation | AttitudeOffset
MAGNETIC_HEADING = "magnetic_heading"
#: Samples are this close to their times [s].
TIME_TOLERANCE_S = 1e-6


def misstate(m: Measurement, fault: NavigationFault) -> Measurement:
    """The measurement with the error of the fault; unchanged if it has neither position nor attitude."""
    if isinstance(fault, AttitudeOffset):
        return _turn_attitude(m, fault)
    if not isinstance(m, Position):
        return m
    if isinstance(fault, SwappedCoordinates):
        return replace(m, lat=m.lon, lon=m.lat)
    undulation = 0.0 if fault.stated == "zero" else m.undulation
    return m if m.alt_msl is None else replace(m, alt=m.alt_msl, undulation=undulation)


def _turn_attitude(m: Measurement, fault: AttitudeOffset) -> Measurement:
    """An attitude, or a magnetic heading, with the constant errors."""
    heading = math.radians(fault.heading_deg)
    if isinstance(m, Reading) and m.name == MAGNETIC_HEADING:
        return replace(m, value=None if m.value is None else (m.value + heading) % math.tau)
    if not isinstance(m, Attitude):
        return m
    roll, pitch = math.radians(fault.roll_deg), math.radians(fault.pitch_deg)
    return replace(
        m,
        roll=None if m.roll is None else wrap_half_turn(m.roll + roll),
        pitch=None if m.pitch is None else m.pitch + pitch,
        heading=None if m.heading is None else (m.heading + heading) % math.tau,
    )


class DelayLine:
    """Delays the values, separately for each kind of measurement and name.

    Scans are left as they are: their models measure them earlier (``fti.hil.sensors.base``).
    """

    def __init__(self, fault: Latency) -> None:
        self._by_s = fault.by_s
        self._past: dict[Hashable, deque[tuple[float, Measurement]]] = {}

    def apply(self, t: float, measurements: list[Measurement]) -> list[Measurement]:
        """The newest values measured at or before t - by_s [s], else the first values; with new timestamps."""
        seen: Counter[Hashable] = Counter()
        found: list[Measurement] = []
        for m in measurements:
            if isinstance(m, RangeScan):
                found.append(m)
                continue
            kind = (type(m), *(getattr(m, field, None) for field in NAME_FIELDS))
            seen[kind] += 1
            past = self._past.setdefault((kind, seen[kind]), deque())
            past.append((t, m))
            while len(past) > 1 and past[1][0] <= t - self._by_s + TIME_TOLERANCE_S:
                past.popleft()
            found.append(replace(past[0][1], stamp=m.stamp))
        return found
