"""Targets of the study ``scan_registration``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from fti.arrays import Array
from fti.ranging.imager import RangeImager
from fti.study import StudyResult
from fti.study.scan_registration.experiment import PairResult
from fti.study.scan_registration.hostile import HOSTILE, SWELL, HostileResult
from fti.study.scan_registration.looks import GROUNDS, HEIGHT_AGL_M, JUDGED, SPEED_MPS
from fti.study.scan_registration.strip import StripResult
from fti.study.statistics import LEVEL, pooled_ratio, ratio_interval, rms, sign_test

AXES = ("along", "across", "up")
#: RMS of the error over its sigma.
BAND = (0.85, 1.15)
#: T18: interval of eq. 7.6 [s] as printed, the pair of fig. 7.37 [s], and the largest distance of its peak from L / 2v.
PRINTED_S, PAIR_S, PEAK_TOLERANCE_S = 1.02, 1.0, 0.001
#: A confident wrong direction: its error over its sigma, and in metres.
WRONG_SIGMAS, WRONG_M, MAX_WRONG = 5.0, 0.3, 3
#: Directions of pairs without all of them, below which their RMS is reported only; pairs for a correlation.
MIN_PARTIAL = 100


def judge_design() -> list[StudyResult]:
    """T18."""
    imager, fine = RangeImager(), RangeImager(frame_rate=1.0 / PEAK_TOLERANCE_S)
    longest = float(imager.overlap_interval(HEIGHT_AGL_M, SPEED_MPS))
    pair, peak = (each.best_interval(HEIGHT_AGL_M, SPEED_MPS) for each in (imager, fine))
    off = abs(peak - float(imager.footprint(HEIGHT_AGL_M)[0]) / (2.0 * SPEED_MPS))
    return [
        StudyResult(
            "T18.interval", "longest time between images that overlap by half [s] (eq. 7.6)", longest,
            f"{PRINTED_S} s", round(longest, 2) == PRINTED_S,
        ),
        StudyResult(
            "T18.pair", "pair with the largest overlap times interval at 2 Hz [s] (fig. 7.37)", pair,
            f"{PAIR_S:g} s", pair == PAIR_S,
        ),
        StudyResult.at_most("T18.peak", "distance of this maximum from L / 2v [s]", off, PEAK_TOLERANCE_S),
    ]  # fmt: skip


def judge_pairs(grounds: Sequence[dict[str, list[PairResult]]]) -> list[StudyResult]:
    """S (sigma), B (bias), C (correlation), D (directions), O (time to overlap), P (printed form) by ground."""
    return [result for name in GROUNDS for result in _judge_kind(name, [found[name] for found in grounds])]


def _judge_kind(name: str, grounds: Sequence[Sequence[PairResult]]) -> list[StudyResult]:
    pairs = [pair for ground in grounds for pair in ground]
    full = [pair.in_track_axes()[0] for pair in pairs if pair.is_full]
    if not full:
        return [StudyResult(f"S.{name}", f"no pair over {name} ground has three directions", 0, ">= 1", holds=False)]
    bias = np.mean(full, axis=0)
    return [
        *(
            StudyResult.reported(f"B.{name}.{axis}", f"{name} ground: mean error {axis} [m]", float(bias[k]))
            for k, axis in enumerate(AXES)
        ),
        *_sigmas(name, grounds, bias),
        *_correlations(name, pairs),
        *_directions(name, pairs, bias),
        StudyResult.at_most(
            f"O.{name}",
            f"{name} ground: largest error of the time to overlap [s]",
            float(np.nanmax(np.abs([[p.interval_error, p.printed_interval_error] for p in pairs]))),
            1e-9,
        ),
        *_printed(name, grounds),
    ]


def _sigmas(name: str, grounds: Sequence[Sequence[PairResult]], bias: Array) -> list[StudyResult]:
    """Of pairs with three directions: RMS over sigma, with the interval by resampling of grounds; RMS of the error."""
    squares, counts, errors = [], [], []
    for ground in grounds:
        found = [pair.in_track_axes() for pair in ground if pair.is_full]
        squares.append(sum(((error - bias) ** 2 / np.diag(cov) for error, cov in found), np.zeros(3)))
        counts.append(len(found))
        errors += [error for error, _ in found]
    results = []
    for k, axis in enumerate(AXES):
        of_axis = [each[k] for each in squares]
        low, high = ratio_interval(of_axis, counts, np.random.default_rng(k))
        words = f"{name} ground: (error - mean) over sigma {axis}, {sum(counts)} pairs, 95 %: {low:.2f} to {high:.2f}"
        results += [
            StudyResult.reported(
                f"E.{name}.{axis}", f"{name} ground: RMS error {axis} [m]", rms([e[k] for e in errors])
            ),
            _in_band(f"S.{name}.{axis}", words, pooled_ratio(of_axis, counts), is_judged=name in JUDGED),
        ]
    return results


def _correlations(name: str, pairs: Sequence[PairResult]) -> Iterator[StudyResult]:
    """Of the errors of successive pairs, which share a look: -0.5 would be drifts whose errors telescope."""
    both = [(p.in_track_axes()[0], p.next_errors) for p in pairs if p.is_full and np.isfinite(p.next_errors).all()]
    words = f"{name} ground: correlation of the errors of {len(both)} pairs and of the next ones"
    for k, axis in enumerate(AXES if len(both) > MIN_PARTIAL else ()):
        here, following = np.array(both)[:, :, k].T
        yield StudyResult.reported(f"C.{name}.{axis}", f"{words} {axis}", float(np.corrcoef(here, following)[0, 1]))


def _in_band(name: str, words: str, value: float, *, is_judged: bool) -> StudyResult:
    if not is_judged:
        return StudyResult.reported(name, words, value)
    return StudyResult(name, words, value, f"{BAND[0]} to {BAND[1]}", BAND[0] <= value <= BAND[1])


def _directions(name: str, pairs: Sequence[PairResult], bias: Array) -> list[StudyResult]:
    """Share of pairs with all and with some directions; errors over sigma of the latter, horizontal and vertical."""
    some = [pair for pair in pairs if 0 < len(pair.errors) < len(bias)]
    share = sum(pair.is_full for pair in pairs) / len(pairs)
    results = [
        StudyResult.reported(f"D.{name}.all", f"{name} ground: share of pairs with three directions", share),
        StudyResult.reported(f"D.{name}.some", f"{name} ground: share with one or two", len(some) / len(pairs)),
    ]
    for axis, is_up in (("horizontal", False), ("up", True)):
        ratios = [ratio for pair in some for ratio in _ratios(pair, bias, is_up=is_up)]
        if ratios:
            words = f"{name} ground: (error - mean) over sigma of the {axis} direction of these, {len(ratios)} pairs"
            is_judged = name in JUDGED and len(ratios) >= MIN_PARTIAL and not is_up
            results.append(_in_band(f"D.{name}.{axis}", words, rms(ratios), is_judged=is_judged))
    return results


def _ratios(pair: PairResult, bias: Array, *, is_up: bool) -> list[float]:
    ratios = (pair.errors - pair.axes @ bias) / np.sqrt(np.diag(pair.cov))
    return ratios[(np.abs(pair.axes[:, 2]) > 0.5) == is_up].tolist()  # type: ignore[no-any-return]


def _printed(name: str, grounds: Sequence[Sequence[PairResult]]) -> list[StudyResult]:
    """Horizontal errors of the printed form on the pairs with three directions, and of the registration."""
    better, errors = [], []
    for ground in grounds:
        found = [(pair.in_track_axes()[0][:2], pair.printed[:2]) for pair in ground if pair.is_full]
        if found:
            ours, printed = (rms(each) for each in zip(*found, strict=True))
            better.append(ours < printed)
            errors += [pair for _, pair in found]
    p = sign_test(sum(better), len(better))
    shifts = np.mean([pair.printed_shifts for ground in grounds for pair in ground])
    words = f"{name} ground: RMS error of the printed form, {shifts:.0f} shifts a pair,"
    return [
        *(
            StudyResult.reported(f"P.{name}.{axis}", f"{words} {axis} [m]", rms([e[k] for e in errors]))
            for k, axis in enumerate(AXES[:2])
        ),
        StudyResult(f"P.{name}.order", "p that the printed form is not worse", p, f"< {LEVEL:g}", p < LEVEL),
    ]


def judge_hostile(tries: Sequence[dict[str, HostileResult]]) -> list[StudyResult]:
    """H: confident wrong directions."""
    results = []
    for name in HOSTILE:
        found = [each[name] for each in tries]
        wrong = sum(map(is_wrong, found))
        refused = sum(not result.errors for result in found) / len(found)
        words = f"{name}: confident wrong, of {len(found)}"
        key = f"H.{name.replace(' ', '_')}"
        results += [
            StudyResult.reported(key, words, wrong)
            if name == SWELL
            else StudyResult.at_most(key, words, wrong, MAX_WRONG),
            StudyResult.reported(f"{key}.refused", f"{name}: share without a horizontal direction", refused),
        ]
    return results


def is_wrong(result: HostileResult) -> bool:
    """A reported horizontal direction is off by more than its sigma explains."""
    return any(
        abs(error) > max(WRONG_SIGMAS * sigma, WRONG_M)
        for error, sigma in zip(result.errors, result.sigmas, strict=True)
    )


def judge_strip(results: Sequence[StripResult | None]) -> list[StudyResult]:
    """R: real points, repeatability of sampling."""
    found = [result for result in results if result is not None]
    words = "one strip in halves (sampling repeatability: one strip is one pass)"
    share = len(found) / len(results)
    measured = [StudyResult.at_least("R.measured", f"{words}: share of {len(results)} with all directions", share, 0.9)]
    for k, axis in enumerate(("east", "north", "up")):
        ratio = rms([result.errors[k] / result.sigmas[k] for result in found]) if found else math.inf
        error = rms([result.errors[k] for result in found]) if found else math.inf
        measured += [
            StudyResult.reported(f"R.{axis}.rms", f"{words}: RMS error {axis} of a shift of 0.5 m [m]", error),
            StudyResult.at_most(f"R.{axis}", f"{words}: error over sigma {axis}", ratio, BAND[1]),
        ]
    return measured
