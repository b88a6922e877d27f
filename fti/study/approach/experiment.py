"""The patterns: errors of a radar altimeter, raw and compensated, and of an inertial height."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np

from fti.arrays import Array, Rng
from fti.nav.altimetry.compensation import height_over_ground
from fti.ranging.error_model import RangeError
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import NARROW, WIDE
from fti.study.approach.heights import HeightChannel, channels
from fti.study.approach.pattern import MODEL_ORDER, Pattern, instrument, make_pattern
from fti.study.compensation.low_level import dem_error
from fti.terrain.terrain import Terrain

ANTENNAS = {"wide": WIDE, "narrow": NARROW}


class PatternErrors(NamedTuple):
    """Errors [m] of a pattern against the true height (n,): raw and compensated radar."""

    raw: Array
    compensated: Array

    def mean_squares(self) -> tuple[float, float]:
        """Mean squares of compensated and raw [m^2], over samples that have both."""
        both = np.isfinite(self.raw) & np.isfinite(self.compensated)
        return float(np.mean(self.compensated[both] ** 2)), float(np.mean(self.raw[both] ** 2))


class PatternRun(NamedTuple):
    """Mean squares of a pattern.

    altimeter : of compensated and raw [m^2], by (antenna, kind of compensation)
    inertial  : of the height error [m^2] and of error over sigma, by way of aiding
    """

    altimeter: dict[tuple[str, str], tuple[float, float]]
    inertial: dict[str, tuple[float, float]]


def fly(seed: int) -> PatternRun:
    """The pattern of that seed, by each antenna."""
    pattern = make_pattern(seed)
    elevation = elevation_model(pattern.surface, seed)
    altimeter = {
        (antenna, kind): errors.mean_squares()
        for number, antenna in enumerate(ANTENNAS)
        for kind, errors in pattern_errors(
            pattern, elevation, antenna, np.random.default_rng([seed, 15, number])
        ).items()
    }
    return PatternRun(altimeter, {way: one.mean_squares() for way, one in inertial_heights(pattern, seed).items()})


def inertial_heights(pattern: Pattern, seed: int) -> dict[str, HeightChannel]:
    """The height of an inertial system by way of aiding, with the wide antenna."""
    rng = np.random.default_rng([seed, 15, 0])
    ranges = instrument(ANTENNAS["wide"], rng).measure(pattern.surface, pattern.flight.poses(), rng).slant_range
    return channels(pattern, ranges, seed)


def elevation_model(surface: Terrain, seed: int) -> Terrain:
    """The surface as an elevation model with errors and a horizontal offset."""
    rng = np.random.default_rng([seed, 14])
    return dem_error(rng).apply(surface, rng)


def pattern_errors(pattern: Pattern, elevation: Terrain, antenna: str, rng: Rng) -> dict[str, PatternErrors]:
    """Errors of a pattern by kind of compensation."""
    radar = instrument(ANTENNAS[antenna], rng)
    stepped = dataclasses.replace(radar, quantised=True)
    model = RadarAltimeter(antenna=ANTENNAS[antenna], order=MODEL_ORDER)
    ranges, quantised_ranges = (
        r.measure(pattern.surface, pattern.flight.poses(), rng).slant_range for r in (radar, stepped)
    )
    cases = {
        "independent": (ranges, pattern.surface, model),
        "same": (ranges, pattern.surface, dataclasses.replace(radar, error=RangeError())),
        "dem": (quantised_ranges, elevation, model),
    }
    return {
        kind: PatternErrors(
            measured - pattern.nadir, height_over_ground(measured, pattern.predict(ground, by)) - pattern.nadir
        )
        for kind, (measured, ground, by) in cases.items()
    }  # fmt: skip
