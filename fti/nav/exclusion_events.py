"""Events when the filter excludes an altimeter from aiding, and when the altimeter aids again."""

from __future__ import annotations

from collections.abc import Iterable

from fti.nav.filter.estimate import Estimate
from fti.nav.filter.exclusion import Cause, Exclusion
from fti.nav.filter.navigator import InertialNavigator
from fti.nav.time_series import SECOND_NS
from fti.types import Event


def altitude_name(sensor: str) -> str:
    """Name under which the gate judges altitudes of an altimeter."""
    return f"{sensor}.altitude"


def own_states(sensor: str) -> tuple[str, str]:
    """Names of an altimeter's bias and scale in the filter."""
    return f"{sensor}.bias", f"{sensor}.scale"


class ExclusionEvents:
    """Compares who is excluded with who was.  sensors : altimeters that aid the filter"""

    def __init__(self, navigator: InertialNavigator, sensors: Iterable[str]) -> None:
        self._navigator = navigator
        self._sensors = tuple(sensors)
        self._excluded: frozenset[str] = frozenset()

    def is_excluded(self, sensor: str) -> bool:
        """Whether an altimeter was excluded at the last call of ``drain_events``."""
        return sensor in self._excluded

    def drain_events(self, t_ns: int) -> list[Event]:
        """What has changed since the last call."""
        exclusions, before = self._navigator.exclusions, self._excluded
        self._excluded = frozenset(s for s in self._sensors if altitude_name(s) in exclusions)
        events = []
        for sensor in sorted(self._excluded - before):
            text = _describe(sensor, exclusions[altitude_name(sensor)], t_ns, self._navigator.at(t_ns))
            events.append(Event(t_ns=t_ns, level="warning", source="nav", text=text))
        back = [describe_return(sensor) for sensor in sorted(before - self._excluded)]
        return events + [Event(t_ns=t_ns, level="info", source="nav", text=text) for text in back]


def describe_return(sensor: str) -> str:
    """Text of the event when an altimeter aids again."""
    return f"{sensor}: aids the filter again"


def _describe(sensor: str, exclusion: Exclusion, t_ns: int, here: Estimate | None) -> str:
    """Which altimeter is excluded, why, and since when it has contradicted the others."""
    seconds = (t_ns - (exclusion.since_ns or t_ns)) / SECOND_NS
    why = "its heights are outside the gate"
    if exclusion.cause is Cause.BIAS and here is not None:
        bias, scale = own_states(sensor)
        bias_sd, scale_sd = here.drift_sd(bias) or 0.0, here.drift_sd(scale) or 0.0
        why = f"bias {here.drift(bias):.1f} m (sd {bias_sd:.1f} m)"
        why += f", scale {100.0 * here.drift(scale):.1f} % (sd {100.0 * scale_sd:.1f} %)"
    return f"{sensor}: excluded from the filter: {why}, for {seconds:.0f} s"
