"""Events when the filter excludes an altimeter from aiding, and when the altimeter aids again."""

from __future__ import annotations

from collections.abc import Iterable

from fti.constants import SECOND_NS
from fti.messages.outputs import Event
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.exclusion import Cause, Exclusion
from fti.nav.filter.navigator import InertialNavigator


def altitude_name(sensor: str) -> str:
    """Name under which the gate tests altitudes of an altimeter."""
    return f"{sensor}.altitude"


def own_states(sensor: str) -> tuple[str, str]:
    """Names of an altimeter's bias and scale in the filter."""
    return f"{sensor}.bias", f"{sensor}.scale"


class ExclusionEvents:
    """Compares present with previous exclusions.  sensors : altimeters that aid the filter"""

    def __init__(self, navigator: InertialNavigator, sensors: Iterable[str]) -> None:
        self._navigator = navigator
        self._sensors = tuple(sensors)
        self._excluded: frozenset[str] = frozenset()

    def is_excluded(self, sensor: str) -> bool:
        """Whether an altimeter was excluded at the last call of ``drain_events``."""
        return sensor in self._excluded

    def drain_events(self, t_ns: int) -> list[Event]:
        """Events of the changes since the last call."""
        exclusions, previous = self._navigator.find_exclusions(), self._excluded
        self._excluded = frozenset(s for s in self._sensors if altitude_name(s) in exclusions)
        events = []
        for sensor in sorted(self._excluded - previous):
            text = _describe(sensor, exclusions[altitude_name(sensor)], t_ns, self._navigator.at(t_ns))
            events.append(Event(t_ns=t_ns, level="warning", source="nav", text=text))
        texts = [describe_return(sensor) for sensor in sorted(previous - self._excluded)]
        return events + [Event(t_ns=t_ns, level="info", source="nav", text=text) for text in texts]


def describe_return(sensor: str) -> str:
    """Text of the event when an altimeter aids again."""
    return f"{sensor}: aids the filter again"


def _describe(sensor: str, exclusion: Exclusion, t_ns: int, estimate: Estimate | None) -> str:
    """Text: the excluded altimeter, the cause, and the duration of its contradiction."""
    seconds = (t_ns - (exclusion.since_ns or t_ns)) / SECOND_NS
    reason = "its heights are outside the gate"
    if exclusion.cause is Cause.BIAS and estimate is not None:
        bias, scale = own_states(sensor)
        bias_sd, scale_sd = estimate.drift_sd(bias) or 0.0, estimate.drift_sd(scale) or 0.0
        reason = f"bias {estimate.drift(bias):.1f} m (sd {bias_sd:.1f} m)"
        reason += f", scale {100.0 * estimate.drift(scale):.1f} % (sd {100.0 * scale_sd:.1f} %)"
    return f"{sensor}: excluded from the filter: {reason}, for {seconds:.0f} s"
