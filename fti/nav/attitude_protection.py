"""Protection levels of the attitude that navigation uses, from any source: of the tilt and of the heading.

    compared with others        TPL = max over others of (|a - b| + 4.80 sigma_b) + rotation   b : another source
                                HPL of the heading: |a - b| + 4.42 sigma_b + rotation          b : smallest sigma
    nothing to compare with     4.80 and 4.42 of the sigma of the source itself; marked in ``unchecked``

|a - b| of the tilt is hypot(roll, pitch): radial, because heights and lever arms depend on the direction of the
vertical.  It bounds roll and pitch, too.  rotation : change of roll, pitch or heading since the newest entry of the
source, at the rate of its last quarter of a second.

Others are the devices of ``nav.attitude`` that are not refused, and the filter if satellites have aided it for 30 s
since its start.  A source bounds the tilt if it states its sigma and 4.80 sigma are at most half of the alert limit.
If none does, the one with the smallest sigma is used (``uncertain`` in ``unchecked``): its level is output, and
compared with the limit only if it contradicts.  A sigma that is not stated is that of ``[nav.unstated_sd]``.

They are compared five times a second, at the time of the last solution of the filter: both have entries before and
after it, so a roll rate is not taken for a difference.  A step is therefore within the level 0.4 s later.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from fti.config import AlertLimits, Config
from fti.constants import SECOND_NS
from fti.geodesy.formulas import wrap_half_turn
from fti.messages.outputs import FilterMode, FilterSolution
from fti.messages.reasons import Reason
from fti.nav.plausibility.budget import K_FALSE
from fti.nav.plausibility.filter_attitude import MIN_AIDING_NS
from fti.nav.protection import K_AXIS, K_RADIAL
from fti.nav.source_interpolation import AttitudeState, NavSource

#: Time between two comparisons, and maximum age of a solution of the filter in one [ns].
STEP_NS, MAX_AGE_NS = SECOND_NS // 5, SECOND_NS // 2


class AttitudeLevels(NamedTuple):
    """Protection levels of tilt and heading [rad], None where there is no attitude or heading.

    unchecked : why the tilt depends on the stated sigma of its source, or on an uncertain other source
    is_checked : the level of the tilt is compared with its alert limit
    """

    tilt: float | None
    heading: float | None
    unchecked: tuple[Reason, ...] = ()
    is_checked: bool = False

    def reasons(self, limits: AlertLimits) -> tuple[Reason, ...]:
        """Reasons why the attitude is not valid."""
        if self.tilt is None:
            return (Reason.NO_ATTITUDE,)
        is_beyond = self.is_checked and self.tilt > math.radians(limits.attitude_deg)
        is_alone = limits.compared and Reason.NOTHING_TO_COMPARE in self.unchecked
        table = ((Reason.ATTITUDE_LEVEL, is_beyond), (Reason.NOTHING_TO_COMPARE, is_alone))
        return tuple(reason for reason, holds in table if holds)


class AssumedSigmas(NamedTuple):
    """Sigma of tilt and heading if a source states none [rad]."""

    tilt: float
    heading: float


def levels(own: AttitudeState, others: Iterable[AttitudeState], assumed: AssumedSigmas, limit: float) -> AttitudeLevels:
    """Of an attitude, from those of other sources at the same time.  limit : alert limit of the tilt [rad]"""
    compared = list(others)
    tilt, unchecked, is_checked = _tilt_level(own, compared, assumed.tilt, limit)
    return AttitudeLevels(tilt, _heading_level(own, compared, assumed.heading), unchecked, is_checked)


class _Bound(NamedTuple):
    """Another source of a tilt: its difference, its sigma [rad], and whether the sigma is stated."""

    difference: float
    sd: float
    is_stated: bool

    @property
    def level(self) -> float:
        return self.difference + K_RADIAL * self.sd


def _tilt_level(
    own: AttitudeState, others: Sequence[AttitudeState], assumed: float, limit: float
) -> tuple[float, tuple[Reason, ...], bool]:
    """Level, ``unchecked`` and ``is_checked`` of ``AttitudeLevels``."""
    bounds = [_Bound(_tilt_difference(own, b), _aged_sd(b, assumed), b.tilt_sd is not None) for b in others]
    sharp = [bound for bound in bounds if bound.is_stated and K_RADIAL * bound.sd <= limit / 2.0]
    own_sd = own.tilt_sd or assumed
    if sharp:
        return max(bound.level for bound in sharp), (), True
    if bounds:
        best = min(bounds, key=lambda bound: bound.sd)
        contradicts = best.difference > max(limit, K_FALSE * math.hypot(best.sd, own_sd))
        return best.level, (Reason.UNCERTAIN,), contradicts
    return K_RADIAL * own_sd, (Reason.NOTHING_TO_COMPARE,), own.tilt_sd is not None


def _heading_level(own: AttitudeState, others: Sequence[AttitudeState], assumed: float) -> float | None:
    if own.heading is None:
        return None
    headings = [
        (b.heading_sd or assumed, abs(wrap_half_turn(b.heading - own.heading))) for b in others if b.heading is not None
    ]
    sd, difference = min(headings, default=(own.heading_sd or assumed, 0.0))
    return min(math.pi, difference + K_AXIS * sd)


def _aged_sd(other: AttitudeState, assumed: float) -> float:
    """Sigma of a tilt, grown by its age, so that a source that falls silent in a roll contradicts no other."""
    return max(other.tilt_sd or assumed, other.roll_sd or 0.0, other.pitch_sd or 0.0)


def _tilt_difference(one: AttitudeState, other: AttitudeState) -> float:
    """Radial difference of roll and pitch [rad]."""
    return math.hypot(wrap_half_turn(one.roll - other.roll), one.pitch - other.pitch)


class AttitudeProtection:
    """Protection levels of the attitude in use.  sources : devices of ``nav.attitude``, by name"""

    def __init__(self, config: Config, sources: Mapping[str, NavSource]) -> None:
        unstated = (math.radians(sd) for sd in config.nav.unstated_sd.attitude_deg)
        self._assumed = AssumedSigmas(*unstated)
        self._limit = math.radians(config.nav.alert_limits.attitude_deg)
        self._sources = {name: sources[name] for name in config.nav.attitude}
        self._filtered: FilterSolution | None = None
        self._aided_since_ns: int | None = None
        self._is_independent = False  # of the initial attitude of the filter
        self._last_comparison: tuple[int, str | None] | None = None
        self._levels = AttitudeLevels(None, None)

    def feed_filter(self, solution: FilterSolution) -> None:
        """Take a solution of the filter."""
        self._filtered = solution if solution.valid else None
        if not solution.valid or solution.mode is not FilterMode.AIDED:
            self._aided_since_ns, self._is_independent = None, solution.valid and self._is_independent
            return
        if self._aided_since_ns is None:
            self._aided_since_ns = solution.t_ns
        self._is_independent |= solution.t_ns - self._aided_since_ns >= MIN_AIDING_NS

    def at(self, t_ns: int, attitude: AttitudeState | None, source: str | None) -> AttitudeLevels:
        """Levels of the attitude at a time.  source : its source, a device or the filter"""
        if attitude is None:
            self._last_comparison = None
            return AttitudeLevels(None, None)
        last = self._last_comparison
        if last is None or last[1] != source or not 0 <= t_ns - last[0] < STEP_NS:
            self._levels, self._last_comparison = self._compare(t_ns, attitude, source), (t_ns, source)
        device = self._sources.get(source or "")
        return self._levels if device is None else _add_rotation(self._levels, *device.rotation_since(t_ns))

    def _compare(self, t_ns: int, attitude: AttitudeState, source: str | None) -> AttitudeLevels:
        device = self._sources.get(source or "")
        if device is None:  # the filter is the only source of attitude
            own_levels = levels(attitude, (), self._assumed, self._limit)
            return own_levels._replace(unchecked=()) if self._is_independent else own_levels
        filtered = self._usable_filter(t_ns)
        compared_ns = t_ns - STEP_NS if filtered is None else filtered.t_ns
        own = device.attitude(compared_ns)
        if own is None:  # it has only just started
            return levels(attitude, (), self._assumed, self._limit)
        others = [other.attitude(compared_ns) for name, other in self._sources.items() if name != source]
        candidates = [*others, _attitude_of(filtered)]
        return levels(own, [other for other in candidates if other], self._assumed, self._limit)

    def _usable_filter(self, t_ns: int) -> FilterSolution | None:
        solution = self._filtered if self._is_independent else None
        return solution if solution is not None and 0 <= t_ns - solution.t_ns <= MAX_AGE_NS else None


def _attitude_of(solution: FilterSolution | None) -> AttitudeState | None:
    if solution is None or solution.roll is None or solution.pitch is None or solution.tilt_sd is None:
        return None
    tilt_sd = solution.tilt_sd
    return AttitudeState(
        solution.roll, solution.pitch, solution.heading, tilt_sd, tilt_sd, tilt_sd, solution.heading_sd
    )


def _add_rotation(levels: AttitudeLevels, tilt: float, heading: float) -> AttitudeLevels:
    """The levels enlarged by a rotation of tilt and heading since [rad]."""
    tilt_level, heading_level = levels.tilt, levels.heading
    return levels._replace(
        tilt=None if tilt_level is None else min(math.pi, tilt_level + tilt),
        heading=None if heading_level is None else min(math.pi, heading_level + heading),
    )
