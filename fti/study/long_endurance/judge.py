"""Targets of the study ``long-endurance``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fti.arrays import Array
from fti.study import StudyResult
from fti.study.long_endurance.experiment import (
    AIDS,
    GROUNDS,
    INSTANTS_S,
    NAMES,
    OUTAGE_S,
    STRETCH_S,
    UNIT,
    UNITS,
    Track,
    Tracks,
)
from fti.study.statistics import LEVEL, pooled_ratio, ratio_interval, rms, sign_test

STABLE, SIGMA, INTERVAL = (0.8, 1.25), (0.6, 1.25), 0.90


def judge_runs(runs: Sequence[Tracks]) -> list[StudyResult]:
    """All rows but those of the hour."""
    return [*_judge_aid("1", runs), *_judge_aid("9", runs), *_compare_beams(runs), *_error_table(runs)]


def judge_hours(tracks: Sequence[Track]) -> list[StudyResult]:
    """The error in the last 100 s of the hour."""
    error = rms([track.distance[track.t >= track.t[-1] - STRETCH_S] for track in tracks])
    words = f"an hour with 1 beam and the barometer, RMS of the last {STRETCH_S:g} s [m], N = {len(tracks)} flights"
    return [StudyResult.reported("T17.hour", words, error)]


def _judge_aid(aid: str, runs: Sequence[Tracks]) -> Iterator[StudyResult]:
    tracks = [run[UNIT, aid] for run in runs]
    begin, end = OUTAGE_S
    first = _by_ground([track.over_sigma(begin, begin + STRETCH_S) for track in tracks])
    last = _by_ground([track.over_sigma(end - STRETCH_S, end) for track in tracks])
    # pooled_ratio and its interval are roots of a ratio of sums; the ratio itself is their square
    low, high = (x**2 for x in ratio_interval(last, first, np.random.default_rng(17), INTERVAL))
    words = f"{NAMES[aid]}, error over sigma of the last {STRETCH_S:g} s over the first"
    yield StudyResult.reported(
        f"T17.stable.{aid}", f"{words}, N = {len(tracks)} flights", pooled_ratio(last, first) ** 2
    )
    yield StudyResult.at_least(f"T17.stable.{aid}.low", f"{words}, lower 90 % limit", low, STABLE[0])
    yield StudyResult.at_most(f"T17.stable.{aid}.high", f"{words}, upper 90 % limit", high, STABLE[1])
    over_sigma = rms(np.concatenate([track.ratio[track.inside(*OUTAGE_S)] for track in tracks]))
    yield StudyResult(
        f"T17.sigma.{aid}",
        f"{NAMES[aid]}, RMS of error over sigma in the outage",
        over_sigma,
        f"{SIGMA[0]:g} to {SIGMA[1]:g}",
        SIGMA[0] <= over_sigma <= SIGMA[1],
    )


def _by_ground(values: Sequence[float]) -> Array:
    """Sums of the values of the flights over each ground."""
    return np.array([sum(values[first::GROUNDS]) for first in range(min(GROUNDS, len(values)))])


def _compare_beams(runs: Sequence[Tracks]) -> Iterator[StudyResult]:
    errors = {aid: np.array([run[UNIT, aid].rms(*OUTAGE_S) for run in runs]) for aid in AIDS}
    for aid, error in errors.items():
        bound = rms([rms(run[UNIT, aid].sd[run[UNIT, aid].inside(*OUTAGE_S)]) for run in runs])
        words = f"{NAMES[aid]}, RMS of the error in the outage [m]; INS / filter / bound: "
        words += f"{rms(errors['baro']):.3g} / {rms(error):.3g} / {bound:.3g} m"
        yield StudyResult.reported(f"T17.rms.{aid}", words, rms(error))
    p = sign_test(int(np.sum(errors["9"] < errors["1"])), len(runs))
    yield StudyResult("T17.order", "p that 9 beams are not better than 1", p, f"< {LEVEL}", p < LEVEL)


def _error_table(runs: Sequence[Tracks]) -> Iterator[StudyResult]:
    for unit in UNITS:
        for aid in AIDS:
            tracks = [run[unit, aid] for run in runs if (unit, aid) in run]
            for instant in INSTANTS_S:
                error = rms([track.at(OUTAGE_S[0] + instant) for track in tracks])
                words = f"{unit}, {NAMES[aid]}, RMS {instant:g} s into the outage [m], N = {len(tracks)}"
                yield StudyResult.reported(f"E.{unit}.{aid}.{instant:g}", words, error)
