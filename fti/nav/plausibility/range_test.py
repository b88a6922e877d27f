"""Tests ``ranges_disagree`` and ``ranges_contradict``: the raw observations of a receiver against its own position.

At most once a second a position is computed from the pseudoranges of GPS L1 C/A of satellites with an ephemeris
(``range_solution``).  The stated one nearest in time, moved by the stated velocity, is compared with it:

    |p_stated - p_ranges| > K (sigma_stated^2 + sigma_ranges^2)^1/2 + speed t_u + a dt^2 / 2         contradicts

dt is the difference of the receiver's own times, without whole seconds, because one may be UTC and the other GPS; where
the fix has none it is that of arrival, uncertain by t_u.

    all explanations agree with it                passes: also where the receiver excludes a wrong range
    none of them agrees with it                   ranges_contradict
    none, some of several, or an uncertain one    ranges_disagree

A finding needs MIN_EPOCHS consecutive failing epochs.  It lasts until an epoch passes, also while ranges are missing.
Without ephemerides nothing is tested.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from fti.constants import SECOND_NS
from fti.geodesy.broadcast_orbit import seconds_after
from fti.geodesy.formulas import ecef_from_geodetic, geodetic_from_ecef, radii
from fti.messages.measurements import Ephemeris, Pseudorange, Pseudoranges, Stamp, TimeScale
from fti.messages.reasons import Reason
from fti.nav.plausibility.budget import K_FALSE
from fti.nav.plausibility.finding import PlausibilityFinding
from fti.nav.plausibility.range_solution import MeasuredRange, RangePosition, RangeSolution, solve_ranges

SYSTEM, SIGNAL = "gps", "L1C"
#: Minimum time between tested epochs [ns]: clocks of 1 Hz jitter.
PERIOD_NS = 9 * SECOND_NS // 10
MIN_EPOCHS = 5
#: Maximum time between consecutive failing epochs [ns].
MAX_GAP_NS = 5 * SECOND_NS
#: Maximum time between compared fix and epoch [ns].
MAX_PAIRING_NS = SECOND_NS
#: Ephemerides are valid for half of their fit interval of 4 h about toe [s]; they are deleted after this time [ns].
FIT_S, EPHEMERIS_TIMEOUT_NS = 7200.0, 4 * 3600 * SECOND_NS
#: Minimum C/N0 of a signal [dB-Hz], where stated.
MIN_CN0 = 33.0
#: Limits of pseudoranges, with a receiver clock off by 0.1 s [m]; of the root of the semi-major axis [m^0.5]; of e.
MIN_RANGE_M, MAX_RANGE_M = -1e7, 6e7
MIN_SQRT_A, MAX_SQRT_A, MAX_ECCENTRICITY = 5000.0, 5300.0, 0.05
#: Maximum acceleration between fix and epoch [m/s^2]; maximum latency of one of them [s].
ACCELERATION, LATE_S = 30.0, 0.3
WEEK_NS = 604_800 * SECOND_NS
#: Minimum cosine of the latitude, for longitudes near a pole [1].
MIN_COS_LAT = 1e-6


@dataclass(frozen=True, slots=True)
class StatedFix:
    """lat, lon [rad], sd of a horizontal axis [m], velocity north, east [m/s]; None where it is unknown."""

    t_ns: int
    stamp: Stamp
    lat: float
    lon: float
    sd: float
    velocity: tuple[float, float] | None


class _Epoch(NamedTuple):
    t_ns: int
    stamp: Stamp
    t_receiver: float
    measured: list[MeasuredRange]


class RangeTest:
    """One receiver.  max_speed : of the aircraft, where it states no velocity [m/s]"""

    def __init__(self, max_speed: float) -> None:
        self._max_speed = max_speed
        self._ephemerides: dict[int, tuple[int, Ephemeris]] = {}
        self._epoch: _Epoch | None = None
        self._last_epoch_ns: int | None = None
        self._fix: StatedFix | None = None
        self._failed, self._failed_since_ns, self._failed_ns = 0, 0, 0
        self._finding: PlausibilityFinding | None = None

    @property
    def is_useful(self) -> bool:
        """Whether the receiver has given an ephemeris."""
        return bool(self._ephemerides)

    def feed_ephemeris(self, t_ns: int, m: Ephemeris) -> None:
        """Add the ephemeris of a satellite; implausible ones are ignored."""
        is_orbit = MIN_SQRT_A <= m.sqrt_a <= MAX_SQRT_A and 0.0 <= m.e <= MAX_ECCENTRICITY
        if m.system == SYSTEM and is_orbit:
            self._ephemerides[m.number] = t_ns, m

    def feed_ranges(self, t_ns: int, m: Pseudoranges) -> None:
        """Add the ranges of an epoch; the next fix is compared with them."""
        if not self._ephemerides or m.stamp.t_dev_ns is None or m.stamp.time_scale is not TimeScale.GPS:
            return
        if self._last_epoch_ns is not None and 0 <= t_ns - self._last_epoch_ns < PERIOD_NS:
            return
        self._last_epoch_ns = t_ns
        t_receiver = m.stamp.t_dev_ns % WEEK_NS / SECOND_NS
        usable = (self._usable(t_ns, t_receiver, o) for o in m.observations)
        by_number = {each.ephemeris.number: each for each in usable if each}
        self._epoch = _Epoch(t_ns, m.stamp, t_receiver, list(by_number.values()))

    def _usable(self, t_ns: int, t_receiver: float, o: Pseudorange) -> MeasuredRange | None:
        known = self._ephemerides.get(o.number) if (o.system, o.signal) == (SYSTEM, SIGNAL) else None
        if known is None or o.pseudorange is None or not MIN_RANGE_M < o.pseudorange < MAX_RANGE_M:
            return None
        received_ns, ephemeris = known
        is_held = abs(seconds_after(t_receiver, ephemeris.toe)) <= FIT_S and t_ns - received_ns <= EPHEMERIS_TIMEOUT_NS
        is_strong = o.cn0_dbhz is None or o.cn0_dbhz >= MIN_CN0
        if not (is_held and is_strong and ephemeris.healthy and ephemeris.accuracy is not None):
            return None
        return MeasuredRange(ephemeris, o.pseudorange, o.pseudorange_sd or 0.0)

    def feed_fix(self, fix: StatedFix) -> list[PlausibilityFinding]:
        """Add a stated position; returns the finding of the newest epochs."""
        before, self._fix = self._fix, fix
        epoch = self._epoch
        if epoch is not None and fix.t_ns >= epoch.t_ns:
            self._epoch = None
            known = [fix] if before is None else [before, fix]
            nearest = min(known, key=lambda each: abs(each.t_ns - epoch.t_ns))
            if abs(nearest.t_ns - epoch.t_ns) <= MAX_PAIRING_NS:
                self._evaluate(epoch, nearest)
        return [self._finding] if self._finding else []

    def release(self) -> bool:
        """End the finding by order of the operator; returns whether there was one."""
        had_finding, self._finding, self._failed = self._finding is not None, None, 0
        return had_finding

    def _evaluate(self, epoch: _Epoch, fix: StatedFix) -> None:
        solution = solve_ranges(epoch.t_receiver, epoch.measured)
        if solution is None:
            return
        failure = self._compare(epoch, fix, solution)
        if failure is None:
            self._failed, self._finding = 0, None
            return
        if self._failed == 0 or not 0 <= epoch.t_ns - self._failed_ns <= MAX_GAP_NS:
            self._failed, self._failed_since_ns = 0, epoch.t_ns
        self._failed, self._failed_ns = self._failed + 1, epoch.t_ns
        if self._failed >= MIN_EPOCHS and self._finding is None:
            self._finding = PlausibilityFinding(failure[0], self._failed_since_ns, failure[1])

    def _compare(self, epoch: _Epoch, fix: StatedFix, solution: RangeSolution) -> tuple[Reason, str] | None:
        """Reason and text of a finding; None: the fix agrees with the ranges."""
        compared = [(each, *self._difference(epoch, fix, each)) for each in solution.explanations]
        contradict = [row for row in compared if row[1] > row[2]]
        if compared and not contradict and all(row[0].is_certain for row in compared):
            return None
        if compared and len(contradict) == len(compared):
            each, size, limit = contradict[0]
            without = "" if each.left_out is None else f" without satellite {each.left_out}"
            text = f"{solution.used} pseudoranges{without} give a position {size:.0f} m from it, limit {limit:.0f} m"
            return Reason.RANGES_CONTRADICT, text
        text = f"residuals of {solution.used} pseudoranges are {solution.ratio:.1f} times their limit"
        return Reason.RANGES_DISAGREE, f"{text}, and which one is wrong is unknown"

    def _difference(self, epoch: _Epoch, fix: StatedFix, by_ranges: RangePosition) -> tuple[float, float]:
        """Horizontal distance of the stated position from that by ranges, and its limit [m]."""
        _, _, alt = geodetic_from_ecef(*by_ranges.pos_e.tolist())
        dt, late_s = _seconds_between(epoch, fix)
        north, east = fix.velocity or (0.0, 0.0)
        meridian, normal = radii(fix.lat)
        lat = fix.lat + north * dt / meridian
        lon = fix.lon + east * dt / (normal * max(math.cos(fix.lat), MIN_COS_LAT))
        size = math.dist(ecef_from_geodetic(lat, lon, alt), by_ranges.pos_e)
        moved = math.hypot(north, east) * late_s if fix.velocity else self._max_speed * (abs(dt) + late_s)
        limit = K_FALSE * math.hypot(fix.sd, by_ranges.level_sd)
        return size, limit + moved + 0.5 * ACCELERATION * dt * dt


def _seconds_between(epoch: _Epoch, fix: StatedFix) -> tuple[float, float]:
    """Time from fix to epoch [s], and its uncertainty [s]."""
    by_arrival = (epoch.t_ns - fix.t_ns) / SECOND_NS
    if fix.stamp.t_dev_ns is None or epoch.stamp.t_dev_ns is None or fix.stamp.time_scale is TimeScale.BOOT:
        return by_arrival, LATE_S
    by_device = (epoch.stamp.t_dev_ns - fix.stamp.t_dev_ns) / SECOND_NS
    return by_device - round(by_device - by_arrival), 0.0
