"""Targets of the study ``slant_range``: properties of the errors that hold on every terrain."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from fti.arrays import Mask
from fti.study import StudyResult
from fti.study.slant_range.experiment import SCENARIOS, AltimeterFlight, Run
from fti.study.statistics import LEVEL, min_positive

#: Roll [rad]: level, inside both beams, inside the wide beam and outside the narrow one, past both.
LEVEL_ROLL, NARROW_ROLL, BEYOND_ROLL, WIDE_ROLL, LARGE_ROLL = np.radians([3.0, 14.0, 20.0, 35.0, 45.0])
LOWEST_ROLL, PAST = np.radians(5.0), np.pi / 2
#: Errors of a sensor between two rolls: name, from, to [rad].
Errors = tuple[str, float, float]
#: The error of a radar that tolerates a turn is below this share of the pencil beam's.
COMPENSATED_SHARE = 0.2
EXACT = 1e-9


class Ordering(NamedTuple):
    """A property that holds on a flight or not."""

    id: str
    quantity: str
    holds: Callable[[Run], bool]


def _rms(record: AltimeterFlight, name: str, where: Mask) -> float:
    """RMS error [m] of the measurements in a mask."""
    error = record.error(name)[where]
    return float(np.sqrt(np.nanmean(error**2)))


def _roll_mask(record: AltimeterFlight, low: float, high: float) -> Mask:
    """Mask of the samples whose absolute roll is between two angles [rad]."""
    roll = np.abs(record.flight.roll)
    return np.asarray((roll >= low) & (roll < high))


def _errs_more(run: Run, of: tuple[str, str], worse: Errors, better: Errors, share: float = 1.0) -> bool:
    """Whether a share of the RMS error of one is still more than that of the other, on the flight (kind, ground)."""
    record = run[of]
    (worse_name, *worse_roll), (better_name, *better_roll) = worse, better
    more, less = _roll_mask(record, *worse_roll), _roll_mask(record, *better_roll)
    return share * _rms(record, worse_name, more) > _rms(record, better_name, less)


def _reads_short(run: Run, kind: str, name: str) -> bool:
    record = run[kind, "rough"]
    return bool(np.nanmedian(record.error(name)[_roll_mask(record, 0.0, LEVEL_ROLL)]) < 0.0)


_partial = functools.partial
ORDERINGS = (
    *(
        Ordering(f"flat.{name}", f"{name} radar compensates turns inside its beam",
                 _partial(_errs_more, of=("approach", "flat"), share=COMPENSATED_SHARE,
                          worse=("pencil", LOWEST_ROLL, roll), better=(name, LOWEST_ROLL, roll)))
        for name, roll in (("narrow", NARROW_ROLL), ("wide", WIDE_ROLL))
    ),
    *(
        Ordering(name, quantity, _partial(_errs_more, of=of, worse=("narrow", roll, PAST), better=("wide", roll, PAST)))
        for name, quantity, of, roll in (
            ("flat.beyond", "approach: beyond the narrow beam, narrow errs more than wide",
             ("approach", "flat"), BEYOND_ROLL),
            ("flat.large", "low level: the same in all turns", ("low_level", "flat"), BEYOND_ROLL),
            ("rough.large", "low level over hills, roll above 45 deg: narrow errs more than wide",
             ("low_level", "rough"), LARGE_ROLL),
        )
    ),
    Ordering("rough.level", "low level over hills, wings level: wide errs more than narrow",
             _partial(_errs_more, of=("low_level", "rough"), worse=("wide", 0.0, LEVEL_ROLL),
                      better=("narrow", 0.0, LEVEL_ROLL))),
    *(
        Ordering(f"{kind}.short_{name}", f"{kind}, wings level over hills: {name} radar reads short",
                 _partial(_reads_short, kind=kind, name=name))
        for kind in SCENARIOS for name in ("narrow", "wide")
    ),
    *(
        Ordering(f"{kind}.attitude", f"{kind} over hills: laser errs twice as much in turns as wings level",
                 _partial(_errs_more, of=(kind, "rough"), share=0.5,
                          worse=("pencil", BEYOND_ROLL, PAST), better=("pencil", 0.0, LEVEL_ROLL)))
        for kind in SCENARIOS
    ),
)  # fmt: skip


def judge_all(flights: list[Run]) -> list[StudyResult]:
    """The exact result, the orderings, and the errors."""
    return [
        pencil_on_level_ground(flights),
        *(_judge_ordering(ordering, flights) for ordering in ORDERINGS),
        *_reported_results(flights),
    ]


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
    return StudyResult.at_least(ordering.id, text, count, min_count)


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
                results.append(StudyResult.reported(f"{kind}.{ground}.{name}.{part}", text, rms))
    return results
