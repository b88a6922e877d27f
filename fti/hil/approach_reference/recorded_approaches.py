"""A reference from at least five recorded approaches.

Source: the derived outputs of navigation (``fti reprocess`` recomputes them): heights above ground of one altimeter,
moved to P and not compensated for terrain, and the navigated position at their times.  An approach is a descent along
the track from the far end of the profile; an aborted one counts up to its end.  Samples are those of the monitor,
without values that are stuck or that another altimeter contradicts.  Mean and sigma at a place are over the approaches
with a height there (``profile.surface_of``).  Limits come from approaches drawn with this mean and sigma, and with the
correlation length of the recorded residuals.  The detection of an offset track is unknown, because none was recorded.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.config import Approach
from fti.errors import ConfigError, MissingError
from fti.hil.approach_reference import profile
from fti.hil.approach_reference.approaches import AltimeterModel
from fti.hil.approach_reference.calibration import calibrate
from fti.hil.approach_reference.options import WINDOW_M, Progress, ReferenceOptions, TaskRunner, run_serially
from fti.hil.sensors.errors import gauss_markov_noise
from fti.hil.session_config import recorded_config
from fti.logger.reading.json_message import parse_table, using_message
from fti.logger.reading.recording import Recording
from fti.nav.altimetry.altimeter_channel import TERRAIN_REASONS
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.reference import MARGIN_M, ApproachReference, fits, grid
from fti.nav.integrity.window import MAX_BACKWARD_M
from fti.nav.navigation import FILTER, RADIO, VERTICAL

#: Minimum number of approaches of a reference, and at each place: with two, sigma would be multiplied by 16.
MIN_APPROACHES, MIN_APPROACHES_AT_POINT = 5, 3
#: Maximum distance between heights of an approach [m]: twice that of a slow altimeter, less than any footprint.
GAP_M = 20.0
#: Iterations of ``_mean_profile``: each divides the remaining error by the ratio of all approaches to aborted ones.
ROUNDS = 50
#: Minimum length of a profile, see ``fti reference make --s-max``.
MIN_PROFILE_M = 1000.0
HEIGHT, SOLUTION = "/nav/height_above_ground/", "/nav/nav_solution"
#: Maximum gap between solutions for interpolation [ns].
MAX_SOLUTION_GAP_NS = 500_000_000
#: Altitude sources that may depend on an altimeter over known terrain.
COMPUTED_ALTITUDES = (FILTER, VERTICAL, RADIO)
#: Time per metre of the track for the processes of ``fti.hil.sensors.errors``, which are drawn at 1 Hz [s].
SECOND_PER_M = 0.1


@dataclass(frozen=True, eq=False)
class Pass:
    """Samples of a recorded flight, shape (n,): time [ns], path length s [m], terrain altitude z = alt - agl [m]."""

    t_ns: NDArray[np.int64]
    s: Array
    z: Array


@dataclass(frozen=True, eq=False)
class RecordedGround:
    """Recorded ground with its scatter, which is correlated over ``correlation`` [m]."""

    path: ApproachPath
    altimeter: AltimeterModel
    surface: profile.Surface
    correlation: float

    def ranges(self, pose: Array, rng: np.random.Generator) -> Array:
        """Heights above it [m] along poses with descending s; the scatter is that of one approach."""
        s, alt = pose[0], pose[2]
        t = (s[0] - s) * SECOND_PER_M
        scatter = gauss_markov_noise(np.maximum.accumulate(t), 1.0, self.correlation * SECOND_PER_M, rng)
        z, sd = (np.interp(s, self.surface.s, column) for column in (self.surface.z_ref, self.surface.s_ref))
        return np.asarray(alt - z - sd * scatter)


def reference_from_recordings(
    path: ApproachPath, altimeter: AltimeterModel, profiles: Array, plan: ReferenceOptions, progress: Progress,
    *, run_all: TaskRunner = run_serially,
) -> ApproachReference:  # fmt: skip
    """The reference of recorded profiles, shape (n, len(grid)), n >= 5, from ``profiles_of``."""
    bare = RecordedGround(path, altimeter, profile.Surface(*(np.zeros(0) for _ in range(4))), 0.0)
    surface = profile.surface_of(bare, grid(profile.DS_M, plan.s_max), profiles, _mean_profile(profiles))
    residuals = (profiles - surface.z_ref) / surface.s_ref
    residuals -= np.nanmean(residuals, axis=1, keepdims=True)
    products = [profile.lagged_products(residual[np.isfinite(residual)]) for residual in residuals]
    correlation = profile.correlation_length(np.sum(products, axis=0))
    return calibrate(RecordedGround(path, altimeter, surface, correlation), surface, plan, progress, run_all)


def _mean_profile(profiles: Array) -> Array:
    """The mean over the approaches at each place, corrected for aborted ones: shape (len(grid),) [m].

    Each approach has a height error of its own.  At the end of an aborted one the plain mean would step by its error:
    least squares of place + approach (two-way layout; Scheffe 1959, The Analysis of Variance, 4.4), iterated.
    """
    offsets = np.zeros((len(profiles), 1))
    for _ in range(ROUNDS):
        mean = np.nanmean(profiles - offsets, axis=0)
        offsets = np.nanmean(profiles - mean, axis=1, keepdims=True)
        offsets -= offsets.mean()
    return np.asarray(np.nanmean(profiles - offsets, axis=0))


def profiles_of(passes: Sequence[Pass], s_max: float) -> Array:
    """The terrain of each approach [m], shape (n, len(grid)); NaN where it has no height.

    Values beyond both ends of the profile equal those at the ends.  An approach starts at s_max and has heights over
    a window or more in total; it may be aborted.
    Raises ConfigError for fewer than five approaches, or if fewer than three have a height at a place.
    """
    s = grid(profile.DS_M, s_max)
    every = [_profile(s, one, s_max) for one in passes]
    begins = [float(np.max(s[np.isfinite(z)], initial=0.0)) for z in every]
    bins = (s >= 0.0) & (s <= s_max)
    usable = [z for z in every if np.isfinite(z[-1]) and np.isfinite(z[bins]).sum() * profile.DS_M >= WINDOW_M]
    if len(usable) < MIN_APPROACHES:
        raise ConfigError(
            f"only {len(usable)} of {len(passes)} recorded passes start {s_max:g} m before the intercept point and "
            f"have a height every {GAP_M:g} m for {WINDOW_M:g} m or more; a reference needs "
            f"{MIN_APPROACHES}{_length_hint(begins)}"
        )
    _check_places(s, np.array(usable), s_max)
    return np.array(usable)


def _profile(s: Array, one: Pass, s_max: float) -> Array:
    """The terrain of one approach at the places of the profile [m]; NaN in gaps, and before and after the flight."""
    z = profile.bin_means(s, one.s, one.z)
    known = (s >= 0.0) & (s <= s_max) & np.isfinite(z)
    if not known.any():
        return np.full_like(s, np.nan)
    places = s[known]
    after = np.searchsorted(places, s)
    lower, upper = (np.append(places, places[-1])[np.clip(after - back, 0, len(places))] for back in (1, 0))
    low = places[0] if places[0] > GAP_M else -np.inf
    high = places[-1] if places[-1] < s_max - GAP_M else np.inf
    is_covered = known | (upper - lower <= GAP_M) & (s >= low) & (s <= high)
    return np.where(is_covered, np.interp(s, places, z[known]), np.nan)


def _check_places(s: Array, profiles: Array, s_max: float) -> None:
    """Raises ConfigError where fewer than three approaches have a height."""
    count = np.isfinite(profiles).sum(axis=0)
    few = (s >= 0.0) & (s <= s_max) & (count < MIN_APPROACHES_AT_POINT)
    if few.any():
        raise ConfigError(
            f"only {count[few].min()} of {len(profiles)} recorded approaches have a height at {s[few][0]:g} to "
            f"{s[few][-1]:g} m before the intercept point; a reference needs {MIN_APPROACHES_AT_POINT} everywhere"
        )


def _length_hint(begins: Sequence[float]) -> str:
    """The length that has enough approaches, as a hint; "" if there is none."""
    if len(begins) < MIN_APPROACHES:
        return ""
    length_m = sorted(begins)[-MIN_APPROACHES] // 10.0 * 10.0
    return f"; allowed: --s-max {length_m:g} or less" if length_m >= MIN_PROFILE_M else ""


def read_passes(folder: Path, sensor: str, path: ApproachPath, s_max: float) -> list[Pass]:
    """The passes of a session.  Raises MissingError if it has no outputs of that altimeter."""
    recording = Recording.open(folder)
    heights, solutions = list[tuple[float, ...]](), list[tuple[float, ...]]()
    for topic, t_ns, _, _, data in recording.messages("/nav/"):
        with using_message(topic, t_ns):
            if topic == HEIGHT + sensor:
                heights += _heights(parse_table(data))
            elif topic == SOLUTION and (solution := parse_table(data)).get("altitude_source") not in COMPUTED_ALTITUDES:
                solutions += _numbers(solution, ("t_valid_ns", "lat", "lon", "alt", "roll", "pitch"), solution["valid"])
    if not heights or not solutions:
        raise MissingError(f"{folder}: has no heights of {sensor!r} with a position; run fti reprocess")
    return list(split_passes(_join_passes(np.array(heights), np.array(solutions), path), s_max))


def check_sensor(folder: Path, name: str, altimeter: AltimeterModel) -> None:
    """Raises ConfigError if the device is not an altimeter of this kind; MissingError."""
    device = recorded_config(Recording.open(folder), folder).find_device(name)
    required = altimeter.sensor
    if device is None or device.altimeter is None:
        raise ConfigError(f"{folder}: has no altimeter {name!r}")
    if not fits(device, required):
        found = device.altimeter
        raise ConfigError(
            f"{folder}: {name!r} is a {found.kind} of {found.beam_deg:g} deg; allowed: a {required.kind} of "
            f"{required.beam_deg:g} deg"
        )


def _heights(output: dict[str, Any]) -> Iterator[tuple[float, ...]]:
    """Heights that only the comparison with terrain rejects are used, as by the monitor: vegetation may have grown.

    Sessions of fti 0.1 have ``height_agl`` in place of ``nearest``.
    """
    name = "nearest" if "nearest" in output else "height_agl"
    yield from _numbers(output, ("t_valid_ns", name), TERRAIN_REASONS.issuperset(output["reasons"]))


def _numbers(output: dict[str, Any], names: Sequence[str], used: bool) -> Iterator[tuple[float, ...]]:
    if used and all(output[name] is not None for name in names):
        yield tuple(float(output[name]) for name in names)


def _join_passes(heights: Array, solutions: Array, path: ApproachPath) -> Pass:
    """Samples within the limits of the monitor, at the times of the heights."""
    settings = Approach(profile="")
    heights, solutions = heights[np.argsort(heights[:, 0])], solutions[np.argsort(solutions[:, 0])]
    t, t_nav = heights[:, 0], solutions[:, 0]
    lat, lon, alt, roll, pitch = (np.interp(t, t_nav, column) for column in solutions.T[1:])
    after = np.clip(np.searchsorted(t_nav, t), 1, len(t_nav) - 1)
    near = (t_nav[after] - t_nav[after - 1] <= MAX_SOLUTION_GAP_NS) & (t >= t_nav[0]) & (t <= t_nav[-1])
    s, y = path.to_path(lat, lon)
    used = (
        near
        & (np.abs(y) <= settings.y_max_m)
        & (np.abs(roll - path.bank(s)) <= np.radians(settings.max_roll_deg))
        & (np.abs(pitch) <= np.radians(settings.max_pitch_deg))
    )
    return Pass(t[used].astype(np.int64), s[used], (alt - heights[:, 1])[used])


def date_of(passes: Sequence[Pass]) -> str:
    """The date of the last pass, YYYY-MM-DD."""
    last = max(int(one.t_ns[-1]) for one in passes)
    return datetime.fromtimestamp(last // 10**9, UTC).strftime("%Y-%m-%d")


def split_passes(flight: Pass, s_max: float) -> Iterator[Pass]:
    """The passes of a flight between the ends of the reference; s never increases by more than MAX_BACKWARD_M."""
    inside = (flight.s >= -MARGIN_M) & (flight.s <= s_max + MARGIN_M)
    t_ns, s, z = flight.t_ns[inside], flight.s[inside], flight.z[inside]
    begin, lowest = 0, np.inf
    for k, here in enumerate(s.tolist()):
        if here > lowest + MAX_BACKWARD_M:
            yield Pass(t_ns[begin:k], s[begin:k], z[begin:k])
            begin, lowest = k, here
        lowest = min(lowest, here)
    if len(s):
        yield Pass(t_ns[begin:], s[begin:], z[begin:])
