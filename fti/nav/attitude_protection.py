"""Protection levels of the attitude that navigation uses, whatever gives it: of the tilt and of the heading.

    compared with others        TPL = max over others of (|a - b| + 4.80 sigma_b) + held       b : an other source
                                HPL of the heading: |a - b| + 4.42 sigma_b + held              b : smallest sigma
    nothing to compare with     4.80 and 4.42 of the sigma of the source itself; ``unchecked`` says so

|a - b| of the tilt is hypot(roll, pitch): radial, because what rests on the attitude (heights, lever arms) rests on the
direction of the vertical.  It bounds roll and pitch, too.  held : what roll, pitch or heading have turned since the
newest entry of the source, at the rate of its last quarter of a second.

Others are the devices of ``nav.attitude`` that are not refused, and the filter when satellites have aided it for 30 s
since it began.  One bounds the tilt when it states its sigma and 4.80 of them are at most half of the alert limit.
Where none does, the one with the smallest sigma counts (``uncertain`` in ``unchecked``): its level is told, and held
against the limit only where it contradicts.  A sigma that is not stated is that of ``[nav.unstated_sd]``.

They are compared five times a second, at the time of the last solution of the filter: there both have entries around
it, and a roll is not taken for a difference.  A step is therefore within the level 0.4 s later.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from fti.config import AlertLimits, Config
from fti.nav.plausibility.budget import K_FALSE
from fti.nav.plausibility.filter_attitude import MIN_AIDING_NS
from fti.nav.protection import K_AXIS, K_RADIAL
from fti.nav.source_interpolation import AttitudeState, NavSource
from fti.nav.time_series import SECOND_NS, wrap
from fti.types import FilterMode, FilterSolution, Reason

#: Between two comparisons, and how old a solution of the filter may be in one [ns].
STEP_NS, MAX_AGE_NS = SECOND_NS // 5, SECOND_NS // 2


class AttitudeLevels(NamedTuple):
    """Protection levels of tilt and heading [rad], None where there is no attitude or heading.

    unchecked : why the tilt rests on what its source states, or on an other one that is too uncertain
    is_judged : the level of the tilt is held against its alert limit
    """

    tilt: float | None
    heading: float | None
    unchecked: tuple[Reason, ...] = ()
    is_judged: bool = False

    def reasons(self, limits: AlertLimits) -> tuple[Reason, ...]:
        """Why the attitude is not valid."""
        if self.tilt is None:
            return (Reason.NO_ATTITUDE,)
        is_beyond = self.is_judged and self.tilt > math.radians(limits.attitude_deg)
        is_alone = limits.compared and Reason.NOTHING_TO_COMPARE in self.unchecked
        table = ((Reason.ATTITUDE_LEVEL, is_beyond), (Reason.NOTHING_TO_COMPARE, is_alone))
        return tuple(reason for reason, holds in table if holds)


class AssumedSigmas(NamedTuple):
    """Sigma of tilt and heading where a source states none [rad]."""

    tilt: float
    heading: float


def levels(own: AttitudeState, others: Iterable[AttitudeState], assumed: AssumedSigmas, limit: float) -> AttitudeLevels:
    """Of an attitude, beside those of other sources at the same time.  limit : alert limit of the tilt [rad]"""
    beside = list(others)
    tilt, unchecked, is_judged = _tilt_level(own, beside, assumed.tilt, limit)
    return AttitudeLevels(tilt, _heading_level(own, beside, assumed.heading), unchecked, is_judged)


class _Bound(NamedTuple):
    """What another source says of a tilt: how far it is away, its sigma [rad], and whether it states that."""

    difference: float
    sd: float
    is_stated: bool

    @property
    def level(self) -> float:
        return self.difference + K_RADIAL * self.sd


def _tilt_level(
    own: AttitudeState, others: Sequence[AttitudeState], assumed: float, limit: float
) -> tuple[float, tuple[Reason, ...], bool]:
    """Level, ``unchecked`` and ``is_judged`` of ``AttitudeLevels``."""
    found = [_Bound(_tilt_difference(own, b), _aged_sd(b, assumed), b.tilt_sd is not None) for b in others]
    sharp = [bound for bound in found if bound.is_stated and K_RADIAL * bound.sd <= limit / 2.0]
    own_sd = own.tilt_sd or assumed
    if sharp:
        return max(bound.level for bound in sharp), (), True
    if found:
        best = min(found, key=lambda bound: bound.sd)
        contradicts = best.difference > max(limit, K_FALSE * math.hypot(best.sd, own_sd))
        return best.level, (Reason.UNCERTAIN,), contradicts
    return K_RADIAL * own_sd, (Reason.NOTHING_TO_COMPARE,), own.tilt_sd is not None


def _heading_level(own: AttitudeState, others: Sequence[AttitudeState], assumed: float) -> float | None:
    if own.heading is None:
        return None
    found = [(b.heading_sd or assumed, abs(wrap(b.heading - own.heading))) for b in others if b.heading is not None]
    sd, difference = min(found, default=(own.heading_sd or assumed, 0.0))
    return min(math.pi, difference + K_AXIS * sd)


def _aged_sd(other: AttitudeState, assumed: float) -> float:
    """Sigma of a tilt, with its age: who falls silent in a roll contradicts nobody."""
    return max(other.tilt_sd or assumed, other.roll_sd or 0.0, other.pitch_sd or 0.0)


def _tilt_difference(one: AttitudeState, other: AttitudeState) -> float:
    """Radial difference of roll and pitch [rad]."""
    return math.hypot(wrap(one.roll - other.roll), one.pitch - other.pitch)


class AttitudeProtection:
    """Of the attitude in use.  sources : devices of ``nav.attitude``, by name"""

    def __init__(self, config: Config, sources: Mapping[str, NavSource]) -> None:
        unstated = (math.radians(sd) for sd in config.nav.unstated_sd.attitude_deg)
        self._assumed = AssumedSigmas(*unstated)
        self._limit = math.radians(config.nav.alert_limits.attitude_deg)
        self._sources = {name: sources[name] for name in config.nav.attitude}
        self._filtered: FilterSolution | None = None
        self._aided_since_ns: int | None = None
        self._is_independent = False  # of the attitude that the filter began with
        self._compared: tuple[int, str | None] | None = None
        self._levels = AttitudeLevels(None, None)

    def feed_filter(self, solution: FilterSolution) -> None:
        """Take what the filter says."""
        self._filtered = solution if solution.valid else None
        if not solution.valid or solution.mode is not FilterMode.AIDED:
            self._aided_since_ns, self._is_independent = None, solution.valid and self._is_independent
            return
        if self._aided_since_ns is None:
            self._aided_since_ns = solution.t_ns
        self._is_independent |= solution.t_ns - self._aided_since_ns >= MIN_AIDING_NS

    def at(self, t_ns: int, attitude: AttitudeState | None, source: str | None) -> AttitudeLevels:
        """Levels of the attitude at a time, and of which source it is; the filter is none of ``sources``."""
        if attitude is None:
            self._compared = None
            return AttitudeLevels(None, None)
        last = self._compared
        if last is None or last[1] != source or not 0 <= t_ns - last[0] < STEP_NS:
            self._levels, self._compared = self._compare(t_ns, attitude, source), (t_ns, source)
        device = self._sources.get(source or "")
        return self._levels if device is None else _add_rotation(self._levels, *device.turned(t_ns))

    def _compare(self, t_ns: int, attitude: AttitudeState, source: str | None) -> AttitudeLevels:
        device = self._sources.get(source or "")
        if device is None:  # nothing but the filter has an attitude
            alone = levels(attitude, (), self._assumed, self._limit)
            return alone._replace(unchecked=()) if self._is_independent else alone
        filtered = self._usable_filter(t_ns)
        then_ns = t_ns - STEP_NS if filtered is None else filtered.t_ns
        own = device.attitude(then_ns)
        if own is None:  # it has only begun
            return levels(attitude, (), self._assumed, self._limit)
        others = [other.attitude(then_ns) for name, other in self._sources.items() if name != source]
        beside = [*others, _attitude_of(filtered)]
        return levels(own, [other for other in beside if other], self._assumed, self._limit)

    def _usable_filter(self, t_ns: int) -> FilterSolution | None:
        found = self._filtered if self._is_independent else None
        return found if found is not None and 0 <= t_ns - found.t_ns <= MAX_AGE_NS else None


def _attitude_of(solution: FilterSolution | None) -> AttitudeState | None:
    if solution is None or solution.roll is None or solution.pitch is None or solution.tilt_sd is None:
        return None
    tilt_sd = solution.tilt_sd
    return AttitudeState(
        solution.roll, solution.pitch, solution.heading, tilt_sd, tilt_sd, tilt_sd, solution.heading_sd
    )


def _add_rotation(found: AttitudeLevels, tilt: float, heading: float) -> AttitudeLevels:
    """The levels of an attitude that has turned by so much since [rad]."""
    level, of_heading = found.tilt, found.heading
    return found._replace(
        tilt=None if level is None else min(math.pi, level + tilt),
        heading=None if of_heading is None else min(math.pi, of_heading + heading),
    )
