"""Slant range: effect of attitude, beam and relief on a height above ground, on an approach and low over hills.

Source 003, section 2.3.3, figures 2.54 to 2.59: an airliner's approach (8000 ft, three turns, 3 deg glide path) and a
fighter's low-level flight (banks of 35 to 75 deg, once past the vertical), each over level and over rough ground, with
a laser (pencil beam) and two radar altimeters (half power 15 deg and 35 deg off the boresight).  Elevation and flights
of the source are not public: these are drawn, and only results independent of them are judged.

N = runs: as many flights of each kind, each over a country of its own.  The unit is the flight, never the sample; an
ordering must hold on so many flights that a sign test has p < 0.01 / m, m the number of these tests.  The error is
measured slant range minus nadir height, no noise beyond the receivers'.  "Reported" results are not judged.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.parallel_runs import Progress, run_all
from fti.study import REPORTED, DrawFigure, StudyResult
from fti.study._altimeter_flight import AltimeterFlight, fly
from fti.study._scenarios import RangingScenario, approach, low_level
from fti.study._statistics import LEVEL, min_positive

RUNS = 15
SEED = 23

#: Period of measurements on the approach and on the low-level flight [s].
EVERY_S = {"approach": 3.0, "low_level": 0.5}
SCENARIOS: dict[str, Callable[[int, float], RangingScenario]] = {"approach": approach, "low_level": low_level}
GROUNDS = ("flat", "rough")
#: Roll [rad]: level, inside both beams, inside the wide beam and outside the narrow one, past both.
LEVEL_ROLL, NARROW_ROLL, BEYOND_ROLL, WIDE_ROLL, LARGE_ROLL = np.radians([3.0, 14.0, 20.0, 35.0, 45.0])
#: The error of a radar that tolerates a turn is below this share of the pencil beam's.
COMPENSATED_SHARE = 0.2
EXACT = 1e-9

#: A flight of each kind over each ground: of (kind, ground).
Run = dict[tuple[str, str], AltimeterFlight]
Mask = NDArray[np.bool_]


class Ordering(NamedTuple):
    """A property that holds on a flight or not."""

    id: str
    quantity: str
    holds: Callable[[Run], bool]


def _rms(record: AltimeterFlight, name: str, where: Mask) -> float:
    """RMS error [m] of the measurements in a mask."""
    error = record.error(name)[where]
    return float(np.sqrt(np.nanmean(error**2)))


def _roll_mask(record: AltimeterFlight, low: float, high: float = np.pi / 2) -> Mask:
    """Mask of the samples whose absolute roll is between two angles [rad]."""
    roll = np.abs(record.flight.roll)
    return np.asarray((roll >= low) & (roll < high))


def _compensates(run: Run, name: str, low: float, high: float) -> bool:
    record = run["approach", "flat"]
    turning = _roll_mask(record, low, high)
    return _rms(record, name, turning) < COMPENSATED_SHARE * _rms(record, "pencil", turning)


def _narrow_is_worse(run: Run, kind: str, ground: str, beyond: float) -> bool:
    record = run[kind, ground]
    turning = _roll_mask(record, beyond)
    return _rms(record, "narrow", turning) > _rms(record, "wide", turning)


def _reads_short(run: Run, kind: str, name: str) -> bool:
    record = run[kind, "rough"]
    return bool(np.nanmedian(record.error(name)[_roll_mask(record, 0.0, LEVEL_ROLL)]) < 0.0)


def _wide_is_worse_level(run: Run) -> bool:
    record = run["low_level", "rough"]
    level = _roll_mask(record, 0.0, LEVEL_ROLL)
    return _rms(record, "wide", level) > _rms(record, "narrow", level)


def _attitude_dominates(run: Run, kind: str) -> bool:
    record = run[kind, "rough"]
    return _rms(record, "pencil", _roll_mask(record, BEYOND_ROLL)) > 2.0 * _rms(
        record, "pencil", _roll_mask(record, 0.0, LEVEL_ROLL)
    )


_partial = functools.partial
ORDERINGS = (
    Ordering(
        "flat.narrow", "narrow radar compensates turns inside its beam",
        _partial(_compensates, name="narrow", low=np.radians(5.0), high=NARROW_ROLL),
    ),
    Ordering(
        "flat.wide", "wide radar compensates turns inside its beam",
        _partial(_compensates, name="wide", low=np.radians(5.0), high=WIDE_ROLL),
    ),
    Ordering(
        "flat.beyond", "approach: beyond the narrow beam, narrow errs more than wide",
        _partial(_narrow_is_worse, kind="approach", ground="flat", beyond=BEYOND_ROLL),
    ),
    Ordering(
        "flat.large", "low level: the same in all turns",
        _partial(_narrow_is_worse, kind="low_level", ground="flat", beyond=BEYOND_ROLL),
    ),
    Ordering(
        "rough.large", "low level over hills, roll above 45 deg: narrow errs more than wide",
        _partial(_narrow_is_worse, kind="low_level", ground="rough", beyond=LARGE_ROLL),
    ),
    Ordering("rough.level", "low level over hills, wings level: wide errs more than narrow", _wide_is_worse_level),
    *(
        Ordering(f"{kind}.short_{name}", f"{kind}, wings level over hills: {name} radar reads short",
                 _partial(_reads_short, kind=kind, name=name))
        for kind in SCENARIOS for name in ("narrow", "wide")
    ),
    *(
        Ordering(f"{kind}.attitude", f"{kind} over hills: laser errs twice as much in turns as wings level",
                 _partial(_attitude_dominates, kind=kind))
        for kind in SCENARIOS
    ),
)  # fmt: skip


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` flights of each kind over each ground."""
    flights = run_all(fly_all, range(seed, seed + runs), progress)
    return [
        pencil_on_level_ground(flights),
        *(_judge_ordering(ordering, flights) for ordering in ORDERINGS),
        *_reported_results(flights),
    ]


def fly_all(seed: int) -> Run:
    """Both flights, over both grounds."""
    scenarios = {kind: make(seed, EVERY_S[kind]) for kind, make in SCENARIOS.items()}
    return {
        (kind, ground): fly(scenario.flight, scenario.ground(ground))
        for kind, scenario in scenarios.items()
        for ground in GROUNDS
    }


def pencil_on_level_ground(flights: list[Run]) -> StudyResult:
    """On level ground a pencil beam measures h / (cos roll cos pitch) (eq. 2.67)."""
    worst = max(_pencil_error(run[kind, "flat"]) for run in flights for kind in SCENARIOS)
    return StudyResult(
        "flat.pencil", "pencil beam is h / cos, the worst, relative", worst, f"< {EXACT:g}", worst < EXACT
    )


def _pencil_error(record: AltimeterFlight) -> float:
    cosine = np.cos(record.flight.roll) * np.cos(record.flight.pitch)
    is_measured = np.isfinite(record.measured["pencil"])
    return float(np.max(np.abs(record.measured["pencil"] * cosine / record.nadir - 1.0)[is_measured]))


def _judge_ordering(ordering: Ordering, flights: list[Run]) -> StudyResult:
    count, min_count = sum(map(ordering.holds, flights)), min_positive(len(flights), LEVEL / len(ORDERINGS))
    text = f"flights of {len(flights)}; {ordering.quantity}"
    return StudyResult(ordering.id, text, count, f">= {min_count}", count >= min_count)


def _reported_results(flights: list[Run]) -> list[StudyResult]:
    """RMS of all flights together, wings level and in turns below 80 deg."""
    results: list[StudyResult] = []
    for kind, ground in flights[0]:
        for name in flights[0][kind, ground].measured:
            for part, low, high in (("level", 0.0, LEVEL_ROLL), ("turns", LEVEL_ROLL, np.radians(80.0))):
                squares = [
                    _rms(run[kind, ground], name, _roll_mask(run[kind, ground], low, high)) ** 2 for run in flights
                ]
                rms, text = float(np.sqrt(np.mean(squares))), f"RMS error of {len(flights)} flights [m]"
                results.append(StudyResult(f"{kind}.{ground}.{name}.{part}", text, rms, REPORTED, holds=True))
    return results


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Pictures like fig. 2.54 to 2.59, of the flights with this seed."""
    from fti.study import _slant_range_plots as plots  # noqa: PLC0415 - matplotlib is loaded for plots only

    scenarios = functools.cache(lambda kind: SCENARIOS[kind](seed, EVERY_S[kind] / 3.0))
    return {
        "approach-track": lambda: plots.track(scenarios("approach")),
        "approach-flat": lambda: plots.situation(scenarios("approach"), "flat"),
        "approach-rough": lambda: plots.situation(scenarios("approach"), "rough"),
        "low-level-track": lambda: plots.track(scenarios("low_level")),
        "low-level-flat": lambda: plots.situation(scenarios("low_level"), "flat"),
        "low-level-rough": lambda: plots.situation(scenarios("low_level"), "rough"),
    }
