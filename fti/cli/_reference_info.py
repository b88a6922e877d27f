"""Text output of ``fti reference info``: the header of a reference, and a character plot."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from fti.hil.approach_reference.analytic_limits import theoretical_limits
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.assumptions import Assumptions
from fti.nav.integrity.ground_track import TrackLeg
from fti.nav.integrity.reference import ApproachReference, Detection, Obstacles, min_level_v

PLOT_ROWS, PLOT_COLUMNS = 16, 96


def summary(reference: ApproachReference) -> list[str]:
    """The header as lines of text."""
    header = reference.header
    airfield, profile, limits = header.airfield, header.profile, header.limits
    templates = "single bins (old format; make the reference again to detect smaller obstacles)"
    if limits.t4_widths_m is not None:
        templates = "templates of " + ", ".join(f"{width:g}" for width in limits.t4_widths_m) + " m"
    return [
        f"airfield     {airfield.name}, surveyed {airfield.survey_date}",
        f"glide path   {airfield.glide_deg} deg, course {airfield.course_deg} deg, TCH {airfield.tch_m} m",
        *_track(airfield.leg or ()),
        f"sensor       {header.sensor.kind}, beam {header.sensor.beam_deg} deg",
        f"profile      {profile.surface} of {profile.date}, s -200 to {profile.s_max_m + 200:.0f} m, step "
        f"{profile.ds_m} m, from {profile.made_from}, {profile.draws} draws, seed {profile.seed}",
        f"window       {profile.window_m} m, correlation length {profile.correlation_m} m",
        f"limits       T1 {limits.t1}  T2 {limits.t2}  T3 {limits.t3}  T4 {limits.t4}  "
        f"(Pfa {limits.pfa}, Pmd {limits.pmd}, {limits.runs} approaches)",
        "analytic     "
        + "  ".join(f"T{k} {limit:.3f}" for k, limit in enumerate(theoretical_limits(reference), 1))
        + "  (independent normal residuals; for a check)",
        *_assumptions(header.assumptions),
        f"verified     an alarm on {limits.verified_alarms} of {limits.verified_runs} other approaches",
        *_lateral_detection(header.detection),
        f"T4 is of     {templates}",
        *_obstacles(header.obstacles),
        f"PL_v         {min_level_v(reference):.1f} m minimum; nav.approach.alert_v_m must not be smaller",
        f"sigma        {reference.s_ref.min():.2f} to {reference.s_ref.max():.2f} m",
        f"hash         {reference.hash}",
    ]


def _track(legs: Sequence[TrackLeg]) -> Iterator[str]:
    """The ground track where it is more than a straight line."""
    begin = 0.0
    for leg in legs:
        section = f"track        {begin:.0f} to {begin + leg.length_m:.0f} m before the intercept point: "
        side = "right" if (leg.radius_m or 0.0) > 0.0 else "left"
        yield section + (f"to the {side}, radius {abs(leg.radius_m):g} m" if leg.radius_m else "straight")
        begin += leg.length_m


def _assumptions(assumed: Assumptions | None) -> Iterator[str]:
    if assumed is None:
        yield "assumes      not stated (old format): nothing is compared in flight"
        return
    yield (
        f"assumes      navigation {assumed.nav_vertical_sd_m:g} m vertically, {assumed.nav_noise_sd_m:g} m of it "
        f"within one window, {assumed.nav_horizontal_sd_m:g} m horizontally"
    )
    yield (
        f"             track {assumed.track_sd_m:g} m, height {assumed.height_sd_m:g} m, elevation "
        f"{assumed.elevation_short_sd_m:g} m over 30 m and {assumed.elevation_long_sd_m:g} m over 300 m"
    )
    yield f"             receiver {assumed.receiver} ({assumed.receivers}), beam {assumed.beam_deg:g} deg"


def _lateral_detection(detection: Detection | None) -> Iterator[str]:
    """Share of windows in ALERT, by cross-track offset and section of the approach."""
    if detection is None:
        return
    yield f"{'offset':>12} " + "".join(f"{s:7.0f}" for s in detection.s_m) + "  m and less before the intercept point"
    for y, row in zip(detection.y_m, detection.pd, strict=True):
        yield f"{y:10.0f} m " + "".join(f"{100 * pd:6.1f}%" for pd in row) + "  of the windows are over a limit"


def _obstacles(obstacles: Obstacles | None) -> Iterator[str]:
    if obstacles is None:
        return
    yield (
        f"{'obstacles':>12} " + "".join(f"{s:7.0f}" for s in obstacles.s_m) + "  m and less before the intercept point"
    )
    yield f"{'aircraft at':>12} " + "".join(f"{h:7.0f}" for h in obstacles.agl_m) + "  m above the ground"
    for width, row in zip(obstacles.width_m, obstacles.height_m, strict=True):
        heights = "".join(f"{height:7.0f}" if math.isfinite(height) else f"{'none':>7}" for height in row)
        yield f"{width:5.0f} m wide {heights}  m high are detected with a Pd of {obstacles.pd:g}"


def plot(reference: ApproachReference) -> list[str]:
    """Glide path (.) over the terrain as the sensor measures it (#), far end on the left."""
    s = np.linspace(reference.s[-1], reference.s[0], PLOT_COLUMNS)
    z = np.interp(s, reference.s, reference.z_ref)
    path = ApproachPath(reference.header.airfield).alt_path(s)
    low, high = float(min(z.min(), path.min())), float(max(z.max(), path.max()))
    levels = np.linspace(high, low, PLOT_ROWS)
    half = (high - low) / (PLOT_ROWS - 1) / 2
    rows = []
    for level in levels:
        marks = np.where(np.abs(path - level) <= half, ".", np.where(z >= level - half, "#", " "))
        rows.append(f"{level:6.0f} m |" + "".join(marks))
    return ["", *rows, f"          {s[0]:.0f} m{'before the intercept point'.center(PLOT_COLUMNS - 14)}{s[-1]:.0f} m"]
