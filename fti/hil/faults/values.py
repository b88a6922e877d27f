"""Faults of devices, applied between the sensor model and the wire.  Faults of the world are in ``fti.hil.world``."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from fti.hil.faults.kinds import Cut, Fault, Fog, Invalid, Stuck
from fti.types import (
    Ack,
    Calibration,
    DeviceStatus,
    DeviceTime,
    ImuSample,
    Measurement,
    Pseudoranges,
    Range,
    Satellites,
)

OnDevice = Cut | Stuck | Invalid | Fog
WITHOUT_VALIDITY = (ImuSample, Satellites, Pseudoranges, DeviceTime, Ack, Calibration)


class DeviceFaults:
    """The faults of one device, in the order of the scenario."""

    def __init__(self, device: str, faults: Sequence[Fault]) -> None:
        self._faults = [f for f in faults if isinstance(f, OnDevice) and (not f.devices or device in f.devices)]
        self._held: dict[tuple[int, type, int], Measurement] = {}

    def apply(self, t: float, measurements: list[Measurement]) -> list[Measurement]:
        """What the device sends at t [s] instead of these measurements."""
        for i, fault in enumerate(self._faults):
            if fault.from_s <= t < fault.to_s:
                measurements = self._applied(i, fault, t, measurements)
        return measurements

    def _applied(self, index: int, fault: OnDevice, t: float, measurements: list[Measurement]) -> list[Measurement]:
        if isinstance(fault, Cut):
            return []
        if isinstance(fault, Stuck):
            return self._stuck(index, measurements)
        if isinstance(fault, Fog):
            return [_in_fog(m, fault, t) for m in measurements]
        return [_invalidated(m, fault.flags) for m in measurements]

    def _stuck(self, index: int, measurements: list[Measurement]) -> list[Measurement]:
        """Each kind of measurement as it was the first time: a device may send some in every cycle and some seldom."""
        seen: Counter[type] = Counter()
        found: list[Measurement] = []
        for m in measurements:
            seen[type(m)] += 1
            found.append(replace(self._held.setdefault((index, type(m), seen[type(m)]), m), stamp=m.stamp))
        return found


def _in_fog(measurement: Measurement, fog: Fog, t: float) -> Measurement:
    """What a laser says at t [s]; what is nearer than the visibility, and every other measurement, is as it was."""
    if not isinstance(measurement, Range) or not (measurement.slant_range or math.inf) > fog.visibility_m:
        return measurement
    if fog.echo_m is None:
        return replace(measurement, slant_range=None, valid=False)
    first, last = fog.echo_m
    passed = (t - fog.from_s) / (fog.to_s - fog.from_s)
    return replace(measurement, slant_range=first + (last - first) * passed, valid=True)


def _invalidated(measurement: Measurement, flags: tuple[str, ...]) -> Measurement:
    if isinstance(measurement, DeviceStatus):
        return replace(measurement, ok=False, flags=(*measurement.flags, *flags))
    if isinstance(measurement, WITHOUT_VALIDITY):
        return measurement
    return replace(measurement, valid=False)
