"""Errors and sigmas of every way of compensation, over one country."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fti.arrays import Array
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
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import cosine_antenna
from fti.ranging.sensor import Poses
from fti.study.compensation import low_level
from fti.study.compensation.low_level import Knowledge, Mix
from fti.study.ranging import level_run

#: Half the beam of the mix's radar across the aircraft, where its roll turns it [rad].
HALF_BEAM = np.radians(35.0)
#: Full widths of beams and banks [deg] of the table, and poses at each.
WIDTHS_DEG = (10, 20, 30, 45, 60, 70)
BANKS_DEG = tuple(range(0, 61, 10))
BANK_POSES = 40
WAYS = ("raw", "attitude", "excess", "range", "beam")


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


def fly(seed: int) -> CompensationRun:
    """The country of that seed."""
    mix = low_level.fly(seed)
    predictions = {known: low_level.predict(mix, known, seed) for known in Knowledge}
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
    flat, high = low_level.HORIZONTAL_SD, low_level.VERTICAL_SD
    noise = {"laser": low_level.LASER_NOISE_M, "radar": low_level.RADAR_NOISE_M}
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
        radar = RadarAltimeter(antenna=cosine_antenna(width, width), order=low_level.TRUTH_ORDER)
        for j, bank in enumerate(np.radians(BANKS_DEG)):
            mats_nb = mat_from_rpy(np.full(BANK_POSES, bank), np.zeros(BANK_POSES), headings)
            measured = radar.measure(mix.country.surface, Poses.stationary(points, MAT_ENU_NED @ mats_nb)).slant_range
            cosine = mats_nb[:, 2, 2]
            heights = (measured, measured * cosine, measured * _excess_cosine(cosine, 0.5 * width))
            squares[i, j] = [_mean_square(height - nadir) for height in heights]
    return squares


def _run(seed: int) -> tuple[float, float]:
    """Mean squares [m^2] of the level run: raw and compensated, against the true height below."""
    world, rng = level_run.make_site(seed), np.random.default_rng([seed, 212])
    path = level_run.level(world, rng)
    run = level_run.fly(world, path, "wide", rng)
    east, north, up = path[1].T
    truth = up - world.truth.up(east, north)
    return _mean_square(run.measured - truth), _mean_square(run.compensated - truth)


def bank_table(found: list[CompensationRun]) -> Array:
    """RMS error [m] of all countries together: (width, bank, way)."""
    return np.asarray(np.sqrt(np.mean([one.bank for one in found], axis=0)))
