"""Faults of a device's clock: they change the timestamps only, not the times of sampling and sending."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace

from fti.constants import SECOND_NS
from fti.devices import BoundDevice
from fti.hil.faults.applicability import applies_to
from fti.hil.faults.values import is_active
from fti.hil.tables.fault_types import ClockDrift, ClockJump, Fault
from fti.messages.measurements import Measurement, Stamp, TimeScale


class ClockFaults:
    """The faults of the clock of one device."""

    def __init__(self, bound: BoundDevice, faults: Sequence[Fault]) -> None:
        self._faults = [f for f in faults if isinstance(f, ClockJump | ClockDrift) and applies_to(f, bound)]

    def error_s(self, t: float) -> float:
        """Error of the clock at t [s] of the flight, positive: fast; the error of a drift remains after its end."""
        error = 0.0
        for fault in self._faults:
            if isinstance(fault, ClockDrift):
                error += 1e-6 * fault.ppm * min(max(t - fault.from_s, 0.0), fault.to_s - fault.from_s)
            elif is_active(fault, t):
                error += fault.by_s
        return error

    def apply(self, t: float, measurements: list[Measurement]) -> list[Measurement]:
        """The measurements of t [s] with the time of this clock."""
        if not self._faults:
            return measurements
        error_ns = round(self.error_s(t) * SECOND_NS)
        if not error_ns:
            return measurements
        return [replace(m, stamp=_shift_stamp(m.stamp, error_ns)) for m in measurements]


def _shift_stamp(stamp: Stamp, by_ns: int) -> Stamp:
    """A time since power-on is never below zero."""
    if stamp.t_dev_ns is None:
        return stamp
    t_dev_ns = stamp.t_dev_ns + by_ns
    return replace(stamp, t_dev_ns=max(t_dev_ns, 0) if stamp.time_scale is TimeScale.BOOT else t_dev_ns)
