"""One hour of a nominal flight through the product, faults that branch off it, and their counts.

The filter processes the whole flight before a fault; one hour serves some ten faults, each of which continues with a
copy of the product.  A fault lasts 5 minutes (slow ramps 15), and the flight ends 2 minutes after it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fti.arrays import Array, Mask
from fti.study.faults.cells import CELLS, Cell, SensorFault
from fti.study.faults.detectability import is_detectable
from fti.study.faults.flight import (
    AFTER_S,
    ONSET_S,
    SLOW_FAULT_S,
    Rates,
    SimulatedFlight,
    draw_nominal,
    fault_s,
    strike,
)
from fti.study.faults.product import LIMITS, Product, SeparationCalibration, SolutionRecord, errors_n

#: An inertial unit of 10 Hz in place of 25: samples are interpolated (``fti.nav.filter.delayed_measurements``).
RATES = Rates(imu=10, receivers=(1.0, 2.0, 5.0), baro=2.0, ahrs=2.0)
HOUR_S = ONSET_S[1]
#: Nominal flights are judged after their alignment [s]; their validity from ten minutes on.
SETTLED_S, VALID_FROM_S = 60.0, 600.0
#: Text of an exclusion.
REFUSED = "refused: "
#: Period of the ratios of a nominal flight [s].
RATIO_PERIOD_S = 10


class AircraftGroup(NamedTuple):
    """Aircraft that can share a nominal flight."""

    grade: str
    receivers: int
    pattern: str

    @classmethod
    def of(cls, cell: Cell) -> AircraftGroup:
        """The group of a cell."""
        return cls(cell.grade, cell.receivers, cell.pattern)


class FlightTask(NamedTuple):
    """A nominal flight, and the faults that branch off it: indices of ``CELLS``."""

    seed: int
    number: int
    group: AircraftGroup
    faults: tuple[int, ...]
    duration_s: float = HOUR_S


@dataclass(frozen=True, eq=False)
class NominalOutcome:
    """Outcome of a nominal flight.

    hours; exclusions : time [s] and text of each;  misled : solutions beyond their levels, of ``judged_count``
    valid : share from ten minutes on, NaN where it is shorter;  levels, formulas : HPL over sigma, over the formula
    square_level, square_high : mean of (error / sigma)^2, horizontal (per axis) and vertical
    """

    task: FlightTask
    hours: float
    exclusions: tuple[tuple[float, str], ...]
    judged_count: int
    misled: int
    valid: float
    levels: Array
    formulas: Array
    square_level: float
    square_high: float
    calibration: SeparationCalibration


@dataclass(frozen=True, eq=False)
class FaultOutcome:
    """Outcome of a fault.

    number : of the nominal flight;  seconds, valid : of the fault;  misled, misled_after : seconds valid and beyond a
    protection level, during the fault and after it;  hazardous : beyond an alert limit, in both
    refused_s : from the onset to the first exclusion, None: never;  worst : time and size of the largest error beyond
    """

    cell: int
    number: int
    onset_s: float
    seconds: int
    valid: int
    misled: int
    misled_after: int
    hazardous: int
    refused_s: float | None
    worst: str


@dataclass(frozen=True, eq=False)
class TaskOutcome:
    """Outcome of one task."""

    nominal: NominalOutcome
    faults: tuple[FaultOutcome, ...]


def fly(task: FlightTask) -> TaskOutcome:
    """Simulate a task."""
    rng = np.random.default_rng([task.seed, task.number, 1])
    onsets_s = np.sort(rng.uniform(min(ONSET_S[0], 0.5 * task.duration_s), task.duration_s, len(task.faults)))
    flight = nominal_flight(task)
    product, records, faults, begin_s = Product(_nominal_cell(task)), list[SolutionRecord](), list[FaultOutcome](), 0.0
    for index, onset_s in zip(task.faults, onsets_s.tolist(), strict=True):
        records.append(product.fly(flight.between(begin_s, onset_s)))
        begin_s = onset_s
        faults.append(
            _fault_outcome(task, index, onset_s, strike_through(product, flight, CELLS[index], onset_s, task))
        )
    records.append(product.fly(flight.between(begin_s, task.duration_s)))
    return TaskOutcome(_nominal_outcome(task, flight, join_records(records)), tuple(faults))


def nominal_flight(task: FlightTask) -> SimulatedFlight:
    """The nominal flight, long enough for the last fault."""
    swapped = [CELLS[i] for i in task.faults if CELLS[i].kind is SensorFault.SWAPPED]
    cell = swapped[0] if swapped else _nominal_cell(task)
    return draw_nominal(cell, 1000 * task.seed + task.number, task.duration_s + SLOW_FAULT_S + AFTER_S, RATES)


def strike_through(
    product: Product, nominal: SimulatedFlight, cell: Cell, onset_s: float, task: FlightTask
) -> tuple[SimulatedFlight, SolutionRecord]:
    """A fault through a copy of the product."""
    flight = strike(nominal, cell, onset_s, 1000 * task.seed + task.number)
    return flight, product.branch().fly(flight.between(onset_s, flight.duration_s))


def join_records(records: list[SolutionRecord]) -> SolutionRecord:
    """Join consecutive records."""
    calibration = SeparationCalibration()
    for record in records:
        calibration.add(record.calibration)
    events = tuple(event for record in records for event in record.events)
    return SolutionRecord(np.concatenate([record.rows for record in records]), events, calibration)


def _nominal_cell(task: FlightTask) -> Cell:
    group = task.group
    return Cell(group.grade, SensorFault.NONE, receivers=group.receivers, pattern=group.pattern)


def exceedances(flight: SimulatedFlight, record: SolutionRecord) -> tuple[Mask, Mask]:
    """Masks of the valid solutions with an error beyond a protection level, and beyond an alert limit."""
    errors = errors_n(flight, record.rows)
    level, high = np.hypot(errors[:, 0], errors[:, 1]), np.abs(errors[:, 2])
    misled = record.is_valid & ((level > record["hpl"]) | (high > record["vpl"]))
    hazardous = record.is_valid & ((level > LIMITS.position_m) | (high > LIMITS.altitude_m))
    return misled, hazardous


def share(faults: Iterable[FaultOutcome]) -> float:
    """MI over fault time; 0 without any."""
    each = list(faults)
    return sum(f.misled for f in each) / max(1, sum(f.seconds for f in each))


def _nominal_outcome(task: FlightTask, flight: SimulatedFlight, record: SolutionRecord) -> NominalOutcome:
    settled = record["t"] >= SETTLED_S
    misled, _ = exceedances(flight, record)
    errors, level_sd, high_sd = errors_n(flight, record.rows), record["level_sd"], record["high_sd"]
    late = record["t"] >= VALID_FROM_S
    validity_s = int(task.duration_s - VALID_FROM_S)
    full = settled & (record["is_full"] > 0.0)
    hpl = record["hpl"][full][::RATIO_PERIOD_S]
    return NominalOutcome(
        task,
        hours=task.duration_s / 3600.0,
        exclusions=tuple((t, text) for t, text in record.events if REFUSED in text),
        judged_count=int(settled.sum()),
        misled=int((misled & settled).sum()),
        valid=float((record.is_valid & late).sum() / validity_s) if validity_s > 0 else np.nan,
        levels=hpl / level_sd[full][::RATIO_PERIOD_S],
        formulas=hpl / record["formula"][full][::RATIO_PERIOD_S],
        square_level=float(np.mean(((errors[:, :2] / level_sd[:, None]) ** 2)[settled])),
        square_high=float(np.mean(((errors[:, 2] / high_sd) ** 2)[settled])),
        calibration=record.calibration,
    )


def _fault_outcome(
    task: FlightTask, index: int, onset_s: float, through: tuple[SimulatedFlight, SolutionRecord]
) -> FaultOutcome:
    flight, record = through
    end_s = onset_s + fault_s(CELLS[index])
    during = record["t"] < end_s
    misled, hazardous = exceedances(flight, record)
    refused = [t for t, text in record.events if REFUSED in text and t < end_s]
    return FaultOutcome(
        index,
        task.number,
        onset_s,
        seconds=int(fault_s(CELLS[index])),
        valid=int((record.is_valid & during).sum()),
        misled=int((misled & during).sum()),
        misled_after=int((misled & ~during).sum()),
        hazardous=int(hazardous.sum()),
        refused_s=refused[0] - onset_s if refused else None,
        worst=_describe_worst(flight, record, misled, onset_s),
    )


def _describe_worst(flight: SimulatedFlight, record: SolutionRecord, misled: Mask, onset_s: float) -> str:
    """The solution with the largest excess over its level; empty without one."""
    if not misled.any():
        return ""
    errors = errors_n(flight, record.rows)
    level, high = np.hypot(errors[:, 0], errors[:, 1]), np.abs(errors[:, 2])
    at = int(np.argmax(np.where(misled, np.maximum(level / record["hpl"], high / record["vpl"]), 0.0)))
    first_s = record["t"][np.argmax(misled)] - onset_s
    return (
        f"from {first_s:.0f} s; at {record['t'][at] - onset_s:.0f} s horizontal {level[at]:.1f} m,"
        f" HPL {record['hpl'][at]:.1f} m, vertical {high[at]:.1f} m, VPL {record['vpl'][at]:.1f} m"
    )


FAULTS_PER_FLIGHT = 12
#: Divisor of the number of faults of cells outside the table.
OTHER_CELLS_DIVISOR = 11


def plan(runs: int, seed: int, duration_s: float = HOUR_S) -> list[FlightTask]:
    """``runs`` faults of each cell of the table, an eleventh of that (at least one) of others, twelve to a flight.

    Terrains follow each other from flight to flight, ten of them; groups of aircraft take turns.
    """
    rng = np.random.default_rng([seed, 2])
    by_group = dict[AircraftGroup, list[int]]()
    for index, cell in enumerate(CELLS):
        if cell.kind is not SensorFault.NONE:
            count = runs if is_detectable(cell) else max(1, runs // OTHER_CELLS_DIVISOR)
            by_group.setdefault(AircraftGroup.of(cell), []).extend([index] * count)
    batches = list[tuple[AircraftGroup, tuple[int, ...]]]()
    for group, indices in by_group.items():
        shuffled = rng.permutation(indices).tolist()
        batches += [
            (group, tuple(shuffled[at : at + FAULTS_PER_FLIGHT])) for at in range(0, len(shuffled), FAULTS_PER_FLIGHT)
        ]
    order = rng.permutation(len(batches)).tolist()
    return [FlightTask(seed, number, batches[at][0], batches[at][1], duration_s) for number, at in enumerate(order)]
