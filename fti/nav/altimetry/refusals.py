"""Events when a refusal of an altimeter by the tests over time begins or ends."""

from __future__ import annotations

from collections.abc import Mapping

from fti.constants import SECOND_NS
from fti.messages.outputs import Event, HeightAboveGround
from fti.messages.reasons import Reason
from fti.nav.altimetry.mismatch import MAX_UNKNOWN_NS
from fti.nav.plausibility.events import clock_text

BEGINS: Mapping[Reason, str] = {
    Reason.DEVIATION: "it deviates from what the known ground predicts",
    Reason.STUCK: "its value is stuck",
    Reason.CHANGE_MISMATCH: "it does not change as the known ground predicts",
    Reason.ALTIMETERS_DISAGREE: "it disagrees with another altimeter",
}
ENDS: Mapping[Reason, str] = {
    Reason.DEVIATION: "it agrees with the known ground",
    Reason.STUCK: "its value changes again",
    Reason.CHANGE_MISMATCH: "it changes as the known ground predicts",
    Reason.ALTIMETERS_DISAGREE: "no other altimeter disagrees with it",
}
#: Reasons of the known ground, and why they end over unknown ground.
TERRAIN_CAUSES: Mapping[Reason, str] = {
    Reason.DEVIATION: "the known ground has been missing for many times as long as it deviated",
    Reason.CHANGE_MISMATCH: f"the known ground has been missing for {MAX_UNKNOWN_NS // SECOND_NS} s",
}


class RefusalEvents:
    """Refusals in force by altimeter; the source of an event is the altimeter."""

    def __init__(self) -> None:
        self._since: dict[tuple[str, Reason], int] = {}

    def update(self, height: HeightAboveGround, since_ns: Mapping[Reason, int]) -> list[Event]:
        """Events of a new height.

        since_ns : when the cause of each refusal in force by the tests over time began; a single deviating sample makes
                   no event
        """
        events, t_ns = list[Event](), height.t_valid_ns or height.t_ns
        if not (since_ns or height.reasons or self._since):  # nearly always
            return events
        for reason in BEGINS:
            key = height.sensor, reason
            is_refused = reason in (since_ns if reason is Reason.DEVIATION else height.reasons)
            if is_refused == (key in self._since):
                continue
            if key in self._since:
                text = _end_text(t_ns - self._since.pop(key), _end_cause(reason, height))
                events.append(Event(t_ns=height.t_ns, level="info", source=height.sensor, text=text))
            else:
                since = self._since[key] = since_ns.get(reason, t_ns)
                text = _begin_text(reason, since, height.raw)
                events.append(Event(t_ns=height.t_ns, level="warning", source=height.sensor, text=text))
        return events


def _begin_text(reason: Reason, since_ns: int, raw: float | None) -> str:
    value = f" at {raw:.2f} m" if reason is Reason.STUCK and raw is not None else ""
    return f"altimeter refused: since {clock_text(since_ns)} UTC {BEGINS[reason]}{value}"


def _end_cause(reason: Reason, height: HeightAboveGround) -> str:
    if reason in TERRAIN_CAUSES and Reason.GROUND_CONTRADICTED in height.unchecked:
        return "altitude or terrain is wrong, and not the altimeter"
    is_bounded = Reason.NO_PREDICTION in height.unchecked  # it was compared with the distance to the nearest ground
    if reason in TERRAIN_CAUSES and height.predicted is None and not is_bounded:
        return TERRAIN_CAUSES[reason]
    return ENDS[reason]


def _end_text(lasted_ns: int, cause: str) -> str:
    return f"altimeter not refused any more: after {lasted_ns / SECOND_NS:.1f} s {cause}"
