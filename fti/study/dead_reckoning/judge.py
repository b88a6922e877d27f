"""Targets of the study ``dead-reckoning``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fti.arrays import Array
from fti.study import StudyResult
from fti.study.dead_reckoning.exact_looks import gyro_limit
from fti.study.dead_reckoning.experiment import INSTANTS_S, Track, Tracks
from fti.study.dead_reckoning.flight import BARO_NOISE_M, OUTAGE_S, SECONDS, SPEED_MPS, TIME_SD
from fti.study.dead_reckoning.printed_forms import FORMS
from fti.study.statistics import pooled_ratio, rms

MAX_RATIO, MIN_SIGMA, MAX_SIGMA = 0.1, 0.80, 1.25
#: Units whose error at the end is judged; the navigation grade needs no aid for 500 s.
JUDGED_UNITS = ("tactical", "mems")
#: Parts of the horizontal error: words, and axes of ``Track.error``.
PARTS = {"": [0, 1], "along ": [0], "across ": [1]}


def judge(runs: Sequence[Tracks]) -> list[StudyResult]:
    """All rows, by path and unit."""
    results = [
        StudyResult.reported("D.barometer", "noise of the barometer, one sigma [m]", BARO_NOISE_M),
        StudyResult.reported("D.timing", "time error of the looks, one sigma [ms]", 1e3 * TIME_SD),
        StudyResult.reported(
            "D.limit.straight.across",
            "straight, exact looks over inertial alone, across, by equal gyro biases alone: 3 V / (g t)",
            gyro_limit(SPEED_MPS, SECONDS - OUTAGE_S),
        ),
    ]
    for path, unit in dict.fromkeys((path, unit) for tracks in runs for path, unit, _ in tracks):
        flights = [{aid: track for (p, u, aid), track in tracks.items() if (p, u) == (path, unit)} for tracks in runs]
        results += _judge_cell(f"{unit}.{path}", f"{unit}, {path}", unit, [each for each in flights if each])
    return results


def _judge_cell(name: str, words: str, unit: str, flights: Sequence[Mapping[str, Track]]) -> Iterator[StudyResult]:
    looks, alone = [each["looks"] for each in flights], [each["none"] for each in flights]
    for part, axes in PARTS.items():
        ratio = pooled_ratio(_squares(looks, axes), _squares(alone, axes))
        text = f"{words}: RMS {part}at the end, looks over inertial alone, N = {len(flights)} flights"
        key = f"D.ratio.{name}.{part}".rstrip(". ")
        if unit in JUDGED_UNITS:
            yield StudyResult.at_most(key, text, ratio, MAX_RATIO)
        else:
            yield StudyResult.reported(key, text, ratio)
    yield from _report_exact(name, words, flights)
    at_instants = sigma_ratios(looks)
    yield StudyResult.at_least(
        f"D.sigma.{name}.min", f"{words}: error over sigma, smallest of ten instants", at_instants.min(), MIN_SIGMA
    )
    yield StudyResult.at_most(
        f"D.sigma.{name}.max", f"{words}: error over sigma, largest of ten instants", at_instants.max(), MAX_SIGMA
    )
    for axis, along in enumerate(("along", "across")):
        found, without = (rms(np.array([t.end[axis] for t in tracks])) for tracks in (looks, alone))
        yield StudyResult.reported(f"D.{along}.{name}", f"{words}: RMS at the end {along}, looks [m]", found)
        yield StudyResult.reported(f"D.{along}.{name}.alone", f"{words}: the same, inertial alone [m]", without)
    pairs = sum(track.pairs[str(k)] for track in looks for k in range(4))
    whole = sum(track.pairs["3"] for track in looks)
    yield StudyResult.reported(f"D.pairs.{name}", f"{words}: share of pairs in three directions", whole / pairs)
    sd, heading = (float(np.median([getattr(t, field) for t in looks])) for field in ("pair_sd", "heading_sd"))
    yield StudyResult.reported(f"D.pair_sd.{name}", f"{words}: sigma of a pair, median [m]", sd)
    yield StudyResult.reported(
        f"D.heading.{name}", f"{words}: sigma of the heading at the start of the outage [mrad]", 1e3 * heading
    )
    yield from _report_forms(name, words, flights)


def _report_exact(name: str, words: str, flights: Sequence[Mapping[str, Track]]) -> Iterator[StudyResult]:
    """The same flights with looks that have no error: what any look could reach with the unit."""
    exact, alone = [each["exact"] for each in flights], [each["none"] for each in flights]
    for part, axes in PARTS.items():
        yield StudyResult.reported(
            f"D.exact.{name}.{part}".rstrip(". "),
            f"{words}: RMS {part}at the end, exact looks over inertial alone",
            pooled_ratio(_squares(exact, axes), _squares(alone, axes)),
        )


def _report_forms(name: str, words: str, flights: Sequence[Mapping[str, Track]]) -> Iterator[StudyResult]:
    """The printed forms, on the flights that have them."""
    for form in FORMS:
        both = [each for each in flights if form in each]
        if not both:
            continue
        printed, looks = [each[form] for each in both], [each["looks"] for each in both]
        text = f"{words}: printed {form}, N = {len(both)} flights"
        ratio = pooled_ratio(_squares(printed, [0, 1]), _squares(looks, [0, 1]))
        yield StudyResult.reported(f"D.form.{form}.{name}", f"{text}: RMS at the end over that with looks", ratio)
        yield StudyResult.reported(
            f"D.form.{form}.{name}.sigma",
            f"{text}: error over sigma, largest of ten instants",
            sigma_ratios(printed).max(),
        )


def sigma_ratios(tracks: Sequence[Track]) -> Array:
    """RMS of error over sigma of both axes at each of the ten instants, shape (10,)."""
    values = np.array([track.ratio[np.searchsorted(track.t, INSTANTS_S)] for track in tracks])
    return np.asarray(np.sqrt(np.mean(values**2, axis=(0, 2))))


def _squares(tracks: Sequence[Track], axes: list[int]) -> Array:
    """Square of the error at the end of each flight, along, across or both [m^2]."""
    return np.array([float(np.sum(track.end[axes] ** 2)) for track in tracks])
