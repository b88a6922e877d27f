"""What outputs and health say of the conditions of alarms: an alarm has its state, and what must be an alarm has one.

A state is a word at a place: the word is the identity of an alarm (docs/alarms.md), the place is the topic below
``MAY`` or ``MUST``.  An alarm is there only while its state stands at a place below ``MAY``.  While one stands below
``MUST`` the alarm must be there: an alarm of the integrity monitor, a monitor that stops to judge, a lost height on an
approach, a lost position, a device or link that was good before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fti.config import Config
from fti.hil.expected.alarm_flags import ALARM
from fti.hil.expected.duties import HEIGHT, INTEGRITY, SOLUTION
from fti.hil.expected.required_outputs import BELOW, FILTER, GLIDE, VALIDITY
from fti.nav.navigation import FILTER as BY_FILTER
from fti.nav.navigation import RADIO, VERTICAL
from fti.post.score.outputs.consistency import OF_PROFILE
from fti.post.score.said import Said, Span, Words
from fti.types import IntegrityState, LinkState, Reason

MAY, MUST = "may be an alarm", "must be an alarm"
#: Health is recorded once a second and judged twice: it may be so late, or so early, beside an alarm [s].
HEALTH_S = 1.5
#: What stands for less beyond what is allowed is a matter of rounding [s].
MOMENT_S = 0.05
NO_DEVICE = (BY_FILTER, RADIO, VERTICAL)
STOPPED = (LinkState.ABSENT, LinkState.DENIED, LinkState.BUSY, LinkState.SILENT)
UNHEARD = (LinkState.SILENT, LinkState.NOISE)
JUDGED = (IntegrityState.OK, IntegrityState.CAUTION, IntegrityState.ALERT)
OF_INTEGRITY = {
    IntegrityState.ALERT: "integrity_alert",
    IntegrityState.CAUTION: "integrity_caution",
    IntegrityState.UNAVAILABLE: "integrity_unavailable",
}

Content = Mapping[str, Any]


class AlarmStates:
    """Looks at messages in order."""

    def __init__(self, config: Config) -> None:
        self._first_position = next(iter(config.nav.position), None)
        self._had: set[str] = set()
        self._dropped: dict[str, tuple[int, int]] = {}

    def read(self, topic: str, content: Content) -> Iterator[tuple[str, Words]]:
        """The states of a message of navigation."""
        may, must = self._of_output(topic, content)
        yield from _stated(topic, may | must, must)

    def read_health(self, content: Content) -> Iterator[tuple[str, Words]]:
        """The states of devices and links, and what was lost since the last health."""
        may, must = set[str](), set[str]()
        for kind, stopped in (("device", UNHEARD), ("link", STOPPED)):
            for name, fields in content[f"{kind}s"].items():
                identity, state = f"{kind}:{name}", fields.get("port_state", fields["state"])
                self._had |= {identity} if state == LinkState.GOOD else set()
                may |= {identity} if state != LinkState.GOOD else set()
                must |= {identity} & self._had if state in stopped else set()
        for name, link in content["links"].items():
            counts = int(link.get("dropped_frames") or 0), int(link.get("stamp_refused") or 0)
            before = self._dropped.get(name, counts)
            self._dropped[name] = counts
            may |= {word for word, old, new in zip(("losses", "stamps"), before, counts, strict=True) if new > old}
        yield from _stated("health", may, must)

    def _of_output(self, topic: str, content: Content) -> tuple[set[str], set[str]]:
        """The alarms that may be there, and those that must."""
        above, _, name = topic.rpartition("/")
        if topic == INTEGRITY:
            return self._of_integrity(content)
        if topic == SOLUTION:
            return self._of_solution(content)
        if topic == BELOW:
            return {"height"} if not content["valid"] else set(), self._lost("height", bool(content["valid"]))
        if topic == FILTER:
            return {"contradiction"} if Reason.CONTRADICTION in content["reasons"] else set(), set()
        others = {HEIGHT: f"altimeter:{name}", VALIDITY: f"source:{name}"}
        identity = "glide_slope" if topic == GLIDE else others.get(above)
        return {identity} if identity and not content["valid"] else set(), set()

    def _of_integrity(self, content: Content) -> tuple[set[str], set[str]]:
        state, is_placed = content["state"], bool(OF_PROFILE.intersection(content["reasons"]))
        self._had |= {"integrity"} if state in JUDGED else set()
        if state == IntegrityState.NO_PROFILE or is_placed:
            self._had.discard("integrity")
        may = {OF_INTEGRITY[state]} if state in OF_INTEGRITY else set()
        return may, may if "integrity" in self._had else set()

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
            if content[f"{role}_source"] in NO_DEVICE:
                may.add(f"{role}_by:{content[f'{role}_source']}")
        return may, self._lost("position", is_valid)

    def _lost(self, what: str, is_valid: bool) -> set[str]:
        """What was valid before and is not; a height only while the monitor judges, or has just stopped to."""
        self._had |= {what} if is_valid else set()
        is_due = what in self._had and (what != "height" or "integrity" in self._had)
        return {what} if is_due and not is_valid else set()


def unexplained(said: Said, alarm: str, span: Span, ends_s: float) -> Iterator[tuple[float, float]]:
    """The parts of an alarm in which its state did not stand.  ends_s : it may last for so long behind its state [s]"""
    found = [spans for (place, word), spans in said.spans.items() if word == alarm and _is_at(place, MAY)]
    is_of_health = alarm.startswith(("device:", "link:"))
    before_s, behind_s = (HEALTH_S, ends_s + HEALTH_S) if is_of_health else (MOMENT_S, ends_s)
    if is_of_health and span.until_s - span.from_s < HEALTH_S:  # between two health messages of the recording
        return
    yield from without(span, [(one.from_s - before_s, one.until_s + behind_s) for states in found for one in states])


def missing_alarms(said: Said, begin_s: float, end_s: float) -> Iterator[tuple[str, float, float]]:
    """Identity, begin and end [s] of what must be an alarm and is none, from begin_s on."""
    for (place, alarm), spans in sorted(said.spans.items()):
        if not _is_at(place, MUST):
            continue
        margin_s = HEALTH_S if alarm.startswith(("device:", "link:")) else MOMENT_S
        there = [(one.from_s, one.until_s) for one in said.at(ALARM, (alarm,))]
        for span in spans:
            due = Span(max(span.from_s + margin_s, begin_s), min(span.until_s - margin_s, end_s))
            if due.until_s - due.from_s > margin_s:
                yield from ((alarm, *part) for part in without(due, there))


def without(span: Span, covered: Sequence[tuple[float, float]]) -> Iterator[tuple[float, float]]:
    """The parts of a span that no interval covers; what is shorter than a moment is none, unless the whole span is."""
    least, at = min(MOMENT_S, span.until_s - span.from_s), span.from_s
    for from_s, until_s in sorted(covered):
        if until_s >= at and from_s <= span.until_s:
            if from_s - at > least:
                yield at, from_s
            at = max(at, math.nextafter(until_s, math.inf))
    if at <= span.until_s and span.until_s - at >= least:
        yield at, span.until_s


def is_state(place: str) -> bool:
    """Is it a place of states, and of no flags?"""
    return _is_at(place, MAY) or _is_at(place, MUST)


def _is_at(place: str, kind: str) -> bool:
    return place.startswith(f"{kind} ")


def _stated(topic: str, may: set[str], must: set[str]) -> Iterator[tuple[str, Words]]:
    yield f"{MAY} {topic}", frozenset(may)
    yield f"{MUST} {topic}", frozenset(must)
