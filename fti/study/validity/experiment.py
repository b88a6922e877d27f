"""The validity rules of the product on the low-level mix."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.config import Altimeter
from fti.messages.reasons import Reason
from fti.nav.altimetry.compensation import height_over_ground
from fti.nav.altimetry.nadir_height import ground_sd
from fti.nav.altimetry.range_prediction import Prediction
from fti.nav.altimetry.validity import Sample, pencil_limits, reasons_against, wide_beam_limits
from fti.study.compensation.low_level import FARTHEST_M, PLACE_SD, Knowledge, Mix, add_cloud, fly, known_scene, predict

#: Half power of the radar's antenna off its boresight, across and along [deg]; maximum range of such altimeters [m].
HALF_POWER_DEG, RADAR_M = (35.0, 26.0), 762.0
LASER, RADAR = pencil_limits((0.0, FARTHEST_M)), wide_beam_limits((0.0, RADAR_M), *HALF_POWER_DEG)


class ValidityVariant(NamedTuple):
    """Measurement, model of its prediction, and kind of error.

    narrowed : the gate on the navigated height, where the ground is uneven
    below    : the error is that of the compensated height, not of the range taken as a height
    """

    measurement: str
    sensor: str
    limits: Altimeter
    has_narrow_gate: bool = True
    is_compensated: bool = False


VARIANTS = {
    "laser": ValidityVariant("laser", "laser", LASER),
    "laser_in_cloud": ValidityVariant("laser_in_cloud", "laser", LASER),
    "radar": ValidityVariant("radar", "radar", RADAR),
    "radar_plain_gate": ValidityVariant("radar", "radar", RADAR, has_narrow_gate=False),
    "laser_default": ValidityVariant(
        "laser", "laser", Altimeter(kind="laser", range_m=(0.0, FARTHEST_M)), is_compensated=True
    ),
    "radar_default": ValidityVariant(
        "radar", "radar_nearest", Altimeter(kind="radar", range_m=(0.0, RADAR_M)), is_compensated=True
    ),
    "radar_as_printed": ValidityVariant("radar", "radar", RADAR.model_copy(update={"max_nadir_deviation_m": None})),
}


class ValidityScore(NamedTuple):
    """One sensor over one country: mean squares of the error of all samples and of the valid ones [m^2], the share
    excluded, and how many by which reason, of how many samples.
    """

    raw: float
    residual: float
    excluded: float
    reasons: Counter[Reason]
    samples: int

    def share(self, reason: Reason) -> float:
        """Of the samples, refused by that reason, whatever else refuses them."""
        return self.reasons[reason] / self.samples


#: By (knowledge, variant), over one country.
Run = dict[tuple[Knowledge, str], ValidityScore]


def run(seed: int) -> Run:
    """All variants over one country."""
    mix, found = add_cloud(fly(seed), seed), {}
    for known in Knowledge:
        predictions = predict(mix, known, seed)
        for name, reasons in reasons_by_variant(mix, known, seed).items():
            variant = VARIANTS[name]
            measurement = mix.measured[variant.measurement]
            used = (
                height_over_ground(measurement, predictions[variant.sensor]) if variant.is_compensated else measurement
            )
            found[known, name] = score_variant(measurement - mix.nadir, used - mix.nadir, reasons)
    return found


def reasons_by_variant(mix: Mix, known: Knowledge, seed: int) -> dict[str, list[tuple[Reason, ...]]]:
    """Reasons against each sample, by variant."""
    scene = known_scene(mix, known, seed)
    uneven = ground_sd(scene.surface, scene.points_l, PLACE_SD[known])
    predictions = scene.predict(mix.mats_nb)
    return {
        name: refusals(mix, variant, predictions[variant.sensor], uneven if variant.has_narrow_gate else 0.0 * uneven)
        for name, variant in VARIANTS.items()
        if variant.measurement in mix.measured
    }


def refusals(mix: Mix, variant: ValidityVariant, prediction: Prediction, uneven: Array) -> list[tuple[Reason, ...]]:
    """Reasons against each sample, by the rules of the product; uneven : one sigma of h(N) [m]."""
    measurement = mix.measured[variant.measurement]
    columns = {
        "value": measurement, "height": measurement, "roll": mix.roll, "pitch": mix.pitch,
        "predicted": prediction.slant_range, "dispersion": prediction.dispersion, "incidence": prediction.incidence,
        "navigated": prediction.height_p, "ground_sd": uneven,
    }  # fmt: skip
    rows = np.stack(list(columns.values()), axis=-1).tolist()
    return [reasons_against(Sample(**dict(zip(columns, row, strict=True))), variant.limits) for row in rows]


def score_variant(raw: Array, error: Array, reasons: list[tuple[Reason, ...]]) -> ValidityScore:
    """Score a variant.  raw : range minus true height (n,) [m], NaN: no return; error : of the used value (n,) [m]."""
    valid = np.array([not refused for refused in reasons])
    counted = Counter(reason for refused in reasons for reason in refused)
    residual = float(np.mean(error[valid] ** 2)) if valid.any() else float("nan")
    return ValidityScore(float(np.nanmean(raw**2)), residual, float(np.mean(~valid)), counted, len(reasons))
