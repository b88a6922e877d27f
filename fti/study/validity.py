"""Validity: residual errors of a laser and a radar altimeter after exclusion of invalid samples.

Source 003, section 7.5.3, tables 7.16 to 7.23: of three recorded flights the laser's error falls from 11.5 to 3.7 m
(35 % excluded), the radar's from 15.8 to 8.6 m (20 %).  Flights and elevation are not public: the mix of
``fti.study._low_level`` is drawn instead, and only ratios are judged (T20).

Raw is the measured range used as a height, against the true height straight below.  The rules of the product
(``fti.nav.altimetry.validity``) exclude samples, with the limits of the source's tables (``pencil_limits``,
``wide_beam_limits``; the defaults of a configuration are wider: 30 deg, and no gate on the navigated height), without
widening by known errors; the residual is compared with raw, with summed mean squares of the countries.  N = runs:
countries, 200 poses over each; the unit is the country, and the upper end of the 95 % interval (bootstrap over
countries) is judged, with the position and the elevation known, and again with 10 m of error in each horizontal axis
and 2 m in height.

``*_default`` is a configuration that sets only kind, range and beam width: default limits, a radar's nearest return as
the model, and the terrain-compensated height below the aircraft in place of the range.  It is judged by the same
limits where position and elevation are known, and reported otherwise: at the edge of a wood a position error of 10 m
causes a large height error, which its sigma covers (``fti study compensation``).

Also reported: elevation with 1.5 m of noise and an offset of 10 m; a laser with more cloud returns than ground
returns and without a flag for them (table 7.19); the radar with a gate of 10 m everywhere, not narrowed over uneven
ground; and the radar by table 7.20 as printed, compared with the simulation alone: that keeps the whole error, since
simulation and sensor have the same error (docs/errata.md).
"""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.config import Altimeter
from fti.messages.reasons import Reason
from fti.nav.altimetry.compensation import height_over_ground
from fti.nav.altimetry.nadir_height import ground_sd
from fti.nav.altimetry.range_prediction import Prediction
from fti.nav.altimetry.validity import Sample, pencil_limits, reasons_against, wide_beam_limits
from fti.parallel_runs import Progress, run_all
from fti.study import REPORTED, DrawFigure, StudyResult
from fti.study._low_level import FARTHEST_M, PLACE_SD, Knowledge, Mix, add_cloud, fly, known_scene, predict
from fti.study._statistics import mean_interval, pooled_ratio, ratio_interval

Array = NDArray[np.float64]

RUNS = 20
SEED = 20

#: Half power of the radar's antenna off its boresight, across and along [deg]; maximum range of such altimeters [m].
HALF_POWER_DEG, RADAR_M = (35.0, 26.0), 762.0
LASER, RADAR = pencil_limits((0.0, FARTHEST_M)), wide_beam_limits((0.0, RADAR_M), *HALF_POWER_DEG)
#: T20: maximum residual over raw, and maximum excluded share.
RESIDUAL = {"laser": 0.35, "radar": 0.55, "laser_default": 0.35, "radar_default": 0.55}
MAX_EXCLUDED = 0.40
JUDGED_SUFFIXES = {Knowledge.ALL: "", Knowledge.PLACE_ERROR: ".place_error"}
#: Variants that are not judged with position errors.
EXACT_ONLY = frozenset({"laser_default", "radar_default"})


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


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """``runs`` countries."""
    found = run_all(run, range(seed, seed + runs), progress)
    return [result for key in found[0] for result in judge([one[key] for one in found], *key, seed)]


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


def judge(found: list[ValidityScore], known: Knowledge, name: str, seed: int) -> list[StudyResult]:
    """Residual over raw and the share excluded of all countries."""
    raw, residual, excluded = (np.array([getattr(one, field) for one in found]) for field in ValidityScore._fields[:3])
    rng = np.random.default_rng(seed)
    ratio, (low, high) = pooled_ratio(residual, raw), ratio_interval(residual, raw, rng)
    share, (excluded_low, excluded_high) = float(np.mean(excluded)), mean_interval(excluded, rng)
    case = f"{name.replace('_', ' ')}, {known}, {len(found)} countries"
    rms = f"{np.sqrt(np.mean(residual)):.2f} / {np.sqrt(np.mean(raw)):.2f} m"
    left = f"{case}: RMS of valid / all, {rms}, 95 % interval {low:.3f} to {high:.3f}"
    out = f"{case}: excluded, 95 % interval {excluded_low:.3f} to {excluded_high:.3f}"
    if name not in RESIDUAL or known not in JUDGED_SUFFIXES or (name in EXACT_ONLY and known is not Knowledge.ALL):
        base = f"{name}.{known.name.lower()}"
        return [
            StudyResult(base, left, ratio, REPORTED, True),
            StudyResult(f"{base}.excluded", out, share, REPORTED, True),
        ]
    limit, base = RESIDUAL[name], f"T20.{name}{JUDGED_SUFFIXES[known]}"
    return [
        StudyResult(base, left, ratio, f"<= {limit:g}, bound", high <= limit),
        StudyResult(f"{base}.excluded", out, share, f"<= {MAX_EXCLUDED:g}, bound", excluded_high <= MAX_EXCLUDED),
    ]


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Pictures like fig. 7.56 and 7.59, and the shares of the reasons."""
    from fti.study import _validity_plots as plots  # noqa: PLC0415 - matplotlib is loaded by who draws

    return {
        "laser": lambda: plots.flight(seed, "laser"),
        "radar": lambda: plots.flight(seed, "radar"),
        "reasons": lambda: plots.reasons(seed),
    }
