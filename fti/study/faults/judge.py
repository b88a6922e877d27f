"""Results of the study's flights: targets of fault detection, and reported figures."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from fti.arrays import Array, Rng
from fti.study import StudyResult
from fti.study.faults.cells import CELLS, GRADES, Cell
from fti.study.faults.detectability import is_detectable
from fti.study.faults.experiment import FaultOutcome, NominalOutcome, TaskOutcome, share

#: Limits of MI over fault time on the cells of the table: pooled, one cell; false exclusions in nominal hours.
POOLED, CELL, EXCLUSIONS, HOURS = 1e-3, 0.01, 2, 300.0
VALID = 0.995
#: HPL over sigma in the median, by number of receivers; over the formula at d = 0.
SIZES, FORMULA = {1: 12.0, 2: 6.5}, 1.2
RESAMPLINGS = 4000
#: Axes of a separation whose mean squares are reported, by quantity.
CALIBRATED_AXES = {"position": [0, 1], "velocity": [3, 4]}
CALIBRATED_HEIGHT_AXES = {"height": [2]}


def judge_all(found: Sequence[TaskOutcome], rng: Rng) -> list[StudyResult]:
    """All of it."""
    faults = [fault for task in found for fault in task.faults]
    detectable = [fault for fault in faults if is_detectable(CELLS[fault.cell])]
    nominal = [task.nominal for task in found]
    return [
        *_judge_misled(detectable, rng),
        *_judge_nominal(nominal),
        *_judge_sizes(nominal),
        *_calibration_results(nominal),
        *_cell_results(faults),
    ]


def bound(faults: Sequence[FaultOutcome], rng: Rng) -> float:
    """Upper 95 % bound of the share: nominal flights, with all their faults, are resampled (bootstrap)."""
    misled, seconds = defaultdict[int, int](int), defaultdict[int, int](int)
    for fault in faults:
        misled[fault.number] += fault.misled
        seconds[fault.number] += fault.seconds
    if not seconds:
        return 0.0
    above, below = np.array([misled[k] for k in seconds]), np.array(list(seconds.values()))
    drawn = rng.integers(0, len(above), (RESAMPLINGS, len(above)))
    return float(np.percentile(above[drawn].sum(axis=1) / below[drawn].sum(axis=1), 95.0))


def by_cell(faults: Iterable[FaultOutcome]) -> dict[int, list[FaultOutcome]]:
    """Faults by the index of their cell."""
    found = defaultdict[int, list[FaultOutcome]](list)
    for fault in faults:
        found[fault.cell].append(fault)
    return found


def _judge_misled(faults: Sequence[FaultOutcome], rng: Rng) -> list[StudyResult]:
    shares = {index: share(of) for index, of in by_cell(faults).items()}
    above = [CELLS[index].name for index, value in shares.items() if value > CELL]
    worst = max(shares, key=lambda index: shares[index], default=0)
    words = f"{len(faults)} faults on {len(shares)} cells of the table, {sum(f.seconds for f in faults) / 3600:.1f} h"
    after = sum(f.misled_after for f in faults)
    excluded = sum(f.refused_s is not None for f in faults) / max(1, len(faults))
    return [
        StudyResult.reported(
            "misled.pooled", f"valid and beyond a protection level, share of fault time, {words}", share(faults)
        ),
        StudyResult.at_most(
            "misled.bound", "the same, 95 % bound (bootstrap over flights)", bound(faults, rng), POOLED
        ),
        StudyResult.at_most("misled.cell", f"the same, worst cell, {CELLS[worst].name}", shares.get(worst, 0.0), CELL),
        StudyResult.reported("misled.cells", f"cells above {CELL:g}: {', '.join(sorted(above)) or 'none'}", len(above)),
        StudyResult.at_most(
            "hazardous", "seconds valid and beyond an alert limit", sum(f.hazardous for f in faults), 0
        ),
        StudyResult.reported(
            "misled.after", "seconds valid and beyond a protection level in the 2 min after faults", after
        ),
        StudyResult.reported("refused.share", "faults of the table after which a source was excluded", excluded),
    ]


def _judge_nominal(flights: Sequence[NominalOutcome]) -> list[StudyResult]:
    hours = sum(flight.hours for flight in flights)
    allowed = int(EXCLUSIONS * hours / HOURS)
    excluded = [(f, *event) for f in flights for event in f.exclusions]
    texts = "; ".join(f"flight {f.task.number} ({f.task.group.grade}) {t:.0f} s" for f, t, _ in excluded[:5])
    tactical = [f.valid for f in flights if f.task.group[:2] == ("tactical", 1) and np.isfinite(f.valid)]
    share_misled = sum(f.misled for f in flights) / max(1, sum(f.judged_count for f in flights))
    results = [
        StudyResult.at_most(
            "nominal.exclusions", f"false exclusions in {hours:.1f} h: {texts or 'none'}", len(excluded), allowed
        ),
        StudyResult.reported(
            "nominal.misled", "valid and beyond a protection level without a fault, share of time", share_misled
        ),
    ]
    if tactical:
        words = f"valid from 10 min on, tactical, one receiver, {len(tactical)} flights"
        results.append(StudyResult.at_least("nominal.valid", words, float(np.mean(tactical)), VALID))
    return results


def _judge_sizes(flights: Sequence[NominalOutcome]) -> list[StudyResult]:
    results = list[StudyResult]()
    for grade in GRADES:
        for receivers, size in SIZES.items():
            of = [f for f in flights if f.task.group[:2] == (grade, receivers)]
            if not of:
                continue
            name, words = f"{grade}.{receivers}", f"{grade}, receivers: {receivers}, {len(of)} flights"
            levels, formulas = (np.concatenate([getattr(f, x) for f in of]) for x in ("levels", "formulas"))
            results += [
                StudyResult.at_most(f"size.{name}", f"HPL over sigma, median, {words}", float(np.median(levels)), size),
                StudyResult.at_most(
                    f"formula.{name}", f"HPL over that at d = 0, {words}", float(np.median(formulas)), FORMULA
                ),
                StudyResult.reported(
                    f"square.level.{name}", f"(error / sigma)^2 (specified: <= 1.1), {words}", _mean(of, "level")
                ),
                StudyResult.reported(f"square.high.{name}", f"the same, vertical, {words}", _mean(of, "high")),
            ]
    return results


def _mean(flights: Sequence[NominalOutcome], which: str) -> float:
    return float(np.mean([getattr(flight, f"square_{which}") for flight in flights]))


def _calibration_results(flights: Sequence[NominalOutcome]) -> list[StudyResult]:
    """Mean square of d / sigma of d on the axes of a class."""
    results = list[StudyResult]()
    for grade in GRADES:
        pooled = defaultdict[tuple[str, int], Array](lambda: np.zeros(6))
        counts = defaultdict[tuple[str, int], int](int)
        for flight in flights:
            if flight.task.group.grade == grade:
                for key, sums in flight.calibration.sums.items():
                    pooled[key] += sums
                    counts[key] += flight.calibration.counts[key]
        for what, rung in sorted(pooled):
            means = pooled[what, rung] / counts[what, rung]
            for quantity, axes in (CALIBRATED_HEIGHT_AXES if what == "heights" else CALIBRATED_AXES).items():
                words = f"mean square of d / sigma (specified: 0.7 to 1.1), {grade}, {quantity} without {what}"
                name = f"calibration.{grade}.{what}.{rung}.{quantity}"
                results.append(StudyResult.reported(name, words, float(np.mean(means[axes]))))
    return results


def _cell_results(faults: Sequence[FaultOutcome]) -> list[StudyResult]:
    """A line for each cell, legs and turns together: in the table or not, MI, exclusions."""
    merged = defaultdict[Cell, list[FaultOutcome]](list)
    for fault in faults:
        merged[replace(CELLS[fault.cell], pattern="legs")].append(fault)
    results = list[StudyResult]()
    for cell in sorted(merged, key=lambda cell: cell.name):
        of, table_text = merged[cell], "in the table" if is_detectable(cell) else "not in the table"
        delays = [f.refused_s for f in of if f.refused_s is not None]
        exclusions = f"{len(delays)} excluded" + (f" after {np.median(delays):.0f} s in the median" if delays else "")
        hazard = sum(f.hazardous for f in of)
        words = f"MI, share of fault time, {table_text}, {len(of)} flights, {exclusions}, HMI {hazard} s"
        results.append(StudyResult.reported(f"cell.{cell.name.rpartition('/')[0]}", words, share(of)))
    return results
