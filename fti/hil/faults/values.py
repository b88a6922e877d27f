"""Faults of measured values, applied between sensor model and encoder."""

from __future__ import annotations

import math
import zlib
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
from msgspec.structs import replace

from fti.hil.faults.navigation import DelayLine, NavigationFault, misstate
from fti.hil.tables.fault_base import DeviceFault, LinkFault, QuantityFault
from fti.hil.tables.fault_types import (
    Bias,
    Fault,
    Fog,
    Forced,
    Invalid,
    Latency,
    Noise,
    Ramp,
    Scale,
    Stuck,
    WrongUnit,
)
from fti.hil.tables.quantity_names import change_quantity, matches_quantity, parse
from fti.messages.measurements import (
    Ack,
    BeamRange,
    Calibration,
    DeviceStatus,
    DeviceTime,
    Ephemeris,
    ImuSample,
    Measurement,
    Pseudoranges,
    Range,
    RangeScan,
    Satellites,
)
from fti.ranging.scan_points import replace_far_ranges

NumberFault = Bias | Ramp | Noise | WrongUnit | Scale | Forced
MeasurementFault = Stuck | Invalid | Fog | NumberFault | NavigationFault | Latency
WITHOUT_VALIDITY = (ImuSample, Satellites, Pseudoranges, Ephemeris, DeviceTime, Ack, Calibration)


def fault_rng(seed: int, device: str, index: int) -> np.random.Generator:
    """The random generator of one fault of one device.  index : of the fault in the scenario"""
    return np.random.default_rng([seed, zlib.crc32(device.encode()), index])


def is_active(fault: DeviceFault | LinkFault, t: float) -> bool:
    """Is t [s] in the interval of the fault?"""
    return fault.from_s <= t < fault.to_s


class DeviceFaults:
    """The faults of the measurements of one device, in the order of the scenario.  seed : of the scenario"""

    def __init__(self, device: str, faults: Sequence[Fault], seed: int = 0) -> None:
        self._faults = [
            (f, fault_rng(seed, device, i))
            for i, f in enumerate(faults)
            if isinstance(f, MeasurementFault) and f.includes_device(device)
        ]
        self._held: dict[tuple[int, type, int], Measurement] = {}
        self._delayed = {i: DelayLine(f) for i, (f, _) in enumerate(self._faults) if isinstance(f, Latency)}

    def apply(self, t: float, measurements: list[Measurement]) -> list[Measurement]:
        """The measurements with all faults that are active at t [s]."""
        for i, (fault, rng) in enumerate(self._faults):
            earlier = self._delayed[i].apply(t, measurements) if i in self._delayed else measurements
            if is_active(fault, t):
                measurements = self._apply_fault(i, fault, t, earlier, rng)
        return measurements

    def _apply_fault(
        self, index: int, fault: MeasurementFault, t: float, measurements: list[Measurement], rng: np.random.Generator
    ) -> list[Measurement]:
        if isinstance(fault, Latency):
            return measurements
        if isinstance(fault, Stuck):
            return self._hold_values(index, measurements)
        if isinstance(fault, Fog):
            return [_apply_fog(m, fault, t) for m in measurements]
        if isinstance(fault, Invalid):
            return [_invalidate(m, fault.flags) for m in measurements]
        if isinstance(fault, NavigationFault):
            return [misstate(m, fault) for m in measurements]
        return _change_number(fault, _number_error(fault, t, rng), measurements)

    def _hold_values(self, index: int, measurements: list[Measurement]) -> list[Measurement]:
        """The first values of each kind of measurement in the interval; kinds may have different rates."""
        seen: Counter[type] = Counter()
        results: list[Measurement] = []
        for m in measurements:
            seen[type(m)] += 1
            results.append(replace(self._held.setdefault((index, type(m), seen[type(m)]), m), stamp=m.stamp))
        return results


def _number_error(fault: NumberFault, t: float, rng: np.random.Generator) -> Callable[[float], float]:
    """Maps a true value to the faulty one at t [s]."""
    if isinstance(fault, Scale):
        return lambda value: value * (1.0 + fault.percent / 100.0)
    if isinstance(fault, WrongUnit):
        return lambda value: value * fault.factor
    if isinstance(fault, Forced):
        return lambda _: fault.value
    if isinstance(fault, Noise):
        return lambda value: value + float(rng.normal(0.0, fault.sd))
    added = fault.value if isinstance(fault, Bias) else fault.rate * (t - fault.from_s)
    return lambda value: value + added


def _change_number(
    fault: QuantityFault, error: Callable[[float], float], measurements: list[Measurement]
) -> list[Measurement]:
    quantity = parse(fault.quantity)
    return [
        change_quantity(m, quantity, error) if matches_quantity(m, quantity, fault.name) else m for m in measurements
    ]


def _apply_fog(measurement: Measurement, fog: Fog, t: float) -> Measurement:
    """A laser range in fog at t [s]; ranges within the visibility, and other measurements, are unchanged."""
    echo_m = None
    if fog.echo_m is not None:
        first, last = fog.echo_m
        echo_m = first + (last - first) * (t - fog.from_s) / (fog.to_s - fog.from_s)
    if isinstance(measurement, RangeScan):
        return replace_far_ranges(measurement, fog.visibility_m, echo_m)
    if not isinstance(measurement, Range | BeamRange) or not (measurement.slant_range or math.inf) > fog.visibility_m:
        return measurement
    return replace(measurement, slant_range=echo_m, valid=echo_m is not None)


def _invalidate(measurement: Measurement, flags: tuple[str, ...]) -> Measurement:
    if isinstance(measurement, DeviceStatus):
        return replace(measurement, ok=False, flags=(*measurement.flags, *flags))
    if isinstance(measurement, WITHOUT_VALIDITY):
        return measurement
    return replace(measurement, valid=False)
