"""Tests of one axis of the position of a source: ``repeated``, ``impossible``, ``jump``, ``drift``, ``scatter``.

    c_k = c_(k-1) + (x_k - x_(k-1)) - (V(t_k) - V(t_(k-1)))

x: position along the axis [m]; V: integral of the velocity of the same device.  c of a sound source changes by its
errors alone.  ``jump`` compares c_k - c_(k-1), ``drift`` the difference over 10 to 120 s, ``scatter`` the variance over
a minute.  While digits repeat suspiciously, the fix is held back: it is evaluated with the first different one, over
the whole time between them, or by ``repeated``.

A step and a ramp leave a standing contradiction D: c - c(onset).  It ends by a step back ("closure"): the source steps,
and D is cancelled within 4.2 sigma of the errors accumulated since the onset, which must be below half of D.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from msgspec import Struct
from msgspec.structs import replace

from fti.config import SourceLimits
from fti.constants import SECOND_NS
from fti.geodesy.formulas import wrap_half_turn
from fti.messages.reasons import Reason
from fti.nav.plausibility import scatter
from fti.nav.plausibility.budget import K_CLOSURE, K_FALSE, K_JUMP
from fti.nav.plausibility.finding import PlausibilityFinding
from fti.nav.plausibility.repetition import UNKNOWN_STEP_M, RepetitionTest
from fti.nav.plausibility.resolution import ResolutionEstimator
from fti.nav.plausibility.sigmas import VELOCITY_TAU_S, WHITE_SHARE, FixInterval, FixSigma, difference_variance
from fti.nav.plausibility.velocity_integral import Integral, VelocityIntegral

#: Minimum time between tested fixes [ns].
MIN_STEP_NS = 80_000_000
#: Windows of the drift test [s], its period [ns], and size of the history.
WINDOWS_S = (10, 20, 40, 60, 120)
HISTORY_NS = SECOND_NS
HISTORY_SIZE = 122
#: Newest entries of the test of scatter: a minute.
SCATTER_ENTRIES = 60
SCATTER_PERIOD = 10
#: Maximum gap over which the limits of speed are tested [s].
MAX_BRIDGE_S = 60.0
#: Maximum extrapolation of a velocity before a fix waits for the next one [s].
MAX_AGE_S = 0.3
#: A larger change of the stated sigma indicates another kind of fix [factor].
MAX_SIGMA_RATIO = 1.5
#: Fixes of the mean of the white variance; with fewer, its own error would widen the tails.
WHITE_FIXES = 200.0


class AxisFix(Struct, frozen=True, gc=False):
    """One position along the axis.

    value : as the device states it [rad, m]; metres : per unit of value
    """

    t_ns: int
    value: float
    metres: float
    sigma: FixSigma


class _AxisState(Struct, frozen=True, gc=False):
    """State after one fix.  path, speed : integral of the velocity, and velocity; segment : of the velocities"""

    t_ns: int
    c: float
    path: float
    speed: float
    sigma: float
    segment: int


class _EarlierFix(Struct, frozen=True, gc=False):
    """An earlier fix: time since [s]; its speed along the axis [m/s]; path since [m]; its sigma [m]."""

    seconds: float
    speed: float
    path: float
    sigma: float


@dataclass(slots=True)
class StandingContradiction:
    """A contradiction that has not ended.

    offset : D [m], None when it is no longer tracked;  last_offset : last tracked D [m]
    """

    onset_ns: int
    offset: float | None
    path: float
    last_offset: float | None = None

    @property
    def size(self) -> float | None:
        """The newest known D [m]; None if it was never known."""
        return self.last_offset if self.offset is None else self.offset

    def lose(self) -> None:
        """Stop tracking D."""
        self.last_offset, self.offset = self.size, None


class AxisTests:
    """One axis of one source.  name : "north", "east", "up"; max_speed : along the axis [m/s]"""

    def __init__(self, name: str, limits: SourceLimits, max_speed: float, *, is_angle: bool) -> None:
        self.name = name
        self.velocity = VelocityIntegral()
        self.contradiction: StandingContradiction | None = None
        self.is_closed = False
        self.is_suspected = False  # the last drift test was above half of its limit
        self._acceleration = limits.acceleration_mps2
        self._max_speed = max_speed
        self._is_angle = is_angle
        self._resolution = ResolutionEstimator()
        self._repetition = RepetitionTest()
        self._last: AxisFix | None = None
        self._last_at: Integral | None = None
        self._max_change = 0.0  # in units of the value: a larger change is always tested
        self._pending: AxisFix | None = None
        self._previous: Integral | None = None
        self._c = 0.0
        self._white: float | None = None
        self._history: deque[_AxisState] = deque(maxlen=HISTORY_SIZE)
        self._history_count = 0

    # ------------------------------------------------------------------------------------------------------ taking

    def feed_velocity(self, t_ns: int, speed: float) -> list[PlausibilityFinding] | None:
        """Add a velocity along the axis [m/s]; evaluates a fix that waited for it.  None: nothing was evaluated"""
        self.velocity.feed(t_ns, speed)
        pending = self._pending
        if pending is None or (self.velocity.newest_ns or 0) < pending.t_ns:
            return None
        self._pending = None
        return self._evaluate(pending)

    def is_due(self, t_ns: int, value: float) -> bool:
        """Whether a fix of this time is evaluated, or releases a waiting one: frequent fixes are skipped.

        An early one is evaluated if it is farther away than motion and sigma explain: otherwise every second fix could
        be anywhere.
        """
        last = self._last
        if self._pending is not None or not last or t_ns - last.t_ns >= MIN_STEP_NS:
            return True
        return t_ns >= last.t_ns and abs(self._difference(value, last)) > self._max_change

    def feed_fix(self, fix: AxisFix) -> list[PlausibilityFinding] | None:
        """Add a fix.  None: nothing was evaluated"""
        findings: list[PlausibilityFinding] = []
        if self._pending:
            pending, self._pending = self._pending, None
            findings += self._evaluate(pending) or ()
        if not self.is_due(fix.t_ns, fix.value):
            return findings or None
        at = self.velocity.at(fix.t_ns)
        if at and at.age_s > MAX_AGE_S and not self._is_gross(fix, at):
            self._pending = fix
            return findings or None
        new_findings = self._evaluate(fix)
        return findings or None if new_findings is None else findings + new_findings

    def _is_gross(self, fix: AxisFix, at: Integral) -> bool:
        """Whether it is a step at any acceleration since the newest velocity, so that it need not wait."""
        if self._last is None or self._last_at is None:
            return False
        return abs(self._residual(fix, at)) > self._jump_limit(fix, at)

    def readmit(self) -> None:
        """Accept the present values of the source by order of the operator."""
        self.contradiction = None
        self._restart()

    def invalidate(self) -> None:
        """The axis is undefined at the position: later fixes are not compared with earlier ones."""
        self._last = self._last_at = self._pending = self._previous = None
        self._restart()
        self._lose_contradiction()

    # ----------------------------------------------------------------------------------------------------- tests

    def _evaluate(self, fix: AxisFix) -> list[PlausibilityFinding] | None:
        """Findings of a fix; None while it waits for a different one."""
        last, at, last_at = self._last, self.velocity.at(fix.t_ns), self._last_at
        self.is_closed = False
        step = self._resolution.step
        step_m = UNKNOWN_STEP_M if step is None else step * fix.metres
        fix.sigma.step = step_m
        if last is None:
            self._follow(fix, at)
            self._lose_contradiction()
            return []
        joined = at is not None and last_at is not None and at.segment == last_at.segment
        moved = self._moved_by_velocity(at)
        self._repetition.update(fix.t_ns, fix.value, moved, step_m, math.sqrt(self._white_of(fix)))
        if self._repetition.is_repeated:
            return [self._repetition_finding(fix)]
        if self._repetition.is_suspicious:
            return None
        self._resolution.update(fix.value)
        findings = self._compare(fix, at) if joined and at else self._bridge(fix, at)
        self._follow(fix, at)
        return findings

    def _moved_by_velocity(self, at: Integral | None) -> float:
        """Path by the stated velocity since the last evaluated fix [m]."""
        before = self._previous
        self._previous = at
        return at.path - before.path if at and before and at.segment == before.segment else 0.0

    def _repetition_finding(self, fix: AxisFix) -> PlausibilityFinding:
        run = self._repetition
        run_s = (fix.t_ns - run.since_ns) / SECOND_NS
        text = f"{self.name}: the same value for {run_s:.1f} s, in which its velocity makes {abs(run.moved):.1f} m"
        self._last_at = (
            None  # the next different value is compared with the first of the run by the limits of speed alone
        )
        self._restart()
        self._lose_contradiction()
        return PlausibilityFinding(Reason.REPEATED, run.since_ns, text)

    def _restart(self) -> None:
        self._history.clear()
        self._c = 0.0

    def _follow(self, fix: AxisFix, at: Integral | None) -> None:
        self._last, self._last_at = fix, at
        speed = abs(at.speed) + self._acceleration * MIN_STEP_NS / SECOND_NS if at else self._max_speed
        reach = speed * MIN_STEP_NS / SECOND_NS + K_JUMP * math.sqrt(2.0) * fix.sigma.position + fix.sigma.step
        self._max_change = reach / fix.metres
        if at is None:
            self._restart()

    def _lose_contradiction(self) -> None:
        """Stop tracking the contradiction at a gap: no step can end it any more."""
        if self.contradiction:
            self.contradiction.lose()

    def _difference(self, value: float, last: AxisFix) -> float:
        return wrap_half_turn(value - last.value) if self._is_angle else value - last.value

    def _displacement(self, fix: AxisFix) -> float:
        assert self._last is not None
        return self._difference(fix.value, self._last) * fix.metres

    def _residual(self, fix: AxisFix, at: Integral) -> float:
        assert self._last_at is not None
        return self._displacement(fix) - (at.path - self._last_at.path)

    # ----------------------------------------------------------------------------------------------- impossible, gap

    def _bridge(self, fix: AxisFix, at: Integral | None) -> list[PlausibilityFinding]:
        """Test fixes without a velocity in between against the speed limit of the aircraft."""
        assert self._last is not None
        self._restart()
        self._lose_contradiction()
        seconds = (fix.t_ns - self._last.t_ns) / SECOND_NS
        if seconds > MAX_BRIDGE_S:
            return []
        distance, sd = abs(self._displacement(fix)), math.hypot(fix.sigma.position, fix.sigma.step)
        limit = self._max_speed * seconds + K_FALSE * math.sqrt(2.0) * sd
        if distance <= limit:
            return []
        text = f"{self.name}: {distance:.0f} m in {seconds:.1f} s, at most {limit:.0f} m are possible"
        return [
            self._open_contradiction(
                PlausibilityFinding(Reason.IMPOSSIBLE, fix.t_ns, text, is_standing=True), None, fix.t_ns, 0.0
            )
        ]

    # -------------------------------------------------------------------------------------------------- jump, drift

    def _variance(self, fix: AxisFix, at: Integral, earlier: _EarlierFix) -> float:
        """Variance of c(fix) - c(earlier) [m^2].

        Where the stated sigma has changed, as when a receiver gets corrections, the slow error has changed, too.
        """
        speed = max(abs(at.speed), abs(earlier.speed))
        span = FixInterval(earlier.seconds, speed, at.speed - earlier.speed, earlier.path)
        larger, smaller = max(fix.sigma.position, earlier.sigma), min(fix.sigma.position, earlier.sigma)
        white = larger**2 if larger > MAX_SIGMA_RATIO * smaller else self._white_of(fix)
        sigma = fix.sigma if larger == fix.sigma.position else replace(fix.sigma, position=larger)
        return difference_variance(sigma, white, span)

    def _white_of(self, fix: AxisFix) -> float:
        full = fix.sigma.position**2
        return full if self._white is None else min(max(self._white, WHITE_SHARE * full), full)

    def _jump_limit(self, fix: AxisFix, at: Integral) -> float:
        assert self._last is not None
        assert self._last_at is not None
        seconds = (fix.t_ns - self._last.t_ns) / SECOND_NS
        path = abs(at.path - self._last_at.path)
        earlier = _EarlierFix(seconds, self._last_at.speed, path, self._last.sigma.position)
        sd = math.sqrt(self._variance(fix, at, earlier))
        between = min(seconds, self.velocity.interval_s)
        return K_JUMP * sd + self._acceleration * (between**2 / 8.0 + at.age_s**2 / 2.0)

    def _compare(self, fix: AxisFix, at: Integral) -> list[PlausibilityFinding]:
        residual, limit = self._residual(fix, at), self._jump_limit(fix, at)
        seconds = (fix.t_ns - self._last.t_ns) / SECOND_NS if self._last else 0.0
        if abs(residual) > limit:
            return self._step(fix, at, residual, limit)
        self._c += residual
        if self.contradiction and self.contradiction.offset is not None:
            self.contradiction.offset += residual
        self._learn_white(fix, residual, seconds)
        return self._look_back(fix, at)

    def _learn_white(self, fix: AxisFix, residual: float, seconds: float) -> None:
        if seconds > 2.0:
            return
        new = min(0.5 * residual**2, 4.0 * fix.sigma.position**2)
        before = fix.sigma.position**2 if self._white is None else self._white
        self._white = before + (new - before) / WHITE_FIXES

    def _step(self, fix: AxisFix, at: Integral, residual: float, limit: float) -> list[PlausibilityFinding]:
        contradiction = self.contradiction
        if contradiction and contradiction.offset is not None:
            before = contradiction.offset
            contradiction.offset += residual
            if self._is_cancelled(fix, at, contradiction, before):
                self.contradiction, self.is_closed = None, True
                self._restart()
                return []
        elif contradiction is None:
            contradiction = StandingContradiction(fix.t_ns, residual, at.path)
        self._restart()
        text = f"{self.name}: {residual:+.1f} m from the path of its velocity, limit {limit:.1f} m"
        finding = PlausibilityFinding(Reason.JUMP, fix.t_ns, text, is_standing=True)
        self.contradiction = contradiction
        return [finding]

    def _is_cancelled(self, fix: AxisFix, at: Integral, contradiction: StandingContradiction, before: float) -> bool:
        seconds = (fix.t_ns - contradiction.onset_ns) / SECOND_NS
        path = abs(at.path - contradiction.path)
        earlier = _EarlierFix(seconds, at.speed, path, fix.sigma.position)
        within = K_CLOSURE * math.sqrt(self._variance(fix, at, earlier))
        return contradiction.offset is not None and abs(contradiction.offset) <= within < abs(before) / 2.0

    def _open_contradiction(
        self, finding: PlausibilityFinding, offset: float | None, onset_ns: int, path: float
    ) -> PlausibilityFinding:
        if self.contradiction is None:
            self.contradiction = StandingContradiction(onset_ns, offset, path)
        return finding

    def _look_back(self, fix: AxisFix, at: Integral) -> list[PlausibilityFinding]:
        """Drift and scatter, once a second."""
        history = self._history
        if history and fix.t_ns - history[-1].t_ns < HISTORY_NS:
            return []
        if history and history[-1].segment != at.segment:
            history.clear()
        history.append(_AxisState(fix.t_ns, self._c, at.path, at.speed, fix.sigma.position, at.segment))
        self._history_count += 1
        findings = self._find_drift(fix, at)
        if not findings and self._history_count % SCATTER_PERIOD == 0:
            findings = self._find_scatter(fix)
        if findings:
            history.clear()
        return findings

    def _find_drift(self, fix: AxisFix, at: Integral) -> list[PlausibilityFinding]:
        self.is_suspected = False
        for past, acceleration in self._window_begins(fix.t_ns):
            seconds, drift = (fix.t_ns - past.t_ns) / SECOND_NS, self._c - past.c
            earlier = _EarlierFix(seconds, past.speed, abs(at.path - past.path), past.sigma)
            sd = math.sqrt(self._variance(fix, at, earlier))
            allowance = acceleration * self.velocity.interval_s**2 / 6.0
            self.is_suspected = self.is_suspected or abs(drift) > 0.5 * K_FALSE * sd + allowance
            if abs(drift) > K_FALSE * sd + allowance:
                text = f"{self.name}: {drift:+.1f} m in {seconds:.0f} s from the path of its velocity, "
                text += f"limit {K_FALSE * sd + allowance:.1f} m"
                finding = PlausibilityFinding(Reason.DRIFT, past.t_ns, text, is_standing=True)
                return [self._open_contradiction(finding, drift, past.t_ns, past.path)]
        return []

    def _window_begins(self, t_ns: int) -> Iterator[tuple[_AxisState, float]]:
        """For each window in the history its newest old enough entry, and the acceleration since then.

        It is the largest change of the velocity from entry to entry, at most the limit of the aircraft [m/s^2].
        """
        begins_ns = [t_ns - window * SECOND_NS for window in reversed(WINDOWS_S)]
        change, speed = 0.0, self._history[-1].speed if self._history else 0.0
        for past in reversed(self._history):
            change, speed = max(change, abs(past.speed - speed)), past.speed
            while begins_ns and past.t_ns <= begins_ns[-1]:
                begins_ns.pop()
                yield past, min(change, self._acceleration)
            if not begins_ns:
                return

    def _find_scatter(self, fix: AxisFix) -> list[PlausibilityFinding]:
        history, sigma = list(self._history)[-SCATTER_ENTRIES:], fix.sigma
        if len(history) < scatter.MIN_VALUES:
            return []
        span = (history[-1].t_ns - history[0].t_ns) / SECOND_NS
        speed = max(abs(past.speed) for past in history)
        turn = max(past.speed for past in history) - min(past.speed for past in history)
        expected = max(past.sigma for past in history) ** 2 + sigma.step**2 / 12.0 + (speed * sigma.time) ** 2
        expected += sigma.velocity**2 * 2.0 * VELOCITY_TAU_S * span / 6.0 + (sigma.velocity_step * span) ** 2 / 144.0
        expected += (0.1 * turn) ** 2 + (sigma.arm / 3.0) ** 2 + (1e-4 * speed * span) ** 2 / 12.0
        beyond = scatter.excess([past.c for past in history], expected)
        if beyond is None:
            return []
        text = f"{self.name}: its variance is {beyond[0]:.1f} times that of its stated sigma, limit {beyond[1]:.1f}"
        return [PlausibilityFinding(Reason.SCATTER, history[0].t_ns, text)]
