"""The ground-clearance integrity monitor: compares the ground below with the reference of the published approach.

Each altimeter sample adds the measured terrain, z = alt - agl, to the window.  Each update (after 10 m and 0.2 s, the
later of the two) compares the window with the reference and runs the alarm logic.  The height is the raw one moved to
P, never compensated for terrain.

    UNAVAILABLE   the inputs are not usable (no usable sample for 0.2 s), less than 80 % of the bins are filled, the
                  aircraft moved less than 10 m within 2 s, so that nothing new was evaluated, the vertical protection
                  level is above its alert limit, navigation does not keep the position within AL_y, or its sigma
                  exceeds the assumed one; an ALERT is still given
    ACQUIRE       the window is not yet full.  Past the intercept point, outside the profile, after a go-around and
                  after s grew by more than 20 m the monitor restarts in this state.
    others        see fti.nav.integrity.alarm_logic; these are evaluated, and ``valid`` (an ALERT too)

Source: Spiegel 2018, 7.2.2, made unambiguous; the alarm limits come with the reference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from msgspec import Struct, structs

from fti.config import Approach
from fti.messages.outputs import ClearanceIntegrity, IntegrityState
from fti.messages.reasons import Reason
from fti.nav.integrity.alarm_logic import AlarmLogic, Ratios
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.assumptions import navigation_holds
from fti.nav.integrity.go_around import GO_AROUND_CLIMB, GoAround
from fti.nav.integrity.protection import ClearanceProtection, ProtectionCalculator
from fti.nav.integrity.reference import ApproachReference
from fti.nav.integrity.statistics import Matcher, Statistics
from fti.nav.integrity.window import Bins, ClearanceSeries, ClearanceWindow, has_gaps, interpolate

UPDATE_NS = 200_000_000
UPDATE_M = 10.0
REPEAT_NS = 500_000_000
HOLD_NS = UPDATE_NS
#: Maximum age of an evaluated window [ns]: 10 m at 5 m/s.
UPDATE_TIMEOUT_NS = 2_000_000_000
#: The margin over sqrt(t2) that makes a shift of AL_s visible with 95 %: O >= (sqrt(t2) + 1.64)^2.
OBSERVABLE_MARGIN = 1.64


class ClearanceSample(Struct, frozen=True, gc=False):
    """One altimeter sample with navigation at its validity time.

    agl : raw height above ground moved to P [m]      alt : altitude of P above the ellipsoid [m], vertical_sd its sigma
    s, y : path length and offset [m], horizontal_sd their sigma; None: unknown, which exceeds any limit
    hpl : protection level of the position [m]; None: unknown
    climb : [m/s], None when unknown      roll : beyond the bank of the track there, pitch : [rad]
    """

    t_ns: int
    t_valid_ns: int
    s: float
    y: float
    alt: float
    agl: float
    roll: float
    pitch: float
    climb: float | None
    vertical_sd: float | None
    horizontal_sd: float | None = None
    hpl: float | None = None


#: Output fields of a window that was not matched.
NO_STATISTICS: Mapping[str, float | None] = MappingProxyType({})

Rule = Callable[[ClearanceSample, Approach], bool]

#: Reasons to discard a sample.  A rule is True when the sample violates it; NaN violates every rule.
RULES: tuple[tuple[Reason, Rule], ...] = (
    (Reason.NO_POSITION, lambda x, _: not math.isfinite(x.s + x.alt)),
    (Reason.NO_RETURN, lambda x, _: not math.isfinite(x.agl)),
    (Reason.OFF_TRACK, lambda x, a: not abs(x.y) <= a.y_max_m),
    (Reason.ROLL, lambda x, a: not abs(x.roll) <= math.radians(a.max_roll_deg)),
    (Reason.PITCH, lambda x, a: not abs(x.pitch) <= math.radians(a.max_pitch_deg)),
)


class ClearanceMonitor:
    """The monitor of one approach."""

    def __init__(self, reference: ApproachReference, settings: Approach) -> None:
        self.reference = reference
        self.path = ApproachPath(reference.header.airfield)
        self.bins: Bins | None = None  # of the last update
        self.statistics: Statistics | None = None  # of the last evaluated update
        self._settings = settings
        self._limits = reference.header.limits
        self._observable = (math.sqrt(self._limits.t2) + OBSERVABLE_MARGIN) ** 2
        self._window = ClearanceWindow(reference)
        self._matcher = Matcher(reference, settings.alert_s_m)
        self._assumed = reference.header.assumptions
        self._protector = ProtectionCalculator(self._limits, settings)
        self.agl_ref = self.path.alt_path(reference.s) - reference.z_ref
        self.bounds = np.array(
            [
                reference.header.profile.s_max_m,
                settings.y_max_m,
                math.radians(settings.max_roll_deg),
                math.radians(settings.max_pitch_deg),
                GO_AROUND_CLIMB,
                UPDATE_M,
                UPDATE_NS,
            ]
        )
        self._s0, self._ds = float(reference.s[0]), reference.header.profile.ds_m
        self._hash = reference.hash
        self._go_around = GoAround()
        self._last: ClearanceIntegrity | None = None
        self._used_ns: int | None = None
        self._evaluated_ns = 0
        self.restart()

    def restart(self) -> None:
        """Begin with an empty window, as after a change of the source of the height."""
        self._window.clear()
        self._logic = AlarmLogic(self._window.length)
        self._updated: tuple[int, float] | None = None

    # ------------------------------------------------------------------------------------------------- stepping

    def step(self, x: ClearanceSample) -> ClearanceIntegrity | None:
        """Add a sample; returns a new output, if any."""
        outside = self._exit_reason(x)
        if outside:
            self.restart()
            return self._emit(self._unavailable(x.t_ns, x.t_valid_ns, (outside,)))
        reasons = tuple(reason for reason, broken in RULES if broken(x, self._settings))
        if Reason.NO_POSITION not in reasons:
            self.follow(x.s)
        if reasons:
            return self.refuse(x.t_ns, x.t_valid_ns, reasons)
        self._used_ns = x.t_ns
        self._collect(x)
        if not self._is_due(x):
            return None
        self._updated = (x.t_valid_ns, x.s)
        self._evaluated_ns = x.t_ns
        return self._emit(self._evaluate(x), always=True)

    def skip(self, track: ClearanceSeries, begin: int) -> int:
        """Add samples from ``begin`` on as long as each only enters the window and no output is due.

        Returns the index of the first sample for ``step``.  The outputs are those of ``step`` alone; this is faster.
        """
        if self._updated is None or self._go_around.active:
            return begin
        end = self._window.add_samples(track, begin, self.bounds, self._updated, self.agl_ref)
        if end > begin:
            self._used_ns = int(track.t_ns[end - 1])
            self._go_around.step(self._used_ns, None)
        return end

    def follow(self, s: float) -> None:
        """Track the position, also without a usable sample; restart after a retreat of more than 20 m."""
        if self._window.goes_backward(s):
            self.restart()

    def _collect(self, x: ClearanceSample) -> None:
        self._window.add(x.s, x.alt - x.agl, x.agl - interpolate(self.agl_ref, (x.s - self._s0) / self._ds))

    def refuse(self, t_ns: int, t_valid_ns: int | None, reasons: tuple[Reason, ...]) -> ClearanceIntegrity | None:
        """Report that there is no usable sample.

        The output comes after 0.2 s without one (at once when the altimeter is stale: its age limit has passed
        already), at every change, and twice a second.
        """
        held = self._used_ns is not None and t_ns - self._used_ns < HOLD_NS
        if held and Reason.STALE not in reasons:
            return None
        return self._emit(self._unavailable(t_ns, t_valid_ns, reasons))

    def tick(self, t_ns: int) -> ClearanceIntegrity | None:
        """Repeat the last output when it is half a second old; a window without new samples becomes stale.

        There is no update within 10 m: otherwise a frozen position with new timestamps would stay valid.
        """
        if self._last is None:
            return None
        if self._last.state is not IntegrityState.UNAVAILABLE and t_ns - self._evaluated_ns >= UPDATE_TIMEOUT_NS:
            return self._emit(self._unavailable(t_ns, self._last.t_valid_ns, (Reason.STALE,)))
        if t_ns - self._last.t_ns < REPEAT_NS:
            return None
        self._last = structs.replace(self._last, t_ns=t_ns)
        return self._last

    def _exit_reason(self, x: ClearanceSample) -> Reason | None:
        going_around = self._go_around.step(x.t_valid_ns, x.climb)
        if x.s < 0.0:
            return Reason.END
        if x.s > self.reference.header.profile.s_max_m:
            return Reason.OUTSIDE_PROFILE
        return Reason.GO_AROUND if going_around else None

    def _is_due(self, x: ClearanceSample) -> bool:
        if self._updated is None:
            return True
        t_ns, s = self._updated
        return x.t_valid_ns - t_ns >= UPDATE_NS and abs(s - x.s) >= UPDATE_M

    # -------------------------------------------------------------------------------------------------- tests

    def _evaluate(self, x: ClearanceSample) -> ClearanceIntegrity:
        self.bins = self._window.bins(x.s)
        if not self._window.is_full(x.s):
            return self._make_output(x, IntegrityState.ACQUIRE, (), NO_STATISTICS)
        if has_gaps(self.bins):
            self._logic.skip()
            return self._make_output(x, IntegrityState.UNAVAILABLE, (Reason.GAPS,), NO_STATISTICS)
        statistics = self._matcher.evaluate(self.bins, x.vertical_sd)
        self.statistics = statistics
        protection = self._protector.compute(statistics, x.s, x.horizontal_sd, x.hpl)
        ratios = self._ratios(statistics, protection)
        state, reasons = self._logic.step(ratios, x.s)
        unavailable_reasons = protection.unavailable_reasons
        if not navigation_holds(self._assumed, x.vertical_sd, x.horizontal_sd):
            unavailable_reasons = (*unavailable_reasons, Reason.ASSUMPTION)
        if state is not IntegrityState.ALERT and unavailable_reasons:
            state, reasons = IntegrityState.UNAVAILABLE, (*unavailable_reasons, *reasons)
        return self._make_output(x, state, reasons, _output_fields(statistics, ratios, protection))

    def _ratios(self, statistics: Statistics, protection: ClearanceProtection) -> Ratios:
        """Statistics over their limits.  A shift of AL_s must be observable at AL_s itself (O) and by the curvature."""
        limits = self._limits
        observable = statistics.observability >= self._observable and protection.detects_shift
        t2 = statistics.t2 / limits.t2 if observable else None
        return Ratios(statistics.t1 / limits.t1, t2, statistics.t3 / limits.t3, statistics.t4 / limits.t4)

    # ---------------------------------------------------------------------------------------------------- output

    def _make_output(
        self, x: ClearanceSample, state: IntegrityState, reasons: tuple[Reason, ...], fields: Mapping[str, float | None]
    ) -> ClearanceIntegrity:
        return ClearanceIntegrity(
            t_ns=x.t_ns,
            t_valid_ns=x.t_valid_ns,
            state=state,
            reasons=reasons,
            valid=bool(fields) and state is not IntegrityState.UNAVAILABLE,
            s_begin=x.s + self._window.length,
            s_end=x.s,
            alert_limit_v=self._protector.limit_v(x.s),
            alert_limit_s=self._settings.alert_s_m,
            reference=self._hash,
            **fields,
        )

    def _unavailable(self, t_ns: int, t_valid_ns: int | None, reasons: tuple[Reason, ...]) -> ClearanceIntegrity:
        self.bins = None
        return ClearanceIntegrity(
            t_ns=t_ns,
            t_valid_ns=t_valid_ns,
            state=IntegrityState.UNAVAILABLE,
            reasons=reasons,
            valid=False,
            reference=self._hash,
        )

    def _emit(self, new: ClearanceIntegrity, always: bool = False) -> ClearanceIntegrity | None:
        """The output, unless an equal one is less than half a second old."""
        last = self._last
        same = last is not None and (last.state, last.reasons) == (new.state, new.reasons)
        if same and not always and last is not None and new.t_ns - last.t_ns < REPEAT_NS:
            return None
        self._last = new
        return new


def _output_fields(statistics: Statistics, ratios: Ratios, protection: ClearanceProtection) -> dict[str, float | None]:
    """Output fields of a matched window."""
    return {
        "t1_ratio": ratios.t1,
        "t2_ratio": ratios.t2,
        "t3_ratio": ratios.t3,
        "t4_ratio": ratios.t4,
        "shift": statistics.shift,
        "shift_sd": statistics.shift_sd,
        "height_error": statistics.height_error,
        "height_error_sd": statistics.height_error_sd,
        "observability": statistics.observability,
        "protection_level_v": protection.level_v,
        "protection_level_s": protection.level_s if math.isfinite(protection.level_s) else None,
    }
