"""Compensation of altimeters over forest and buildings by attitude, range and beam, and where each method helps.

T21 and T2, source 003, sections 3.3 and 7.5.4: laser raw 11.5 m, compensated 3.0 m; radar raw 15.8 m, by attitude
6.6 m, by beam 4.8 m.  Records and elevation are not public.  N = runs countries of the low-level mix (``_low_level``),
200 poses in each; the unit is the country, an ordering must hold on so many that a sign test has p < 0.01 / m, m the
number of these tests.  Errors are against the true height over the surface straight below.

    attitude   range times the cosine of the boresight's tilt: without terrain
    excess     a radar's range times the cosine of the excess of the tilt over half its beam: the live method without
    terrain
    range      with the predicted range of a pencil along the boresight
    beam       with the predicted range of the sensor's own beam

T21 is judged with the exact surface; a position with errors of 10 m / 2 m, and an elevation model with 1.5 m of noise
and an offset of 10 m, are reported too.  For the laser range and beam are equal.  **The attitude makes a radar worse**
in most configurations, since a leading edge is already short: ``bank`` lists, for beams of 10 to 70 deg, the bank from
which its RMS error falls (91: not up to 60 deg), and the error by excess.

``sigma`` is error over predicted sigma, RMS over all poses, where the position is known to 10 m / 2 m: of compensated
heights, and of measured minus predicted ranges, with the sigma of the ground round N and M
(``sampled_height_variance``) and of the planes through them (``height_variance``).  The product uses the first; it is
judged for the laser, for the radar's own beam and for a nearest return, the default of a configuration: at least 60 %
of the errors within one sigma, 93 % within two, and an RMS of 0.5 or more, so that a large sigma does not pass.  The
RMS has no upper limit: one roof in 1600 poses that lies three sigmas from the estimated position makes it 2.5.  The
planes do not model the edges of woods and roofs, and are reported.

T2 is the octocopter's level run (3.8 m raw, 1.7 m compensated) over the countries of study ``ranging``, T1, with an
elevation model of 1.5 m: the same quantity, so reported.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.altimetry.compensation import height_over_ground
from fti.nav.altimetry.range_prediction import Prediction
from fti.nav.altimetry.variance import (
    ErrorModel,
    height_variance,
    pose_cov,
    range_variance,
    sampled_height_variance,
    sampled_range_variance,
)
from fti.parallel_runs import Progress, run_all
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import cosine_antenna
from fti.ranging.sensor import Poses
from fti.study import REPORTED, DrawFigure, StudyResult, _level_run, _low_level
from fti.study._low_level import Knowledge, Mix
from fti.study._statistics import LEVEL, min_positive

Array = NDArray[np.float64]

RUNS = 20
SEED = 21

#: Half the beam of the mix's radar across the aircraft, where its roll turns it [rad].
HALF_BEAM = np.radians(35.0)
SIGMAS = {
    "plane": "of the height, by the planes through N and M",
    "around": "of the height, by the ground around them",
    "range_plane": "of the range, by the plane through M",
    "range_around": "of the range, by the ground around it",
}
#: Judged sigmas; minimum shares within one and two sigmas, and minimum RMS of error over sigma.
JUDGED_SIGMAS = ("around", "range_around")
WITHIN, RMS = (0.60, 0.93), 0.5
#: Full widths of beams and banks [deg] of the table, and poses at each.
WIDTHS_DEG = (10, 20, 30, 45, 60, 70)
BANKS_DEG = tuple(range(0, 61, 10))
BANK_POSES = 40
NEVER_DEG = 91
WAYS = ("raw", "attitude", "excess", "range", "beam")
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


class CompensationRun(NamedTuple):
    """Mean squares [m^2] of a country.

    mix   : by (knowledge, sensor, way)
    sigma : of error over sigma, and shares within one and two sigmas [1], by (sensor, which sigma)
    bank  : (width, bank, way), the ways raw, attitude, excess
    run   : raw and compensated of the level run
    """

    mix: dict[tuple[Knowledge, str, str], float]
    sigma: dict[tuple[str, str], tuple[float, float, float]]
    bank: Array
    run: tuple[float, float]


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` countries."""
    found = run_all(fly, range(seed, seed + runs), progress)
    return [
        *(_judge_ordering(found, *names) for names in ORDERINGS),
        *_mix_results(found),
        *_sigmas(found),
        *_bank_results(found),
        _level(found),
    ]


def fly(seed: int) -> CompensationRun:
    """The country of that seed."""
    mix = _low_level.fly(seed)
    predictions = {known: _low_level.predict(mix, known, seed) for known in Knowledge}
    squares = {
        (known, sensor, way): _mean_square(height - mix.nadir)
        for known in Knowledge
        for (sensor, way), height in compensate(mix, predictions[known]).items()
    }
    return CompensationRun(
        squares, _sigma_statistics(mix, predictions[Knowledge.PLACE_ERROR]), _banks(mix, seed), _run(seed)
    )


def _sigma_statistics(
    mix: Mix, predictions: dict[str, Prediction]
) -> dict[tuple[str, str], tuple[float, float, float]]:
    """Error over sigma by (sensor, which sigma), with a position error, as in ``CompensationRun.sigma``."""
    flat, high = _low_level.HORIZONTAL_SD, _low_level.VERTICAL_SD
    noise = {"laser": _low_level.LASER_NOISE_M, "radar": _low_level.RADAR_NOISE_M}
    found: dict[tuple[str, str], tuple[float, float, float]] = {}
    for sensor, instrument in (("laser", "laser"), ("radar", "radar"), ("radar_nearest", "radar")):
        measured, nearest = mix.measured[instrument], instrument == "radar"
        errors = ErrorModel(pose_cov((flat, flat, high), 0.0), noise[instrument])
        error = height_over_ground(measured, predictions[sensor]) - mix.nadir
        off, surface = measured - predictions[sensor].slant_range, mix.country.surface
        cases = {
            "plane": (error, height_variance(predictions[sensor], errors, nearest=nearest)),
            "around": (error, sampled_height_variance(surface, predictions[sensor], errors, nearest=nearest)),
            "range_plane": (off, range_variance(predictions[sensor], errors, nearest=nearest)),
            "range_around": (off, sampled_range_variance(surface, predictions[sensor], errors, nearest=nearest)),
        }
        found |= {(sensor, which): _consistency(e / np.sqrt(v)) for which, (e, v) in cases.items()}
    return found


def _consistency(z: Array) -> tuple[float, float, float]:
    """Mean square of errors over their sigmas, and shares within one and two."""
    known = np.abs(z[np.isfinite(z)])
    return float(np.mean(known**2)), float(np.mean(known < 1.0)), float(np.mean(known < 2.0))


def compensate(mix: Mix, predictions: dict[str, Prediction]) -> dict[tuple[str, str], Array]:
    """Heights [m] by (sensor, way); NaN where one of the ways has no height, so that all have the same poses."""
    cosine = mix.mats_nb[:, 2, 2]
    heights: dict[tuple[str, str], Array] = {}
    for sensor, measured in mix.measured.items():
        half = HALF_BEAM if sensor == "radar" else 0.0
        ways = (measured, measured * cosine, measured * _excess_cosine(cosine, half))
        grounded = (height_over_ground(measured, predictions[by]) for by in ("laser", sensor))
        every = np.array([*ways, *grounded])
        every[:, ~np.isfinite(every).all(axis=0)] = np.nan
        heights |= {(sensor, way): height for way, height in zip(WAYS, every, strict=True)}
    return heights


def _excess_cosine(cosine: Array, half_beam: float) -> Array:
    return np.asarray(np.cos(np.maximum(np.arccos(cosine) - half_beam, 0.0)))


def _mean_square(error: Array) -> float:
    return float(np.nanmean(error**2))


def _banks(mix: Mix, seed: int) -> Array:
    """Mean squares [m^2] of a radar's raw, attitude and excess heights: (width, bank, way)."""
    rng = np.random.default_rng([seed, 211])
    some = rng.choice(len(mix), BANK_POSES, replace=False)
    headings = rng.uniform(0.0, 2.0 * np.pi, BANK_POSES)
    points, nadir = mix.points_l[some], mix.nadir[some]
    squares = np.empty((len(WIDTHS_DEG), len(BANKS_DEG), 3))
    for i, width in enumerate(np.radians(WIDTHS_DEG)):
        radar = RadarAltimeter(antenna=cosine_antenna(width, width), order=_low_level.TRUTH_ORDER)
        for j, bank in enumerate(np.radians(BANKS_DEG)):
            mats_nb = mat_from_rpy(np.full(BANK_POSES, bank), np.zeros(BANK_POSES), headings)
            measured = radar.measure(mix.country.surface, Poses.stationary(points, MAT_ENU_NED @ mats_nb)).slant_range
            cosine = mats_nb[:, 2, 2]
            heights = (measured, measured * cosine, measured * _excess_cosine(cosine, 0.5 * width))
            squares[i, j] = [_mean_square(height - nadir) for height in heights]
    return squares


def _run(seed: int) -> tuple[float, float]:
    """Mean squares [m^2] of the level run: raw and compensated, against the true height below."""
    world, rng = _level_run.make_site(seed), np.random.default_rng([seed, 212])
    path = _level_run.level(world, rng)
    run = _level_run.fly(world, path, "wide", rng)
    east, north, up = path[1].T
    truth = up - world.truth.up(east, north)
    return _mean_square(run.measured - truth), _mean_square(run.compensated - truth)


def _rms(squares: list[float]) -> float:
    """Of all countries together [m]."""
    return float(np.sqrt(np.mean(squares)))


def _judge_ordering(found: list[CompensationRun], sensor: str, less: str, more: str) -> StudyResult:
    pairs = [(one.mix[Knowledge.ALL, sensor, less], one.mix[Knowledge.ALL, sensor, more]) for one in found]
    count, min_count = sum(a < b for a, b in pairs), min_positive(len(found), LEVEL / len(ORDERINGS))
    below, above = zip(*pairs, strict=True)
    text = f"countries of {len(found)} where {less} < {more}; RMS {_rms(list(below)):.2f} / {_rms(list(above)):.2f} m"
    return StudyResult(f"T21.{sensor}.{less}_{more}", text, count, f">= {min_count}", count >= min_count)


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
            is_judged = which in JUDGED_SIGMAS
            target = f">= {minimum:g}" if is_judged else REPORTED
            results.append(
                StudyResult(f"sigma.{sensor}.{which}{name}", what, value, target, not is_judged or value >= minimum)
            )
    return results


def bank_table(found: list[CompensationRun]) -> Array:
    """RMS error [m] of all countries together: (width, bank, way)."""
    return np.asarray(np.sqrt(np.mean([one.bank for one in found], axis=0)))


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


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Pictures like fig. 7.62 and 7.65, of the mix with this seed; and the table of banks."""
    from fti.study import _compensation_plots as plots  # noqa: PLC0415 - matplotlib is loaded by who draws

    return {
        "laser": lambda: plots.errors(seed, "laser"),
        "radar": lambda: plots.errors(seed, "radar"),
        "bank": lambda: plots.banks(seed),
    }
