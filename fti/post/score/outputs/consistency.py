"""Fields of one message that must agree with each other and with the configuration."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from fti.arrays import Array, Mask
from fti.config import Config
from fti.hil.oracle.flag_definitions import HEIGHT, INTEGRITY, SOLUTION
from fti.hil.oracle.required_outputs import FILTER as FILTER_TOPIC
from fti.hil.oracle.required_outputs import FIX, GLIDE, HEIGHT_BELOW, LOCATION
from fti.hil.oracle.required_outputs import VERTICAL as VERTICAL_TOPIC
from fti.messages.outputs import Datum, IntegrityState, Point
from fti.messages.reasons import Reason
from fti.nav.navigation import FILTER, RADIO, VERTICAL
from fti.post.score.outputs.row import OutputCheck, OutputRow, result_of
from fti.post.score.series import TopicSeries
from fti.post.score.truth_table import TruthTable

#: Full scale, and one dot as a part of the glide angle (ICAO Annex 10; shared specification of the glide slope).
FULL_SCALE_DOTS, DOT = 2.0, 0.12
DOTS_EQUAL, ANGLES_EQUAL_DEG = 0.01, 0.005
#: Margins for the tilt of the beam: cos(roll) cos(pitch) is approximate, and the mounting adds to it.
TILT_FACTOR, TILT_MARGIN, HEIGHT_MARGIN_M = 1.5, 0.02, 1.0
#: The window is counted in bins of the reference.
WINDOW_SHARE = 0.05
#: Outputs that may have reasons while they are valid.
FILTERS = (FILTER_TOPIC, VERTICAL_TOPIC, FIX)
#: Reasons with which no output is valid.
ALWAYS_INVALID_REASONS = frozenset((Reason.STALE, Reason.SILENT, Reason.NO_IMU, Reason.ALIGNING, Reason.DIVERGED))
#: Reasons of outputs along the profile of an approach; no other output has them.
PROFILE_REASONS = frozenset(
    (
        Reason.OUTSIDE_PROFILE,
        Reason.END,
        Reason.GO_AROUND,
        Reason.NOT_OBSERVABLE,
        Reason.NO_PROFILE,
        Reason.BELOW_150_M,
    )
)
#: Required fields of valid messages.
VALUES = {
    SOLUTION: ("lat", "lon", "alt", "vel_north", "vel_east", "vel_down", "roll", "pitch", "heading"),
    LOCATION: ("latitude", "longitude", "altitude"),
    GLIDE: ("s", "y", "dh_nav"),
    FILTER_TOPIC: ("lat", "lon", "alt", "roll", "pitch", "heading"),
    VERTICAL_TOPIC: ("alt", "vel_down"),
    FIX: ("lat", "lon"),
    INTEGRITY: ("s_begin", "s_end"),
    HEIGHT: ("raw", "nearest", "height_agl", "sd"),
    HEIGHT_BELOW: ("height_agl", "sd"),
}
#: States in which the monitor has a result.
RESULT_STATES = (IntegrityState.OK, IntegrityState.MONITOR, IntegrityState.CAUTION, IntegrityState.ALERT)


class Consistency:
    """Rows of one topic.

    nominal : valid messages without a fault, shape (n,); t : times of all messages [s of the flight], shape (n,)
    glide : glide angle of the approach [rad]; None without one
    """

    def __init__(self, series: TopicSeries, nominal: Mask, t: Array, config: Config, glide: float | None) -> None:
        self._series, self._nominal, self._t = series, nominal, t
        self._config, self._glide = config, glide

    def rows(self, truth: TruthTable) -> Iterator[OutputRow]:
        """Every check of the topic."""
        topic, nav = self._series.topic, self._config.nav
        yield from self._reasons()
        yield from self._values()
        if topic == SOLUTION:
            yield self._named("position_source", (*nav.position, FILTER, RADIO))
            yield self._named("attitude_source", (*nav.attitude, FILTER))
            yield self._named("altitude_source", (*nav.position, FILTER, RADIO, VERTICAL))
        elif topic.startswith(f"{HEIGHT}/"):
            name = topic.rpartition("/")[2]
            for field, value in (("sensor", name), ("datum", Datum.AGL), ("point", Point.P)):
                yield self._named(field, (value,), may_be_none=False)
            yield from self._height_of_range(truth, name)
        elif topic == HEIGHT_BELOW:
            for field, values in (("sensor", nav.altimeters), ("datum", (Datum.AGL,)), ("point", (Point.P,))):
                yield self._named(field, values, may_be_none=False)
        elif topic == GLIDE and self._glide is not None:
            yield from self._deviation(self._glide)
        elif topic == INTEGRITY and nav.approach:
            yield from self._window(nav.approach.window_m)

    def _reasons(self) -> Iterator[OutputRow]:
        """Exactly the invalid messages have reasons; valid messages of filters and the monitor may have some."""
        rows, topic = self._series.rows, self._series.topic
        if not any("reasons" in row for row in rows):
            return
        fits = _fits_state if topic == INTEGRITY else _has_reason if topic in FILTERS else _has_reason_if_not_valid
        wrong = [i for i, row in enumerate(rows) if not fits(row)]
        text = f"{len(wrong)} messages differ" if wrong else "consistent"
        at_s = float(self._t[wrong[0]]) if wrong else None
        yield OutputRow(
            topic, OutputCheck.CONSISTENT, "valid and reasons", result_of(not wrong), text, LIMITS[fits], at_s
        )
        if topic not in (INTEGRITY, GLIDE):
            foreign = sorted(PROFILE_REASONS & {str(reason) for row in rows for reason in row.get("reasons") or ()})
            limit = "none that belongs to an approach"
            yield OutputRow(topic, OutputCheck.CONSISTENT, "reasons", result_of(not foreign), ", ".join(foreign), limit)

    def _values(self) -> Iterator[OutputRow]:
        """A valid message has its values."""
        series = self._series
        fields = VALUES.get(HEIGHT if series.topic.startswith(f"{HEIGHT}/") else series.topic, ())
        missing = [f for f in fields if (series.valid & ~np.isfinite(series.column(f))).any()]
        if fields:
            text = f"valid without {', '.join(missing)}" if missing else "consistent"
            limit = "each value of a valid message"
            yield OutputRow(series.topic, OutputCheck.CONSISTENT, "values", result_of(not missing), text, limit)

    def _named(self, field: str, names: tuple[str, ...], *, may_be_none: bool = True) -> OutputRow:
        """A field that names a device must name a configured one."""
        allowed = (*names, None) if may_be_none else names
        wrong = [i for i, name in enumerate(self._series.values(field)) if name not in allowed]
        text = f"{self._series.rows[wrong[0]].get(field)!r}" if wrong else "as configured"
        at_s = float(self._t[wrong[0]]) if wrong else None
        return OutputRow(
            self._series.topic, OutputCheck.CONSISTENT, field, result_of(not wrong), text, ", ".join(names), at_s
        )

    def _height_of_range(self, truth: TruthTable, name: str) -> Iterator[OutputRow]:
        """Height of P from a range: the correction is limited by attitude and lever arm."""
        series, device, wheels = self._series, self._config.find_device(name), self._config.nav.wheels_b
        raw = series.column("raw")
        tilt = np.cos(truth.at("roll", series.valid_ns)) * np.cos(truth.at("pitch", series.valid_ns))
        arm = math.hypot(*device.lever_arm_b) if device else 0.0
        allowed = abs(raw) * (TILT_FACTOR * (1.0 - tilt) + TILT_MARGIN) + arm + HEIGHT_MARGIN_M
        yield from self._largest("nearest - raw", "m", abs(series.column("nearest") - raw), allowed)
        if wheels is not None:
            below = abs(series.column("wheels") - series.column("height_agl"))
            yield from self._largest("wheels - height_agl", "m", below, math.hypot(*wheels) + HEIGHT_MARGIN_M)

    def _deviation(self, glide: float) -> Iterator[OutputRow]:
        """deviation = atan2(s tan g + dh, s) - g, and dots = deviation / 0.12 g within full scale."""
        s, dh, deviation = (self._series.column(name) for name in ("s", "dh", "deviation"))
        other = np.rad2deg(abs(deviation - np.arctan2(s * math.tan(glide) + dh, s) + glide))
        yield from self._largest("deviation of s and dh", "deg", other, ANGLES_EQUAL_DEG)
        dots = np.clip(deviation / (DOT * glide), -FULL_SCALE_DOTS, FULL_SCALE_DOTS)
        yield from self._largest("dots of deviation", "dots", abs(self._series.column("dots") - dots), DOTS_EQUAL)

    def _window(self, window_m: float) -> Iterator[OutputRow]:
        """The window is behind the aircraft and has the configured length."""
        length = self._series.column("s_begin") - self._series.column("s_end")
        yield from self._largest("window length", "m", abs(length - window_m), WINDOW_SHARE * window_m)

    def _largest(self, what: str, unit: str, value: Array, allowed: Array | float) -> Iterator[OutputRow]:
        """The difference that exceeds its limit most; no row where nothing can be compared."""
        limit = np.broadcast_to(np.asarray(allowed, dtype=np.float64), value.shape)
        known = np.flatnonzero(self._nominal & np.isfinite(value) & np.isfinite(limit))
        if not len(known):
            return
        worst = int(known[np.argmax(value[known] - limit[known])])
        yield OutputRow(
            self._series.topic,
            OutputCheck.CONSISTENT,
            what,
            result_of(bool(value[worst] <= limit[worst])),
            f"{value[worst]:.3g} {unit}",
            f"<= {limit[worst]:.3g} {unit}",
            float(self._t[worst]),
        )


def _has_reason_if_not_valid(row: Mapping[str, Any]) -> bool:
    return (row.get("valid") is True) is (not row.get("reasons"))


def _has_reason(row: Mapping[str, Any]) -> bool:
    reasons = row.get("reasons") or ()
    return ALWAYS_INVALID_REASONS.isdisjoint(map(str, reasons)) if row.get("valid") is True else bool(reasons)


def _fits_state(row: Mapping[str, Any]) -> bool:
    """Is the monitor valid exactly with a result, and has it a reason otherwise, unless it fills its window?"""
    has_result = row.get("state") in RESULT_STATES
    is_acquiring = row.get("state") == IntegrityState.ACQUIRE
    if (row.get("valid") is True) is not has_result:
        return False
    if row.get("state") in (IntegrityState.OK, IntegrityState.MONITOR):  # T2 needs an observable shift
        return (row.get("t2_ratio") is None) is (row.get("state") == IntegrityState.MONITOR)
    return has_result or is_acquiring or bool(row.get("reasons"))


LIMITS = {
    _has_reason_if_not_valid: "a reason if and only if it is not valid",
    _has_reason: "a reason where it is not valid",
    _fits_state: f"valid in {', '.join(RESULT_STATES)}; {IntegrityState.MONITOR} if and only if T2 is not tested",
}
