"""Alarm conditions from outputs: faults of heights, integrity, position, attitude and sources.

A subject is reported when its condition changes.  An output that does not show whether a condition has ended reports
nothing: a restart of navigation ends no condition, and a value that was never valid is never reported as lost.
Source: docs/alarms.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from msgspec.structs import replace

from fti.alarms.condition import Condition, ConditionReport, Severity, device_id, in_title
from fti.config import Config, position_sources
from fti.constants import SECOND_NS
from fti.messages.outputs import (
    ClearanceIntegrity,
    Event,
    FilterSolution,
    GlideSlope,
    GroundDrift,
    HeightAboveGround,
    HeightBelowAircraft,
    IntegrityState,
    NavSolution,
    Output,
    SourceValidity,
)
from fti.messages.reasons import Reason
from fti.reason_texts import describe_reasons

#: Altimeter outside its range; no alarm, except on an approach.
OUT_OF_RANGE = frozenset({Reason.ABOVE_RANGE, Reason.BELOW_RANGE, Reason.NO_RETURN, Reason.ROLL, Reason.PITCH})
#: Faults of an altimeter itself.
ALTIMETER_FAULTS = frozenset(
    {
        Reason.DEVICE_FLAG,
        Reason.STUCK,
        Reason.CHANGE_MISMATCH,
        Reason.ALTIMETERS_DISAGREE,
        Reason.DEVIATION,
        Reason.EXCLUDED,
    }
)
#: Minimum duration of a fault of an altimeter: a single deviating sample is not one.
ALTIMETER_FAULT_NS = SECOND_NS // 2
#: A silent device has an alarm of its own, and is not reported as a refused source.
SILENCE = frozenset({Reason.STALE, Reason.SILENT})
#: Regular ends of an approach.
EXPECTED_END = frozenset({Reason.END, Reason.GO_AROUND, Reason.NO_PROFILE})
#: The aircraft is not on an approach.
NO_APPROACH = EXPECTED_END | {Reason.OUTSIDE_PROFILE, Reason.OFF_TRACK}
#: States in which the monitor tests the clearance.
MONITORING_STATES = frozenset({IntegrityState.MONITOR, IntegrityState.OK, IntegrityState.CAUTION, IntegrityState.ALERT})
#: Fallback sources of position, attitude or altitude.
FALLBACKS = {"filter": "FILTER", "radio": "RADIO", "vertical": "VERTICAL CHANNEL"}
#: Minimum time between reports if only the value of a condition changes.
VALUE_NS = SECOND_NS
INTEGRITY_IDS = ("integrity_alert", "integrity_caution", "integrity_unavailable")


class OutputConditions:
    """Evaluates the outputs of navigation in order."""

    def __init__(self, config: Config) -> None:
        nav = config.nav
        self._first_position = nav.position[0] if nav.position else None
        self._explained = {
            "position": tuple(device_id(name) for name in position_sources(nav)),
            "attitude": tuple(device_id(name) for name in nav.attitude),
            "height": tuple(known for name in nav.altimeters for known in (f"altimeter:{name}", device_id(name))),
        }
        roles = {"position": position_sources(nav), "attitude": nav.attitude, "height": nav.altimeters}
        self._lost_by = {
            role: (*self._explained[role], *(f"source:{name}" for name in names)) for role, names in roles.items()
        }
        self._handlers: dict[type, Callable[[Any], None]] = {
            ClearanceIntegrity: self._feed_integrity,
            GlideSlope: self._feed_glide_slope,
            HeightAboveGround: self._feed_altimeter,
            HeightBelowAircraft: self._feed_height,
            NavSolution: self._feed_solution,
            FilterSolution: self._feed_filter,
            GroundDrift: self._feed_drift,
            SourceValidity: self._feed_source,
        }
        self._was_valid: set[str] = set()  # subjects that were valid before
        self._is_on_approach: bool | None = None if nav.approach else False  # None: not known yet
        self._is_over = False
        self._altimeters: dict[str, frozenset[Reason]] = {name: frozenset() for name in nav.altimeters}
        self._fault_since_ns: dict[str, int] = {}
        self._tested: dict[str, SourceValidity] = {}
        self._excluded: frozenset[str] = frozenset()
        self._reported: dict[str, ConditionReport] = {}
        self._reports: list[ConditionReport] = []

    def feed(self, outputs: Iterable[Output | Event]) -> list[ConditionReport]:
        """Conditions that these outputs change."""
        for output in outputs:
            if handler := self._handlers.get(type(output)):
                handler(output)
        reports, self._reports = self._reports, []
        return reports

    @staticmethod
    def report_terrain(t_ns: int, fault: str | None) -> ConditionReport:
        """The condition of the terrain.  fault : why it cannot be loaded, None: it is loaded"""
        cause = f"{fault}; heights are not compared with it"
        condition = Condition("terrain", Severity.CAUTION, "NO TERRAIN", cause) if fault else None
        return ConditionReport(t_ns, "terrain", condition)

    def end_all(self, t_ns: int) -> list[ConditionReport]:
        """Navigation restarts: end all conditions except that of the terrain, which follows from no output."""
        return [ConditionReport(t_ns, subject, None) for subject, report in self._reported.items() if report.condition]

    # ---------------------------------------------------------------------------------------------------------- outputs

    def _feed_integrity(self, output: ClearanceIntegrity) -> None:
        state, reasons = output.state, frozenset(output.reasons)
        self._follow_approach(state, reasons)
        cause = _describe(output.reasons)
        if state is IntegrityState.ALERT:
            condition = Condition("integrity_alert", Severity.WARNING, "GROUND CLEARANCE ALERT", cause)
        elif state is IntegrityState.CAUTION:
            condition = Condition("integrity_caution", Severity.CAUTION, "GROUND CLEARANCE CAUTION", cause)
        elif state is IntegrityState.UNAVAILABLE and "integrity" in self._was_valid and not self._is_over:
            condition = Condition(
                "integrity_unavailable",
                Severity.CAUTION,
                "GROUND CLEARANCE NOT MONITORED",
                cause,
                explained_by=("height", "position", *self._explained["height"], *self._explained["position"]),
            )
        else:
            self._clear_integrity(output)
            return
        self._was_valid.add("integrity")
        self._report("integrity", output.t_ns, condition)

    def _follow_approach(self, state: IntegrityState, reasons: frozenset[Reason]) -> None:
        """Update the approach state; a monitor that lacks a height or a position does not end an approach."""
        self._is_over = bool(reasons & EXPECTED_END) or state is IntegrityState.NO_PROFILE
        if state in MONITORING_STATES or state is IntegrityState.ACQUIRE:
            self._is_on_approach = True
        elif self._is_over or reasons & NO_APPROACH:
            self._is_on_approach = False

    def _clear_integrity(self, output: ClearanceIntegrity) -> None:
        """Clear the condition if the monitor tests, or the approach is over; not while it collects its window."""
        if output.state is IntegrityState.OK:
            self._was_valid.add("integrity")
        elif self._is_over:
            self._was_valid.discard("integrity")
        if self._is_over or output.state in MONITORING_STATES:
            self._report("integrity", output.t_ns, None)

    def _feed_glide_slope(self, output: GlideSlope) -> None:
        if output.valid:
            self._was_valid.add("glide slope")
            self._report("glide slope", output.t_ns, None)
        elif self._is_over or self._is_on_approach is False or Reason.BELOW_150_M in output.reasons:
            self._was_valid.discard("glide slope")
            self._report("glide slope", output.t_ns, None)
        elif "glide slope" in self._was_valid:
            causes = (*INTEGRITY_IDS, "height", "position")
            cause = _describe(output.reasons)
            flag = Condition("glide_slope", Severity.CAUTION, "GLIDE SLOPE FLAGGED", cause, explained_by=causes)
            self._report("glide slope", output.t_ns, flag)

    def _feed_altimeter(self, output: HeightAboveGround) -> None:
        name, reasons = output.sensor, frozenset(output.reasons)
        self._altimeters[name] = reasons
        if Reason.STALE in reasons:  # its last height was tested when it came; silence is another alarm
            if output.t_ns - self._fault_since_ns.get(name, output.t_ns) >= ALTIMETER_FAULT_NS:
                del self._fault_since_ns[name]  # after a silence its heights are tested again
            return
        faults = [reason for reason in output.reasons if reason in ALTIMETER_FAULTS]
        if not faults or reasons & OUT_OF_RANGE:
            self._fault_since_ns.pop(name, None)
            if output.valid:
                self._report(f"altimeter {name}", output.t_ns, None)
        elif output.t_ns - self._fault_since_ns.setdefault(name, output.t_ns) >= ALTIMETER_FAULT_NS:
            title = f"HEIGHT OF {in_title(name)} REFUSED"
            condition = Condition(f"altimeter:{name}", Severity.CAUTION, title, _describe(faults))
            self._report(f"altimeter {name}", output.t_ns, condition)

    def _feed_height(self, output: HeightBelowAircraft) -> None:
        is_far = all(map(OUT_OF_RANGE.intersection, self._altimeters.values()))
        if output.valid or (is_far and self._is_on_approach is False):
            self._was_valid |= {"height"} if output.valid else set()
            self._report("height", output.t_ns, None)
        elif "height" in self._was_valid and not (is_far and self._is_on_approach is None):
            reasons = sorted({reason for reasons_of in self._altimeters.values() for reason in reasons_of})
            self._report_loss("height", "HEIGHT NOT VALID", output.t_ns, reasons or output.reasons)

    def _feed_solution(self, output: NavSolution) -> None:
        if not (reasons := _reasons_of_position(output)):
            self._was_valid.add("position")
            self._report("position", output.t_ns, None)
        elif "position" in self._was_valid:
            self._report_loss("position", "POSITION NOT VALID", output.t_ns, reasons)
        if "position" in self._was_valid:
            self._check_position_source(output)
        if output.attitude_valid:
            self._was_valid.add("attitude")
            self._report("attitude", output.t_ns, _by_fallback("attitude", output.attitude_source, None))
        elif "attitude" in self._was_valid:
            self._report_loss("attitude", "ATTITUDE NOT VALID", output.t_ns, output.attitude_reasons)
        if output.altitude_source is not None:
            own = None if output.altitude_source == output.position_source else output.altitude_source
            self._report("altitude", output.t_ns, _by_fallback("altitude", own, output.vertical_sd))
        for name in sorted(self._excluded.symmetric_difference(output.refused)):
            self._excluded ^= {name}
            self._check_source(name, output.t_ns)
        if output.position_source is not None:
            self._check_comparison(output.t_ns, is_short=Reason.REACQUIRED in output.unchecked)

    def _check_comparison(self, t_ns: int, *, is_short: bool) -> None:
        """Report short comparison times of sources; they are expected until the first one was long enough."""
        if not is_short:
            self._was_valid |= {"comparison"} if "short comparison" in self._was_valid else set()
            self._report("comparison", t_ns, None)
        elif "comparison" in self._was_valid:
            cause = _describe((Reason.REACQUIRED,))
            self._report("comparison", t_ns, Condition("reacquired", Severity.ADVISORY, "SOURCES REACQUIRED", cause))
        else:
            self._was_valid.add("short comparison")

    def _check_position_source(self, output: NavSolution) -> None:
        """Report that another device gives the position, if the first one has given it before."""
        source, first = output.position_source, self._first_position
        if source == first or source is None:
            self._was_valid |= {"first position"} if source else set()
            self._report("position source", output.t_ns, None)
        elif source in FALLBACKS:
            condition = _by_fallback("position", source, output.horizontal_sd)
            self._report("position source", output.t_ns, condition)
        elif "first position" in self._was_valid:
            title, cause = f"POSITION BY {in_title(source)}", f"{first} is not used"
            causes = (f"source:{first}", "position")
            condition = Condition(f"position_by:{source}", Severity.ADVISORY, title, cause, explained_by=causes)
            self._report("position source", output.t_ns, condition)

    def _feed_filter(self, output: FilterSolution) -> None:
        is_unresolved = Reason.CONTRADICTION in output.reasons
        cause = "none of them is known to be right; the protection levels contain all"
        condition = Condition("contradiction", Severity.CAUTION, "SOURCES CONTRADICT EACH OTHER", cause)
        self._report("contradiction", output.t_ns, condition if is_unresolved else None)

    def _feed_drift(self, output: GroundDrift) -> None:
        """The contradiction ends with a calibration; a pair that cannot be compared does not end it."""
        if output.valid:
            self._report("ground drift", output.t_ns, None)
        elif Reason.CONTRADICTION in output.reasons:
            cause = "it contradicts the filter; it does not aid until it is calibrated"
            condition = Condition("ground_drift", Severity.CAUTION, "DRIFT OVER GROUND REFUSED", cause)
            self._report("ground drift", output.t_ns, condition)

    def _feed_source(self, output: SourceValidity) -> None:
        self._tested[output.source] = output
        self._check_source(output.source, output.t_ns)

    def _check_source(self, name: str, t_ns: int) -> None:
        """Report the tests of the source itself, and its exclusion because it contradicts others."""
        tested = self._tested.get(name)
        reasons = [reason for reason in tested.reasons if reason not in SILENCE] if tested else []
        cause = "; ".join(filter(None, (_describe(reasons), tested.readmission if tested else "")))
        if name in self._excluded:
            cause = "; ".join(filter(None, (_describe(reasons), "it contradicts the other sources")))
        if reasons or name in self._excluded:
            title = f"SOURCE {in_title(name)} REFUSED"
            self._report(f"source {name}", t_ns, Condition(f"source:{name}", Severity.CAUTION, title, cause))
        elif tested is None or tested.valid:
            self._report(f"source {name}", t_ns, None)

    # ---------------------------------------------------------------------------------------------------------- reports

    def _report_loss(self, role: str, title: str, t_ns: int, reasons: Iterable[Reason]) -> None:
        """Report that a valid value is lost; on an approach immediate action is needed."""
        is_grave = self._is_on_approach and role != "attitude"
        severity = Severity.WARNING if is_grave else Severity.CAUTION
        self._report(role, t_ns, Condition(role, severity, title, _describe(reasons), explained_by=self._lost_by[role]))

    def _report(self, subject: str, t_ns: int, condition: Condition | None) -> None:
        report, last = ConditionReport(t_ns, subject, condition), self._reported.get(subject)
        if last is not None and _is_same(last, report):
            return
        self._reported[subject] = report
        self._reports.append(report)


def _reasons_of_position(output: NavSolution) -> list[Reason]:
    """Reasons of the position only; the attitude has an alarm of its own, ``unchecked`` belongs to the position."""
    of_attitude = set(output.attitude_reasons).difference(output.unchecked)
    return [reason for reason in output.reasons if reason not in of_attitude]


def _by_fallback(role: str, source: str | None, sd: float | None) -> Condition | None:
    """The condition that no device gives a quantity; its value is one sigma."""
    if source not in FALLBACKS:
        return None
    title = f"{role.upper()} BY {FALLBACKS[source]}"
    cause = "no device gives it"
    return Condition(f"{role}_by:{source}", Severity.CAUTION, title, cause, sd, explained_by=(role,))


def _describe(reasons: Iterable[Reason]) -> str:
    return ", ".join(describe_reasons(list(reasons)))


def _is_same(last: ConditionReport, report: ConditionReport) -> bool:
    """Whether nothing has changed, or only the value within ``VALUE_NS``."""
    if last.condition is None or report.condition is None:
        return last.condition is report.condition
    if report.t_ns - last.t_ns < VALUE_NS:
        return last.condition == replace(report.condition, value=last.condition.value)
    return last.condition == report.condition
