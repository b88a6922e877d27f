"""Targets of the study ``compensation``."""

from __future__ import annotations

import numpy as np

from fti.arrays import Array
from fti.study import REPORTED, StudyResult
from fti.study.compensation.experiment import BANKS_DEG, WAYS, WIDTHS_DEG, CompensationRun, bank_table
from fti.study.compensation.low_level import Knowledge
from fti.study.statistics import LEVEL, min_positive

SIGMAS = {
    "plane": "of the height, by the planes through N and M",
    "around": "of the height, by the ground around them",
    "range_plane": "of the range, by the plane through M",
    "range_around": "of the range, by the ground around it",
}
#: Judged sigmas; minimum shares within one and two sigmas, and minimum RMS of error over sigma.
JUDGED_SIGMAS = ("around", "range_around")
WITHIN, RMS = (0.60, 0.93), 0.5
NEVER_DEG = 91
#: Reported ways of each sensor, and ways without terrain.
REPORTED_WAYS = {"laser": ("raw", "attitude", "range"), "radar": WAYS}
TERRAIN_FREE_WAYS = ("raw", "attitude", "excess")
#: By sensor: the first way must have smaller errors than the second.
ORDERINGS = (
    ("laser", "beam", "attitude"),
    ("laser", "attitude", "raw"),
    ("radar", "beam", "raw"),
    ("radar", "beam", "attitude"),
)


def judge_all(found: list[CompensationRun]) -> list[StudyResult]:
    """T21, the sigmas, and T2."""
    return [
        *(_judge_ordering(found, *names) for names in ORDERINGS),
        *_mix_results(found),
        *_sigmas(found),
        *_bank_results(found),
        _level(found),
    ]


def _judge_ordering(found: list[CompensationRun], sensor: str, less: str, more: str) -> StudyResult:
    pairs = [(one.mix[Knowledge.ALL, sensor, less], one.mix[Knowledge.ALL, sensor, more]) for one in found]
    count, min_count = sum(a < b for a, b in pairs), min_positive(len(found), LEVEL / len(ORDERINGS))
    below, above = zip(*pairs, strict=True)
    text = f"countries of {len(found)} where {less} < {more}; RMS {_rms(list(below)):.2f} / {_rms(list(above)):.2f} m"
    return StudyResult.at_least(f"T21.{sensor}.{less}_{more}", text, count, min_count)


def _mix_results(found: list[CompensationRun]) -> list[StudyResult]:
    """Every way with every knowledge; ways without terrain once."""
    results = []
    for known, sensor, way in found[0].mix:
        if way not in REPORTED_WAYS[sensor] or (known is not Knowledge.ALL and way in TERRAIN_FREE_WAYS):
            continue
        rms = _rms([one.mix[known, sensor, way] for one in found])
        name = f"{sensor}.{known.name.lower()}.{way}"
        results.append(StudyResult(name, f"{sensor}, {known.value}: RMS error by {way} [m]", rms, REPORTED, holds=True))
    return results


def _sigmas(found: list[CompensationRun]) -> list[StudyResult]:
    results = []
    for sensor, which in found[0].sigma:
        square, one, two = np.mean([country.sigma[sensor, which] for country in found], axis=0).tolist()
        text = f"{sensor}, {Knowledge.PLACE_ERROR.value}, sigma {SIGMAS[which]}"
        rows = (
            ("", f"{text}: RMS of error / sigma", square**0.5, RMS),
            (".within_1", f"{text}: share of errors within one sigma", one, WITHIN[0]),
            (".within_2", f"{text}: share of errors within two", two, WITHIN[1]),
        )
        for name, what, value, minimum in rows:
            result = f"sigma.{sensor}.{which}{name}", what, value
            is_judged = which in JUDGED_SIGMAS
            results.append(StudyResult.at_least(*result, minimum) if is_judged else StudyResult.reported(*result))
    return results


def min_helpful_bank(table: Array, way: int) -> list[int]:
    """By width, the bank [deg] from which on a way has smaller errors than raw; 91: none."""
    helps = table[:, :, way] < table[:, :, 0]
    onwards = np.logical_and.accumulate(helps[:, ::-1], axis=1)[:, ::-1]
    return [BANKS_DEG[int(np.argmax(row))] if row.any() else NEVER_DEG for row in onwards]


def _bank_results(found: list[CompensationRun]) -> list[StudyResult]:
    table, results = bank_table(found), []
    for i, (width, attitude) in enumerate(zip(WIDTHS_DEG, min_helpful_bank(table, 1), strict=True)):
        bank_text = "; ".join(
            f"{bank}: {raw:.0f}/{by:.0f}/{excess:.0f}"
            for bank, (raw, by, excess) in zip(BANKS_DEG, table[i], strict=True)
        )
        text = (
            f"beam {width} deg: attitude helps from this bank on [deg]; RMS raw/attitude/excess by bank: {bank_text} m"
        )
        results.append(StudyResult(f"bank.{width}", text, attitude, REPORTED, holds=True))
    return results


def _level(found: list[CompensationRun]) -> StudyResult:
    raw, left = (_rms([one.run[k] for one in found]) for k in (0, 1))
    text = f"level run over {len(found)} countries, elevation 1.5 m: RMS compensated / raw, {left:.2f} / {raw:.2f} m"
    return StudyResult("T2", text, left / raw, REPORTED, holds=True)


def _rms(squares: list[float]) -> float:
    """Of all countries together [m]."""
    return float(np.sqrt(np.mean(squares)))
