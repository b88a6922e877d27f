"""Targets of the study ``ranging``."""

from __future__ import annotations

import numpy as np

from fti.constants import SPEED_OF_LIGHT
from fti.ranging.radar.dome import half_dome, sphere
from fti.ranging.radar.waveform import range_of_delay
from fti.study import StudyResult
from fti.study.ranging.experiment import LEVEL_HEIGHT_M, ORDER, level_ranges
from fti.study.ranging.level_run import LevelRun
from fti.study.ranging.signals import EXAMPLES, LOAT, SSB, Example, Rays, chain, edge_distance
from fti.study.ranging.sweep import HEIGHTS_M, ROLLS_DEG, sweep
from fti.study.statistics import pooled_ratio, ratio_interval

#: Pulses of a radar and of a laser altimeter (2.1.1.3, 2.1.2) [s], and the range of eq. 2.36 [m].
PULSES_S = (100e-9, 10e-9)
FARTHEST_M = 1000.0
#: The source truncates 866.7 ns to 866 ns.
PRINTED_DELAY = 866e-9
#: Roll up to which the wide antenna keeps the nadir, and its relative error there.
HELD_DEG, HELD_ERROR = 35.0, 0.005
#: Roll at which the narrow antenna loses the nadir.
LOST_DEG = 30.0
#: Model over nadir, with its upper bound.
LIMIT = 0.5


def judge_exact(seed: int) -> list[StudyResult]:
    """T3 to T6, and fig. 2.50."""
    return [*pulses(), *receivers(seed), *beam(), *attitude()]


def pulses() -> list[StudyResult]:
    """T3."""
    radar, laser = (0.5 * SPEED_OF_LIGHT * pulse for pulse in PULSES_S)
    rate = 1e-3 * SPEED_OF_LIGHT / (2.0 * FARTHEST_M)
    near = "nearest range of a pulse of"
    return [
        StudyResult("T3.radar", f"{near} 100 ns [m] (eq. 2.5)", radar, "14.990", f"{radar:.3f}" == "14.990"),
        StudyResult("T3.laser", f"{near} 10 ns [m] (eq. 2.5)", laser, "1.499", f"{laser:.3f}" == "1.499"),
        StudyResult("T3.rate", "pulses to 1000 m and back [kHz] (eq. 2.36)", rate, "150", round(rate) == 150),
    ]


def beam() -> list[StudyResult]:
    """T5 and T6."""
    angle, found = level_ranges()
    error = float(np.max(np.abs(found * np.cos(angle) / LEVEL_HEIGHT_M - 1.0)))
    whole, half = sphere(ORDER), half_dome(ORDER)
    triangles, corners, rays = len(whole.triangles), len(whole.rays), len(half)
    return [
        StudyResult("T5", f"worst of {len(found)} ranges to a level surface, relative", error, "< 1e-9", error < 1e-9),
        StudyResult(
            "T6.triangles", "triangles of the dome of order 12 (eq. 2.65)", triangles, "2880", triangles == 2880
        ),
        StudyResult("T6.corners", "its corners (eq. 2.66)", corners, "1442", corners == 1442),
        StudyResult("T6.rays", "rays of its half with the equator", rays, "751", rays == 751),
    ]


def receivers(seed: int) -> list[StudyResult]:
    """T4."""
    return [
        *beats(),
        *(_chain_result(example) for example in EXAMPLES),
        *(_edge_distance_result(example, seed) for example in EXAMPLES),
    ]


def beats() -> list[StudyResult]:
    """Results that follow from the frequencies."""
    wave = LOAT.receiver.base.waveform
    near, far = 1e9 * float(wave.delay_of_beat(LOAT.beat)), 1e6 * float(wave.delay_of_beat(SSB.beat))
    cut, metres = float(range_of_delay(PRINTED_DELAY)), float(wave.range_of_beat(SSB.beat))
    return [
        StudyResult("T4.delay", "2.6 MHz: time there and back [ns] (eq. 2.73)", near, "866", int(near) == 866),
        StudyResult("T4.range", "range of 866 ns [m] (eq. 2.74)", cut, "129.8", round(cut, 1) == 129.8),
        StudyResult("T4.delay_ssb", "4 MHz: time there and back [us] (eq. 2.78)", far, "1.33", round(far, 2) == 1.33),
        StudyResult("T4.range_ssb", "and its range [m] (eq. 2.79)", metres, "199.9", round(metres, 1) == 199.9),
    ]


def _chain_result(example: Example) -> StudyResult:
    wave, expected, found = example.receiver.base.waveform, example.height, chain(example)
    text = f"lone scatterer through the whole {example.name} chain, +- half a bin [m]"
    holds = abs(found - expected) <= 0.5 * wave.range_bin
    return StudyResult(f"T4.chain_{example.name}", text, found, f"{expected:.2f}", holds)


def _edge_distance_result(example: Example, seed: int) -> StudyResult:
    bins = edge_distance(example.receiver, Rays.over_level_ground(example.height, seed))
    text = f"leading edge of one beam, {example.name} against baseband [bins]"
    return StudyResult.at_most(f"T4.base_{example.name}", text, bins, 0.1)


def attitude() -> list[StudyResult]:
    """Results of fig. 2.50 over all its heights."""
    narrow, wide = ([sweep(name, height) for height in HEIGHTS_M] for name in ("narrow", "wide"))
    held = max(float(np.max(np.abs(s.error[ROLLS_DEG <= HELD_DEG]))) for s in wide)
    worse = min(
        float(np.min((n.error - w.error)[ROLLS_DEG >= LOST_DEG])) for n, w in zip(narrow, wide, strict=True)
    )  # fmt: skip
    spread = min(float(w.dispersion[0] / n.dispersion[0]) for n, w in zip(narrow, wide, strict=True))
    return [
        StudyResult.at_most("F2.50.wide", "wide beam, error up to 35 deg roll, of the height", held, HELD_ERROR),
        StudyResult(
            "F2.50.narrow", "narrow minus wide, least error from 30 deg on, of the height", worse, "> 0", worse > 0
        ),
        StudyResult("F2.50.spread", "spread of the echo wings level, wide over narrow", spread, "> 1", spread > 1.0),
    ]


def judge_level_runs(runs: list[dict[tuple[str, str], LevelRun]], seed: int) -> list[StudyResult]:
    """T1.  The unit is the terrain: mean squares are summed over terrains, and terrains are drawn again."""
    return [_ratio([run[key] for run in runs], *key, seed) for key in runs[0]]


def _ratio(runs: list[LevelRun], path: str, antenna: str, seed: int) -> StudyResult:
    model, nadir = np.array([run.mean_squares() for run in runs]).T
    ratio, (low, high) = pooled_ratio(model, nadir), ratio_interval(model, nadir, np.random.default_rng(seed))
    rms, plain = np.sqrt(np.mean(model)), np.sqrt(np.mean(nadir))
    text = (
        f"{path}, {antenna} beam, {len(runs)} terrains: RMS of model / nadir against measured,"
        f" {rms:.2f} / {plain:.2f} m, 95 % interval {low:.2f} to {high:.2f}"
    )
    name = f"T1.{path}" if antenna == "wide" else f"T1.{path}_{antenna}"
    if (path, antenna) != ("level", "wide"):
        return StudyResult.reported(name, text, ratio)
    return StudyResult(name, text, ratio, f"<= {LIMIT:g}, bound", high <= LIMIT)
