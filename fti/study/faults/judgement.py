"""What the flights of the study come to: targets of fault detection, and figures that are told."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fti.study import REPORTED, Result
from fti.study.faults.cells import CELLS, GRADES, Cell
from fti.study.faults.detectable import is_detectable
from fti.study.faults.flown import Found, Nominal, Struck

Array = NDArray[np.float64]

#: Of fault time on the cells of the table: pooled, and of one cell; nominal hours with so many false exclusions.
POOLED, CELL, EXCLUSIONS, HOURS = 1e-3, 0.01, 2, 300.0
VALID = 0.995
#: HPL over sigma in the median, by number of receivers; over the formula at d = 0.
SIZES, FORMULA = {1: 12.0, 2: 6.5}, 1.2
RESAMPLINGS = 4000
#: Axes of a separation whose mean squares are told, by quantity.
CALIBRATED = {"position": [0, 1], "velocity": [3, 4]}
CALIBRATED_HEIGHT = {"height": [2]}


def judge(found: Sequence[Found], rng: np.random.Generator) -> list[Result]:
    """All of it."""
    faults = [fault for task in found for fault in task.faults]
    judged = [fault for fault in faults if is_detectable(CELLS[fault.cell])]
    nominal = [task.nominal for task in found]
    return [
        *_judge_misled(judged, rng),
        *_judge_nominal(nominal),
        *_judge_sizes(nominal),
        *_told_calibration(nominal),
        *_told_cells(faults),
    ]


def share(faults: Iterable[Struck]) -> float:
    """MI over fault time; 0 without any."""
    each = list(faults)
    return sum(f.misled for f in each) / max(1, sum(f.seconds for f in each))


def bound(faults: Sequence[Struck], rng: np.random.Generator) -> float:
    """Upper 95 % bound of the share: nominal flights, with all their faults, are drawn again (bootstrap)."""
    misled, seconds = defaultdict[int, int](int), defaultdict[int, int](int)
    for fault in faults:
        misled[fault.number] += fault.misled
        seconds[fault.number] += fault.seconds
    if not seconds:
        return 0.0
    above, below = np.array([misled[k] for k in seconds]), np.array(list(seconds.values()))
    drawn = rng.integers(0, len(above), (RESAMPLINGS, len(above)))
    return float(np.percentile(above[drawn].sum(axis=1) / below[drawn].sum(axis=1), 95.0))


def by_cell(faults: Iterable[Struck]) -> dict[int, list[Struck]]:
    """Faults by the index of their cell."""
    found = defaultdict[int, list[Struck]](list)
    for fault in faults:
        found[fault.cell].append(fault)
    return found


def _judge_misled(faults: Sequence[Struck], rng: np.random.Generator) -> list[Result]:
    shares = {index: share(of) for index, of in by_cell(faults).items()}
    above = [CELLS[index].name for index, value in shares.items() if value > CELL]
    worst = max(shares, key=lambda index: shares[index], default=0)
    words = f"{len(faults)} faults on {len(shares)} cells of the table, {sum(f.seconds for f in faults) / 3600:.1f} h"
    after = sum(f.misled_after for f in faults)
    return [
        _told("misled.pooled", f"valid and beyond a protection level, share of fault time, {words}", share(faults)),
        _at_most("misled.bound", "the same, 95 % bound (bootstrap over flights)", bound(faults, rng), POOLED),
        _at_most("misled.cell", f"the same, worst cell, {CELLS[worst].name}", shares.get(worst, 0.0), CELL),
        _told("misled.cells", f"cells above {CELL:g}: {', '.join(sorted(above)) or 'none'}", len(above)),
        _at_most("hazardous", "seconds valid and beyond an alert limit", sum(f.hazardous for f in faults), 0),
        _told("misled.after", "seconds valid and beyond a protection level in the 2 min behind faults", after),
        _told("refused.share", "faults of the table after which a source was excluded", _refused(faults)),
    ]


def _judge_nominal(flights: Sequence[Nominal]) -> list[Result]:
    hours = sum(flight.hours for flight in flights)
    allowed = int(EXCLUSIONS * hours / HOURS)
    excluded = [(f, *event) for f in flights for event in f.exclusions]
    texts = "; ".join(f"flight {f.task.number} ({f.task.group.grade}) {t:.0f} s" for f, t, _ in excluded[:5])
    tactical = [f.valid for f in flights if f.task.group[:2] == ("tactical", 1) and np.isfinite(f.valid)]
    share_misled = sum(f.misled for f in flights) / max(1, sum(f.judged for f in flights))
    results = [
        _at_most("nominal.exclusions", f"false exclusions in {hours:.1f} h: {texts or 'none'}", len(excluded), allowed),
        _told("nominal.misled", "valid and beyond a protection level without a fault, share of time", share_misled),
    ]
    if tactical:
        words = f"valid from 10 min on, tactical, one receiver, {len(tactical)} flights"
        results.append(_at_least("nominal.valid", words, float(np.mean(tactical)), VALID))
    return results


def _judge_sizes(flights: Sequence[Nominal]) -> list[Result]:
    results = list[Result]()
    for grade in GRADES:
        for receivers, size in SIZES.items():
            of = [f for f in flights if f.task.group[:2] == (grade, receivers)]
            if not of:
                continue
            name, words = f"{grade}.{receivers}", f"{grade}, receivers: {receivers}, {len(of)} flights"
            levels, formulas = (np.concatenate([getattr(f, x) for f in of]) for x in ("levels", "formulas"))
            results += [
                _at_most(f"size.{name}", f"HPL over sigma, median, {words}", float(np.median(levels)), size),
                _at_most(f"formula.{name}", f"HPL over that at d = 0, {words}", float(np.median(formulas)), FORMULA),
                _told(f"square.level.{name}", f"(error / sigma)^2 (specified: <= 1.1), {words}", _mean(of, "level")),
                _told(f"square.high.{name}", f"the same, vertical, {words}", _mean(of, "high")),
            ]
    return results


def _mean(flights: Sequence[Nominal], which: str) -> float:
    return float(np.mean([getattr(flight, f"square_{which}") for flight in flights]))


def _told_calibration(flights: Sequence[Nominal]) -> list[Result]:
    """Mean square of d / sigma of d on the axes that a class tests."""
    results = list[Result]()
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
            for quantity, axes in (CALIBRATED_HEIGHT if what == "heights" else CALIBRATED).items():
                words = f"mean square of d / sigma (specified: 0.7 to 1.1), {grade}, {quantity} without {what}"
                name = f"calibration.{grade}.{what}.{rung}.{quantity}"
                results.append(_told(name, words, float(np.mean(means[axes]))))
    return results


def _told_cells(faults: Sequence[Struck]) -> list[Result]:
    """A line for each cell, legs and turns together: in the table or not, MI, exclusions."""
    merged = defaultdict[Cell, list[Struck]](list)
    for fault in faults:
        merged[replace(CELLS[fault.cell], pattern="legs")].append(fault)
    results = list[Result]()
    for cell in sorted(merged, key=lambda cell: cell.name):
        of, place = merged[cell], "in the table" if is_detectable(cell) else "not in the table"
        delays = [f.refused_s for f in of if f.refused_s is not None]
        seen = f"{len(delays)} excluded" + (f" after {np.median(delays):.0f} s in the median" if delays else "")
        hazard = sum(f.hazardous for f in of)
        words = f"MI, share of fault time, {place}, {len(of)} flights, {seen}, HMI {hazard} s"
        results.append(_told(f"cell.{cell.name.rpartition('/')[0]}", words, share(of)))
    return results


def _refused(faults: Sequence[Struck]) -> float:
    return sum(f.refused_s is not None for f in faults) / max(1, len(faults))


def _at_least(name: str, quantity: str, value: float, least: float) -> Result:
    return Result(name, quantity, value, f">= {least:g}", value >= least)


def _at_most(name: str, quantity: str, value: float, most: float) -> Result:
    return Result(name, quantity, value, f"<= {most:g}", value <= most)


def _told(name: str, quantity: str, value: float) -> Result:
    return Result(name, quantity, value, REPORTED, holds=True)
