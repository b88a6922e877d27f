"""The reference of an approach: the terrain profile for one kind of altimeter, and the limits of the tests.

A text file: lines ``# key = value`` (values as in TOML), then a table by commas.  The last header line is the hash:
SHA-256 over the rest.  The monitor refuses a reference for another kind of sensor.

    s_m      path length before the intercept point, step ds, from -200 to s_max + 200
    z_ref_m  altitude of the terrain for this sensor: altitude of the path minus expected height above ground
    s_ref_m  its sigma over the draws of receiver, track, height and elevation error
    s_alt_m  sigma of one sample of the altimeter at the expected height
"""

from __future__ import annotations

import functools
import hashlib
import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AllowInfNan, Field

from fti.arrays import Array
from fti.config import Approach, Device, Positive, StrictModel, bind, parse_toml
from fti.config.keys import NO_UNIT, ONE, key
from fti.errors import ConfigError
from fti.nav.integrity.approach import Airfield
from fti.nav.integrity.assumptions import BEAM_TOLERANCE_DEG, Assumptions

TITLE = "# fti reference profile"
COLUMNS = "s_m,z_ref_m,s_ref_m,s_alt_m"
#: Extension of the profile beyond both ends: the maximum shift of the match.
MARGIN_M = 200.0
#: Maximum nesting of tables in a key of the header.
MAX_FOLDERS = 8
#: Minimum number of correlation lengths in a window.
MIN_CORRELATIONS = 8


class ReferenceSensor(StrictModel):
    """The altimeter of the profile."""

    kind: Annotated[Literal["radar", "laser"], key("kind of the altimeter", NO_UNIT)]
    beam_deg: Annotated[Positive, key("full width of its beam", "deg")]


class ReferenceProfile(StrictModel):
    """Origin of the profile."""

    surface: Annotated[str, key("name of the elevation, or of the recordings", NO_UNIT)]
    made_from: Annotated[Literal["terrain", "recordings"], key("origin of the profile", NO_UNIT)]
    date: Annotated[
        str,
        Field(pattern=r"^\d{4}-\d{2}-\d{2}$"),
        key("date of the survey of the surface, or of the last recording", NO_UNIT),
    ]
    ds_m: Annotated[float, Field(ge=0.5, le=100.0), key("step of the profile along the track", "m")]
    s_max_m: Annotated[float, Field(gt=0.0, le=1e5), key("length of the profile before the intercept point", "m")]
    draws: Annotated[int, key("number of draws of the profile, or of recorded approaches", ONE)]
    seed: Annotated[int, key("seed of the random numbers", ONE)]
    window_m: Annotated[Positive, key("length of the comparison window", "m")]
    correlation_m: Annotated[Positive, key("correlation length of nominal residuals", "m")]
    datum_sd_m: Annotated[
        Positive, key("1-sigma of the difference between the height datums of surface and navigation", "m")
    ]


class Limits(StrictModel):
    """Limits of the four tests of the monitor: quantiles of the maxima of simulated nominal approaches."""

    t1: Annotated[Positive, key("limit of T1, absolute match", ONE)]
    t2: Annotated[Positive, key("limit of T2, position shift", ONE)]
    t3: Annotated[Positive, key("limit of T3, height error", ONE)]
    t4: Annotated[Positive, key("limit of T4, obstacle", ONE)]
    t1_interval: Annotated[tuple[float, float], key("95 % bootstrap interval of the limit of T1", ONE)]
    t2_interval: Annotated[tuple[float, float], key("95 % bootstrap interval of the limit of T2", ONE)]
    t3_interval: Annotated[tuple[float, float], key("95 % bootstrap interval of the limit of T3", ONE)]
    t4_interval: Annotated[tuple[float, float], key("95 % bootstrap interval of the limit of T4", ONE)]
    pfa: Annotated[Positive, key("probability of a false alarm in an approach, all tests together", ONE)]
    pmd: Annotated[
        float, Field(gt=0.0, lt=0.5), key("probability of a missed detection, in the protection levels", ONE)
    ]
    runs: Annotated[int, key("number of simulated approaches from which the limits are", ONE)]
    verified_runs: Annotated[int, key("number of other approaches, simulated with these limits", ONE)]
    verified_alarms: Annotated[int, key("number of the other approaches with an ALERT", ONE)]
    seed: Annotated[int, key("seed of the random numbers", ONE)]
    method: Annotated[str, key("method by which the limits are computed", NO_UNIT)]
    t4_widths_m: Annotated[
        Annotated[tuple[Positive, ...], Field(min_length=1)] | None,
        key("lengths of the templates of which T4 is the maximum; none: T4 and its limit use single bins", "m"),
    ] = None


class Detection(StrictModel):
    """Share of windows over a limit when the aircraft is beside the track and navigation is on it."""

    y_m: Annotated[tuple[float, ...], key("offsets to either side of the track", "m")]
    s_m: Annotated[tuple[float, ...], key("begin of each part of the path in which the windows end, descending", "m")]
    pd: Annotated[
        tuple[tuple[float, ...], ...], key("share of the windows: a row for each offset, a value for each part", ONE)
    ]
    runs: Annotated[int, key("number of simulated approaches for each offset", ONE)]


class Obstacles(StrictModel):
    """The smallest obstacle on the track, as long as wide, that T4 detects."""

    pd: Annotated[float, Field(gt=0.0, lt=1.0), key("probability with which it is detected", ONE)]
    width_m: Annotated[tuple[float, ...], key("widths of the obstacles", "m")]
    s_m: Annotated[tuple[float, ...], key("begin of each part of the path, descending", "m")]
    agl_m: Annotated[tuple[float, ...], key("height of the aircraft above ground in each part", "m")]
    height_m: Annotated[
        tuple[tuple[Annotated[float, AllowInfNan(True)], ...], ...],
        key(
            "height of the obstacle: a row for each width, a value for each part; inf: none of the simulated ones", "m"
        ),
    ]
    runs: Annotated[int, key("number of simulated approaches for each width and part", ONE)]

    def min_height(self, s: float, width: float) -> float:
        """Minimum height of an obstacle of this width at s that is detected [m]; inf: none is.

        It is that of the largest width in the table that does not exceed the given one.
        """
        narrower = [row for known, row in zip(self.width_m, self.height_m, strict=True) if known <= width]
        parts = [k for k, begin in enumerate(self.s_m) if s <= begin]
        return narrower[-1][parts[-1]] if narrower and parts else math.inf


class ReferenceHeader(StrictModel):
    """Everything but the table and the hash."""

    airfield: Annotated[Airfield, key("the keys of the airfield file", NO_UNIT)]
    sensor: Annotated[ReferenceSensor, key("[sensor]: the altimeter", NO_UNIT)]
    profile: Annotated[ReferenceProfile, key("[profile]: origin of the profile", NO_UNIT)]
    limits: Annotated[Limits, key("[limits]: limits of the tests", NO_UNIT)]
    assumptions: Annotated[
        Assumptions | None, key("[assumptions]: what the limits assume; none: in older references", NO_UNIT)
    ] = None
    detection: Annotated[
        Detection | None, key("[detection]: detection beside the track; none: a profile from recordings", NO_UNIT)
    ] = None
    obstacles: Annotated[
        Obstacles | None, key("[obstacles]: smallest obstacles; none: a profile from recordings", NO_UNIT)
    ] = None


@dataclass(frozen=True, eq=False)
class ApproachReference:
    """The reference of a published approach for one kind of altimeter.  Arrays of shape (n,), ascending s."""

    header: ReferenceHeader
    s: Array
    z_ref: Array
    s_ref: Array
    s_alt: Array

    @functools.cached_property
    def sd(self) -> Array:
        """Sigma of the residual of a bin [m]: of the profile, of a sample, of the navigated height within a window."""
        assumed = self.header.assumptions
        noise = assumed.nav_noise_sd_m if assumed else 0.0
        return np.asarray(np.sqrt(self.s_ref**2 + self.s_alt**2 + noise**2))

    @functools.cached_property
    def hash(self) -> str:
        """SHA-256 over the canonical content, hexadecimal."""
        return hashlib.sha256("\n".join(self._lines()).encode()).hexdigest()

    def to_text(self) -> str:
        """The file's text."""
        lines = self._lines()
        at = lines.index(COLUMNS)
        return "\n".join([*lines[:at], f'# hash = "{self.hash}"', *lines[at:]]) + "\n"

    def _lines(self) -> list[str]:
        head = [f"# {key} = {_toml(value)}" for key, value in _flat(self.header.model_dump(exclude_none=True), "")]
        columns = (self.s, self.z_ref, self.s_ref, self.s_alt)
        return [TITLE, *head, COLUMNS, *(",".join(f"{v:.3f}" for v in row) for row in zip(*columns, strict=True))]

    @classmethod
    def parse(cls, text: str, file: str) -> ApproachReference:
        """The reference in a text; file : its name, for messages.  Raises ConfigError with file, line and key."""
        lines = text.splitlines()
        if not lines or lines[0] != TITLE:
            raise ConfigError(f"{file}:1: the first line must be {TITLE!r}")
        if COLUMNS not in lines:
            raise ConfigError(f"{file}: the line {COLUMNS!r} is missing")
        at = lines.index(COLUMNS)
        table, where = _read_header(lines[1:at], file)
        stated = table.pop("hash", None)
        try:
            header = bind(ReferenceHeader, table, file)
        except ConfigError as error:
            raise ConfigError(_with_line(str(error), file, where)) from None
        _check_window(header.profile, file)
        _check_obstacles(header, file)
        rows = _read_rows(lines[at + 1 :], file, at + 2)
        _check_grid(rows[:, 0], header.profile, file, at + 2)
        _check_sigmas(rows, file, at + 2)
        reference = cls(header, *(np.ascontiguousarray(column) for column in rows.T))
        if stated != reference.hash:
            raise ConfigError(f"{file}:{where.get('hash', at)}: hash = {stated!r}: the content has {reference.hash!r}")
        return reference


def _flat(table: dict[str, Any], prefix: str) -> list[tuple[str, Any]]:
    """Dotted keys and their values, in order."""
    pairs: list[tuple[str, Any]] = []
    for name, value in table.items():
        pairs += _flat(value, f"{prefix}{name}.") if isinstance(value, dict) else [(prefix + name, value)]
    return pairs


def _toml(value: str | float | int | tuple[Any, ...] | dict[str, Any]) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {_toml(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(value)


def _read_header(lines: list[str], file: str) -> tuple[dict[str, Any], dict[str, int]]:
    """The header as nested tables, and the line of every key."""
    table: dict[str, Any] = {}
    where: dict[str, int] = {}
    for number, line in enumerate(lines, start=2):
        key, equals, value = line.removeprefix("# ").partition(" = ")
        if not line.startswith("# ") or not equals:
            raise ConfigError(f"{file}:{number}: {line!r}: must be '# key = value'")
        if key in where:
            raise ConfigError(f"{file}:{number}: {key}: defined twice")
        where[key] = number
        *folders, name = key.split(".")
        inner = table
        for folder in folders[:MAX_FOLDERS]:
            inner = inner.setdefault(folder, {})
            if not isinstance(inner, dict):
                raise ConfigError(f"{file}:{number}: {key}: {folder} already has a value")
        if len(folders) > MAX_FOLDERS:
            raise ConfigError(f"{file}:{number}: {key[:60]}...: must have at most {MAX_FOLDERS} dots")
        inner[name] = _read_value(value, f"{file}:{number}: {key}")
    return table, where


def _read_value(text: str, place: str) -> Any:
    try:
        return parse_toml(f"v = {text}", place)["v"]
    except (ConfigError, KeyError) as error:
        raise ConfigError(f"{place} = {text[:60]}: is not a value: {error}") from None


def _with_line(message: str, file: str, where: dict[str, int]) -> str:
    """The message with the line number of the first key that it names."""
    key = message.removeprefix(f"{file}: ").split(":")[0].split(" ")[0]
    return message.replace(f"{file}:", f"{file}:{where[key]}:", 1) if key in where else message


def _read_rows(lines: list[str], file: str, first: int) -> Array:
    width = COLUMNS.count(",") + 1
    rows = []
    for number, line in enumerate(lines, start=first):
        try:
            row = [float(field) for field in line.split(",")]
        except ValueError:
            raise ConfigError(f"{file}:{number}: {line!r}: must be {width} numbers ({COLUMNS})") from None
        if len(row) != width or not np.all(np.isfinite(row)):
            raise ConfigError(f"{file}:{number}: {line!r}: must be {width} numbers ({COLUMNS})")
        rows.append(row)
    return np.array(rows, dtype=np.float64).reshape(-1, width)


def _check_grid(s: Array, profile: ReferenceProfile, file: str, first: int) -> None:
    n_rows = (profile.s_max_m + 2 * MARGIN_M) / profile.ds_m + 1
    if not abs(n_rows - len(s)) < 1:
        raise ConfigError(f"{file}:{first}: s_m: {len(s)} rows; must be {n_rows:.0f} for profile.s_max_m and ds_m")
    expected = grid(profile.ds_m, profile.s_max_m)
    if len(s) != len(expected):
        raise ConfigError(f"{file}:{first}: s_m: {len(s)} rows; must be {len(expected)} for profile.s_max_m and ds_m")
    wrong = np.flatnonzero(np.abs(s - expected) > 1e-3)
    if len(wrong):
        raise ConfigError(f"{file}:{first + wrong[0]}: s_m = {s[wrong[0]]}: must be {expected[wrong[0]]}")


def _check_sigmas(rows: Array, file: str, first: int) -> None:
    for name, column in zip(("s_ref_m", "s_alt_m"), rows.T[2:], strict=True):
        wrong = np.flatnonzero(column <= 0.0)
        if len(wrong):
            raise ConfigError(f"{file}:{first + wrong[0]}: {name} = {column[wrong[0]]}: must be > 0")


def _check_window(profile: ReferenceProfile, file: str) -> None:
    """The compiled kernels read up to 200 m beyond a window, in whole steps, without a bounds check."""
    for name, length in (("the margin", MARGIN_M), ("window_m", profile.window_m)):
        if abs(length / profile.ds_m - round(length / profile.ds_m)) > 1e-9:
            raise ConfigError(f"{file}: profile.ds_m = {profile.ds_m}: must divide {name}, {length}")
    if profile.window_m > profile.s_max_m:
        raise ConfigError(f"{file}: profile.window_m = {profile.window_m}: must be at most s_max_m = {profile.s_max_m}")
    if profile.correlation_m > profile.window_m / MIN_CORRELATIONS:
        raise ConfigError(
            f"{file}: profile.correlation_m = {profile.correlation_m}: must be at most window_m / "
            f"{MIN_CORRELATIONS} = {profile.window_m / MIN_CORRELATIONS}"
        )


def _check_obstacles(header: ReferenceHeader, file: str) -> None:
    """Templates longer than the window would never detect anything."""
    widths, window = header.limits.t4_widths_m or (), header.profile.window_m
    if max(widths, default=0.0) > window:
        raise ConfigError(f"{file}: limits.t4_widths_m = {list(widths)}: must be at most window_m = {window}")
    table = header.obstacles
    if table is None:
        return
    parts = len(table.s_m)
    if len(table.agl_m) != parts or [len(row) for row in table.height_m] != [parts] * len(table.width_m):
        raise ConfigError(
            f"{file}: obstacles.height_m: must have one row for each of {len(table.width_m)} widths (width_m), with "
            f"one value for each of {parts} parts (s_m); so must agl_m"
        )


def grid(ds: float, s_max: float) -> Array:
    """The s of a reference [m]: from -200 to s_max + 200 in steps of ds."""
    return np.asarray(-MARGIN_M + ds * np.arange(round((s_max + 2 * MARGIN_M) / ds) + 1))


def min_level_v(reference: ApproachReference) -> float:
    """The minimum vertical protection level of any full window of a reference [m].

    PL_v = (t_3 + k_md) s_b with error-free navigation: datum and matching alone.
    """
    profile, limits = reference.header.profile, reference.header.limits
    size = round(profile.window_m / profile.ds_m) + 1
    weights = np.convolve(1.0 / reference.sd**2, np.ones(size), "valid")
    matching = size * profile.correlation_m / profile.window_m / float(weights.max())
    factor = limits.t3 + NormalDist().inv_cdf(1.0 - limits.pmd)
    return factor * math.sqrt(profile.datum_sd_m**2 + matching)


def check_settings(reference: ApproachReference, settings: Approach, file: str) -> None:
    """Check a configuration against a reference.  file : the configuration's name

    Raises ConfigError when the window differs from that of the limits, and when AL_s is not among the shifts of the
    match.
    """
    profile = reference.header.profile
    if settings.window_m != profile.window_m:
        raise ConfigError(
            f"{file}: nav.approach.window_m = {settings.window_m}: must be {profile.window_m}, "
            f"as for the limits of {settings.profile}"
        )
    if not profile.ds_m <= settings.alert_s_m <= MARGIN_M:
        raise ConfigError(
            f"{file}: nav.approach.alert_s_m = {settings.alert_s_m}: must be {profile.ds_m} to {MARGIN_M}"
        )


def check_alert_limit(reference: ApproachReference, alert_v: float, profile: str, file: str) -> None:
    """Raises ConfigError when the alert limit [m] is below the minimum protection level: it could never be met.

    Checked before a flight only: a recorded configuration is used unchanged.

    profile, file : names of the reference and of the configuration
    """
    minimum = min_level_v(reference)
    if alert_v < minimum:
        raise ConfigError(
            f"{file}: nav.approach.alert_v_m: {alert_v:g} m is below the minimum protection level {minimum:.1f} m of "
            f"{profile}; must be at least {math.ceil(minimum)} m"
        )


def fits(device: Device, sensor: ReferenceSensor, assumptions: Assumptions | None = None) -> bool:
    """Whether a device is the kind of altimeter of a reference.

    With assumptions the beam is checked there (``assumptions.receiver_holds``).
    """
    altimeter = device.altimeter
    if altimeter is None or altimeter.kind != sensor.kind:
        return False
    if sensor.kind == "laser" or assumptions is not None:
        return True
    return abs(altimeter.beam_deg - sensor.beam_deg) <= BEAM_TOLERANCE_DEG
