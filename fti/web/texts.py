"""The words that a person reads for states; the page and the terminal say the same."""

from __future__ import annotations

from fti.types import IntegrityState

STATES: dict[str, str] = {
    IntegrityState.NO_PROFILE: "no approach profile loaded",
    IntegrityState.ACQUIRE: "collecting the first window",
    IntegrityState.MONITOR: "heights match; position not observable here",
    IntegrityState.OK: "ground matches the published approach",
    IntegrityState.CAUTION: "one test over its limit",
    IntegrityState.ALERT: "do not trust height or position",
    IntegrityState.UNAVAILABLE: "monitor does not judge",
}


#: How a session is recorded, when it is not all of it: banner and explanation.
MODES: dict[str, tuple[str, str]] = {"snapshot": ("SNAPSHOT", "only what is around a trigger is recorded")}
CONTINUOUS = "continuous"


def describe_mode(mode: str) -> tuple[str, str]:
    """Banner and explanation of a mode that is not continuous."""
    return MODES.get(mode, (mode.upper(), ""))
