"""Alarm conditions in outputs and health: every alarm needs its condition, and some conditions need an alarm.

A condition is a word at a topic: the identity of an alarm (docs/alarms.md).  An alarm is explained only while its
condition is in ``may_alarm``.  While one is in ``must_alarm`` the alarm is required: an alarm of the integrity monitor,
a monitor that stops working, a lost height on an approach, a lost position, a device or link that was good before.

The rules are independent of the code that raises the alarms.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fti.config import Config
from fti.hil.oracle.flag_definitions import GROUND_DRIFT, HEIGHT, INTEGRITY, SOLUTION
from fti.hil.oracle.required_outputs import FILTER, GLIDE, HEIGHT_BELOW, VALIDITY
from fti.messages.frames import LinkState
from fti.messages.outputs import IntegrityState
from fti.messages.reasons import Reason
from fti.messages.topics import ALARM_TOPIC, HEALTH_TOPIC
from fti.nav.alarm_conditions import FALLBACKS
from fti.post.score.observed_flags import MOMENT_S, FlagInterval, ObservedFlags, uncovered_parts
from fti.post.score.outputs.consistency import PROFILE_REASONS
from fti.service.supervisor.health_conditions import STOPPED_LINK_STATES

#: Health is recorded once a second and evaluated twice a second: tolerance between health and alarm [s].
RECORDED_S = 1.5
SILENT_STATES = (LinkState.SILENT, LinkState.NOISE)
EVALUATED_STATES = (IntegrityState.OK, IntegrityState.CAUTION, IntegrityState.ALERT)
INTEGRITY_ALARMS = {
    IntegrityState.ALERT: "integrity_alert",
    IntegrityState.CAUTION: "integrity_caution",
    IntegrityState.UNAVAILABLE: "integrity_unavailable",
}
#: Outputs with alarm conditions, and outputs that each device has.
OUTPUTS = frozenset({INTEGRITY, SOLUTION, HEIGHT_BELOW, FILTER, GLIDE, GROUND_DRIFT})
DEVICE_OUTPUTS = frozenset({HEIGHT, VALIDITY})

Content = Mapping[str, Any]


def has_states(topic: str) -> bool:
    """Is it an output with alarm conditions?"""
    return topic in OUTPUTS or topic.rpartition("/")[0] in DEVICE_OUTPUTS


class AlarmStates:
    """Reads messages in order, and adds their alarm conditions to ``observed_flags``."""

    def __init__(self, config: Config, observed_flags: ObservedFlags) -> None:
        self._observed_flags = observed_flags
        self._first_position = next(iter(config.nav.position), None)
        self._was_valid: set[str] = set()
        self._dropped: dict[str, tuple[int, int]] = {}

    def feed_output(self, t: float, topic: str, content: Content) -> None:
        """Add an output with alarm conditions, at t [s]."""
        may, must = self._of_output(topic, content)
        self._note(t, topic, may | must, must)

    def feed_health(self, t: float, content: Content) -> None:
        """Add the states of devices and links, and losses since the last health, at t [s]."""
        may, must = set[str](), set[str]()
        for kind, stopped in (("device", SILENT_STATES), ("link", STOPPED_LINK_STATES)):
            for name, fields in content[f"{kind}s"].items():
                identity, state = f"{kind}:{name}", fields.get("port_state", fields["state"])
                self._was_valid |= {identity} if state == LinkState.GOOD else set()
                may |= {identity} if state != LinkState.GOOD else set()
                must |= {identity} & self._was_valid if state in stopped else set()
        for name, link in content["links"].items():
            counts = int(link.get("dropped_frames") or 0), int(link.get("stamp_refused") or 0)
            before = self._dropped.get(name, counts)
            self._dropped[name] = counts
            may |= {word for word, old, new in zip(("losses", "stamps"), before, counts, strict=True) if new > old}
        self._note(t, HEALTH_TOPIC, may, must)

    def _note(self, t: float, topic: str, may: set[str], must: set[str]) -> None:
        self._observed_flags.may_alarm.feed(t, topic, frozenset(may))
        self._observed_flags.must_alarm.feed(t, topic, frozenset(must))

    def _of_output(self, topic: str, content: Content) -> tuple[set[str], set[str]]:
        """The alarms that are allowed, and those that are required."""
        above, _, name = topic.rpartition("/")
        if topic == INTEGRITY:
            return self._of_integrity(content)
        if topic == SOLUTION:
            return self._of_solution(content)
        if topic == HEIGHT_BELOW:
            return {"height"} if not content["valid"] else set(), self._invalidated("height", bool(content["valid"]))
        if topic == FILTER:
            return {"contradiction"} if Reason.CONTRADICTION in content["reasons"] else set(), set()
        if topic == GROUND_DRIFT:
            return {"ground_drift"} if not content["valid"] else set(), set()
        others = {HEIGHT: f"altimeter:{name}", VALIDITY: f"source:{name}"}
        identity = "glide_slope" if topic == GLIDE else others.get(above)
        return {identity} if identity and not content["valid"] else set(), set()

    def _of_integrity(self, content: Content) -> tuple[set[str], set[str]]:
        state, is_outside = content["state"], bool(PROFILE_REASONS.intersection(content["reasons"]))
        self._was_valid |= {"integrity"} if state in EVALUATED_STATES else set()
        if state == IntegrityState.NO_PROFILE or is_outside:
            self._was_valid.discard("integrity")
        may = {INTEGRITY_ALARMS[state]} if state in INTEGRITY_ALARMS else set()
        return may, may if "integrity" in self._was_valid else set()

    def _of_solution(self, content: Content) -> tuple[set[str], set[str]]:
        of_attitude = set(content["attitude_reasons"]).difference(content["unchecked"])
        is_valid = of_attitude.issuperset(content["reasons"])
        may = {f"source:{name}" for name in content["refused"]}
        may |= set() if is_valid else {"position"}
        may |= set() if content["attitude_valid"] else {"attitude"}
        may |= {"reacquired"} if Reason.REACQUIRED in content["unchecked"] else set()
        if content["position_source"] not in (None, self._first_position):
            may.add(f"position_by:{content['position_source']}")
        for role in ("attitude", "altitude"):
            if content[f"{role}_source"] in FALLBACKS:
                may.add(f"{role}_by:{content[f'{role}_source']}")
        return may, self._invalidated("position", is_valid)

    def _invalidated(self, alarm: str, is_valid: bool) -> set[str]:
        """The alarm if its output was valid before and is not now; a height only after the monitor was working."""
        self._was_valid |= {alarm} if is_valid else set()
        is_due = alarm in self._was_valid and (alarm != "height" or "integrity" in self._was_valid)
        return {alarm} if is_due and not is_valid else set()


def explanations(observed_flags: ObservedFlags, alarm: str, alarm_hold_s: float) -> Iterator[tuple[float, float]]:
    """Intervals in which an alarm is explained.  alarm_hold_s : it may last longer than its condition [s]"""
    before_s, after_s = MOMENT_S, alarm_hold_s
    if _is_of_health(alarm):
        before_s = after_s = RECORDED_S
        # an alarm may begin and end between two health messages of the recording
        alarms = observed_flags.intervals(ALARM_TOPIC, (alarm,))
        yield from ((one.from_s, one.until_s) for one in alarms if one.until_s - one.from_s < RECORDED_S)
    for state in observed_flags.may_alarm.intervals("/", (alarm,)):
        yield state.from_s - before_s, state.until_s + after_s


def missing_alarms(observed_flags: ObservedFlags, begin_s: float, end_s: float) -> Iterator[tuple[str, float, float]]:
    """Identity, begin and end [s] of each required alarm that is missing, from begin_s on."""
    for (_, alarm), states in sorted(observed_flags.must_alarm.spans.items()):
        margin_s = RECORDED_S if _is_of_health(alarm) else MOMENT_S
        found = [(one.from_s, one.until_s) for one in observed_flags.intervals(ALARM_TOPIC, (alarm,))]
        for state in states:
            due = FlagInterval(max(state.from_s + margin_s, begin_s), min(state.until_s - margin_s, end_s))
            if due.until_s - due.from_s > margin_s:
                yield from ((alarm, *part) for part in uncovered_parts(due, found))


def _is_of_health(alarm: str) -> bool:
    return alarm.startswith(("device:", "link:"))
