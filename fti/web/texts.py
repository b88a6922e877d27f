"""Texts for states, for the page and the terminal."""

from __future__ import annotations

from fti.messages.outputs import IntegrityState

STATES: dict[str, str] = {
    IntegrityState.NO_PROFILE: "no approach profile loaded",
    IntegrityState.ACQUIRE: "collecting the first window",
    IntegrityState.MONITOR: "heights match; position not observable here",
    IntegrityState.OK: "ground matches the published approach",
    IntegrityState.CAUTION: "one test over its limit",
    IntegrityState.ALERT: "do not trust height or position",
    IntegrityState.UNAVAILABLE: "monitor not available",
}


#: Recording modes other than continuous: banner and explanation.
MODES: dict[str, tuple[str, str]] = {"snapshot": ("SNAPSHOT", "only data around a trigger are recorded")}
CONTINUOUS = "continuous"


def describe_mode(mode: str) -> tuple[str, str]:
    """Banner and explanation of a mode that is not continuous."""
    return MODES.get(mode, (mode.upper(), ""))
