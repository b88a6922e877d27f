"""Conditions that follow from outputs: what is wrong with heights, integrity, position, attitude and sources.

A subject is reported when what is wrong with it has changed.  An output that cannot tell whether a condition has ended
reports nothing: so none ends because navigation was started again, and what was never valid was never lost.
Source: docs/alarms.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from fti.alarms.condition import Condition, ConditionReport, Severity, device_id, in_title
from fti.config import Config, position_sources
from fti.nav.time_series import SECOND_NS
from fti.reason_texts import describe_reasons
from fti.types import (
    ClearanceIntegrity,
    Event,
    FilterSolution,
    GlideSlope,
    HeightAboveGround,
    HeightBelowAircraft,
    IntegrityState,
    NavSolution,
    Output,
    Reason,
    SourceValidity,
)

#: Altimeters that are outside their range say so; on an approach that is an alarm all the same.
OUT_OF_RANGE = frozenset({Reason.ABOVE_RANGE, Reason.BELOW_RANGE, Reason.NO_RETURN, Reason.ROLL, Reason.PITCH})
#: What is wrong with an altimeter itself.
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
#: A single sample that deviates is no failure of its altimeter.
ALTIMETER_FAULT_NS = SECOND_NS // 2
#: A device that is silent is reported as such, and not as a source that contradicts others.
SILENCE = frozenset({Reason.STALE, Reason.SILENT})
#: An approach ends like this.
EXPECTED_END = frozenset({Reason.END, Reason.GO_AROUND, Reason.NO_PROFILE})
#: There is none.
NO_APPROACH = EXPECTED_END | {Reason.OUTSIDE_PROFILE, Reason.OFF_TRACK}
#: The monitor judges.
MONITORING_STATES = frozenset({IntegrityState.MONITOR, IntegrityState.OK, IntegrityState.CAUTION, IntegrityState.ALERT})
#: What gives a position, an attitude or an altitude where no device does.
FALLBACKS = {"filter": "FILTER", "radio": "RADIO", "vertical": "VERTICAL CHANNEL"}
#: A condition of which only the value changes is reported so often.
VALUE_NS = SECOND_NS
INTEGRITY_IDS = ("integrity_alert", "integrity_caution", "integrity_unavailable")


class OutputConditions:
    """Looks at the outputs of navigation in order."""

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
            SourceValidity: self._feed_source,
        }
        self._was_valid: set[str] = set()  # what was valid before
        self._is_on_approach: bool | None = None if nav.approach else False  # None: not known yet
        self._is_over = False
        self._altimeters: dict[str, frozenset[Reason]] = {name: frozenset() for name in nav.altimeters}
        self._fault_since_ns: dict[str, int] = {}
        self._tested: dict[str, SourceValidity] = {}
        self._excluded: frozenset[str] = frozenset()
        self._reported: dict[str, ConditionReport] = {}
        self._found: list[ConditionReport] = []

    def take(self, outputs: Iterable[Output | Event]) -> list[ConditionReport]:
        """What is another condition now than before these outputs."""
        for output in outputs:
            if handler := self._handlers.get(type(output)):
                handler(output)
        found, self._found = self._found, []
        return found

    @staticmethod
    def report_terrain(t_ns: int, fault: str | None) -> ConditionReport:
        """The terrain is known from now on, or ``fault`` says why it never will be."""
        cause = f"{fault}; heights are not compared with it"
        condition = Condition("terrain", Severity.CAUTION, "NO TERRAIN", cause) if fault else None
        return ConditionReport(t_ns, "terrain", condition)

    def end_all(self, t_ns: int) -> list[ConditionReport]:
        """Navigation begins anew: nothing that was before counts, but the terrain, which no output tells of."""
        return [ConditionReport(t_ns, subject, None) for subject, report in self._reported.items() if report.condition]

    # ------------------------------------------------------------------------------------------------- each output

    def _feed_integrity(self, output: ClearanceIntegrity) -> None:
        state, reasons = output.state, frozenset(output.reasons)
        self._follow_approach(state, reasons)
        cause = _describe(output.reasons)
        if state is IntegrityState.ALERT:
            found = Condition("integrity_alert", Severity.WARNING, "GROUND CLEARANCE ALERT", cause)
        elif state is IntegrityState.CAUTION:
            found = Condition("integrity_caution", Severity.CAUTION, "GROUND CLEARANCE CAUTION", cause)
        elif state is IntegrityState.UNAVAILABLE and "integrity" in self._was_valid and not self._is_over:
            found = Condition(
                "integrity_unavailable",
                Severity.CAUTION,
                "GROUND CLEARANCE NOT MONITORED",
                cause,
                explained_by=("height", "position", *self._explained["height"], *self._explained["position"]),
            )
        else:
            self._note_integrity(output)
            return
        self._was_valid.add("integrity")
        self._report("integrity", output.t_ns, found)

    def _follow_approach(self, state: IntegrityState, reasons: frozenset[Reason]) -> None:
        """A monitor that cannot judge, because a height or a position is lost, does not end an approach."""
        self._is_over = bool(reasons & EXPECTED_END) or state is IntegrityState.NO_PROFILE
        if state in MONITORING_STATES or state is IntegrityState.ACQUIRE:
            self._is_on_approach = True
        elif self._is_over or reasons & NO_APPROACH:
            self._is_on_approach = False

    def _note_integrity(self, output: ClearanceIntegrity) -> None:
        """Nothing is wrong where the monitor judges, or the approach is over; not while it collects its window."""
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
        if Reason.STALE in reasons:  # its last height was judged when it came; that it is silent is another alarm
            if output.t_ns - self._fault_since_ns.get(name, output.t_ns) >= ALTIMETER_FAULT_NS:
                del self._fault_since_ns[name]  # after a silence its heights are judged anew
            return
        faults = [reason for reason in output.reasons if reason in ALTIMETER_FAULTS]
        if not faults or reasons & OUT_OF_RANGE:
            self._fault_since_ns.pop(name, None)
            if output.valid:
                self._report(f"altimeter {name}", output.t_ns, None)
        elif output.t_ns - self._fault_since_ns.setdefault(name, output.t_ns) >= ALTIMETER_FAULT_NS:
            title = f"HEIGHT OF {in_title(name)} REFUSED"
            found = Condition(f"altimeter:{name}", Severity.CAUTION, title, _describe(faults))
            self._report(f"altimeter {name}", output.t_ns, found)

    def _feed_height(self, output: HeightBelowAircraft) -> None:
        is_far = all(map(OUT_OF_RANGE.intersection, self._altimeters.values()))
        if output.valid or (is_far and self._is_on_approach is False):
            self._was_valid |= {"height"} if output.valid else set()
            self._report("height", output.t_ns, None)
        elif "height" in self._was_valid and not (is_far and self._is_on_approach is None):
            reasons = sorted({reason for found in self._altimeters.values() for reason in found})
            self._report_loss("height", "HEIGHT NOT VALID", output.t_ns, reasons or output.reasons)

    def _feed_solution(self, output: NavSolution) -> None:
        if not (reasons := _reasons_of_position(output)):
            self._was_valid.add("position")
            self._report("position", output.t_ns, None)
        elif "position" in self._was_valid:
            self._report_loss("position", "POSITION NOT VALID", output.t_ns, reasons)
        if "position" in self._was_valid:
            self._judge_position_source(output)
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
            self._judge_source(name, output.t_ns)
        if output.position_source is not None:
            self._judge_comparison(output.t_ns, is_short=Reason.REACQUIRED in output.unchecked)

    def _judge_comparison(self, t_ns: int, *, is_short: bool) -> None:
        """Sources are compared for a short time only: expected until it has been long enough for the first time."""
        if not is_short:
            self._was_valid |= {"comparison"} if "short comparison" in self._was_valid else set()
            self._report("comparison", t_ns, None)
        elif "comparison" in self._was_valid:
            cause = _describe((Reason.REACQUIRED,))
            self._report("comparison", t_ns, Condition("reacquired", Severity.ADVISORY, "SOURCES REACQUIRED", cause))
        else:
            self._was_valid.add("short comparison")

    def _judge_position_source(self, output: NavSolution) -> None:
        """Report that another device gives the position, once the first one has: nobody knows what was before that."""
        source, first = output.position_source, self._first_position
        if source == first or source is None:
            self._was_valid |= {"first position"} if source else set()
            self._report("position source", output.t_ns, None)
        elif source in FALLBACKS:
            found = _by_fallback("position", source, output.horizontal_sd)
            self._report("position source", output.t_ns, found)
        elif "first position" in self._was_valid:
            title, cause = f"POSITION BY {in_title(source)}", f"{first} is not used"
            causes = (f"source:{first}", "position")
            found = Condition(f"position_by:{source}", Severity.ADVISORY, title, cause, explained_by=causes)
            self._report("position source", output.t_ns, found)

    def _feed_filter(self, output: FilterSolution) -> None:
        is_unresolved = Reason.CONTRADICTION in output.reasons
        cause = "none of them is known to be right; the protection levels contain all"
        found = Condition("contradiction", Severity.CAUTION, "SOURCES CONTRADICT EACH OTHER", cause)
        self._report("contradiction", output.t_ns, found if is_unresolved else None)

    def _feed_source(self, output: SourceValidity) -> None:
        self._tested[output.source] = output
        self._judge_source(output.source, output.t_ns)

    def _judge_source(self, name: str, t_ns: int) -> None:
        """By the tests of the source alone, and by its exclusion because it contradicts others."""
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

    # --------------------------------------------------------------------------------------------------- reporting

    def _report_loss(self, role: str, title: str, t_ns: int, reasons: Iterable[Reason]) -> None:
        """What was valid is not any more; on an approach a person must act at once."""
        is_grave = self._is_on_approach and role != "attitude"
        severity = Severity.WARNING if is_grave else Severity.CAUTION
        self._report(role, t_ns, Condition(role, severity, title, _describe(reasons), explained_by=self._lost_by[role]))

    def _report(self, subject: str, t_ns: int, condition: Condition | None) -> None:
        report, last = ConditionReport(t_ns, subject, condition), self._reported.get(subject)
        if last is not None and _is_same(last, report):
            return
        self._reported[subject] = report
        self._found.append(report)


def _reasons_of_position(output: NavSolution) -> list[Reason]:
    """Why it is not valid beside its attitude, which has an alarm of its own; "unchecked" is of the position alone."""
    of_attitude = set(output.attitude_reasons).difference(output.unchecked)
    return [reason for reason in output.reasons if reason not in of_attitude]


def _by_fallback(role: str, source: str | None, sd: float | None) -> Condition | None:
    """No device gives it; the value is one sigma."""
    if source not in FALLBACKS:
        return None
    title = f"{role.upper()} BY {FALLBACKS[source]}"
    cause = "no device gives it"
    return Condition(f"{role}_by:{source}", Severity.CAUTION, title, cause, sd, explained_by=(role,))


def _describe(reasons: Iterable[Reason]) -> str:
    return ", ".join(describe_reasons(list(reasons)))


def _is_same(last: ConditionReport, report: ConditionReport) -> bool:
    """Nothing has changed, or nothing but the value a moment ago."""
    if last.condition is None or report.condition is None:
        return last.condition is report.condition
    if report.t_ns - last.t_ns < VALUE_NS:
        return last.condition == replace(report.condition, value=last.condition.value)
    return last.condition == report.condition
