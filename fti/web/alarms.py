"""What a person must be told at once, the most urgent first.  An alarm has ``id``, ``level`` (red, amber), ``title``
and ``detail``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from fti.web.words import describe_reasons, describe_storage

Alarm = dict[str, str]

HEALTH_LIMIT_MS = 2000.0
NAV_LIMIT_MS = 1000.0
#: Sources that are no device, and sigmas of what they give.
NO_DEVICE = {"filter": "filter", "radio": "radio", "vertical": "vertical channel"}
SIGMAS = {"position": "horizontal_sd", "altitude": "vertical_sd"}
INTEGRITY = {"alert": ("red", "GROUND CLEARANCE ALERT"), "caution": ("amber", "GROUND CLEARANCE CAUTION")}


@dataclass(frozen=True, slots=True)
class Sight:
    """What the alarms are judged by.

    health, health_silence_ms : the last health message and the time since it came [ms]
    nav_silence_ms            : time since the last output of navigation came [ms]
    nav_age_ms                : age of that output now [ms]; None before the first
    integrity                 : the last judgement of the integrity monitor; empty when it is late
    solution                  : the last navigation solution; empty when it is late
    had                       : roles (position, attitude) that had a source before
    dead                      : processes whose liveliness token has gone
    """

    health: Mapping[str, Any]
    health_silence_ms: float
    nav_silence_ms: float
    nav_age_ms: float | None
    integrity: Mapping[str, Any]
    dead: frozenset[str]
    solution: Mapping[str, Any] = field(default_factory=dict)
    had: frozenset[str] = frozenset()


def find_alarms(sight: Sight) -> list[Alarm]:
    """The alarms that stand now."""
    navigation = list(_navigation(sight))
    stopped = any(alarm["id"] == "navigation_stopped" for alarm in navigation)
    judged = [] if stopped else [*_integrity(sight), *_sources(sight)]
    return [*_daemon(sight), *_recording(sight), *navigation, *judged, *_losses(sight)]


def _alarm(name: str, level: str, title: str, detail: str) -> Alarm:
    return {"id": name, "level": level, "title": title, "detail": detail}


def _daemon(sight: Sight) -> Iterator[Alarm]:
    if sight.health_silence_ms > HEALTH_LIMIT_MS or "supervisor" in sight.dead:
        silence = f"no health for {sight.health_silence_ms / 1000:.1f} s; the state of the recording is unknown"
        yield _alarm("daemon_stopped", "red", "DAEMON STOPPED", silence)


def _recording(sight: Sight) -> Iterator[Alarm]:
    storage = _table(sight.health, "storage")
    session = _table(sight.health, "session")
    recorder = _table(_table(sight.health, "processes"), "recorder").get("state", "running")
    state = "error" if session.get("state") == "storage_error" else str(storage.get("state", "ok"))
    if state != "ok":
        yield _alarm("storage", *describe_storage(state), str(storage.get("hint") or f"storage {state}"))
    if state != "error" and recorder in ("restarting", "stopped") and session.get("state") != "stopping":
        yield _alarm("recorder", "red", "NOT RECORDING", f"the recorder is {recorder}")
    if session.get("state") == "stopping":
        yield _alarm("stopping", "amber", "STOPPING", "files are being closed")


def _navigation(sight: Sight) -> Iterator[Alarm]:
    state = _table(_table(sight.health, "processes"), "navigation").get("state")
    if state == "starting" and sight.nav_age_ms is None:
        yield _alarm("navigation_starting", "amber", "NAVIGATION STARTING", "recording already runs")
    elif why := _why_stopped(sight, state):
        yield _alarm("navigation_stopped", "red", "NAVIGATION STOPPED", f"{why}; its last values are struck out")
    elif sight.nav_age_ms is not None and sight.nav_age_ms > NAV_LIMIT_MS:
        yield _alarm(
            "navigation_late", "amber", "NAVIGATION LATE", f"catching up, {sight.nav_age_ms / 1000:.1f} s behind"
        )


def _why_stopped(sight: Sight, state: object) -> str | None:
    if state is not None and state != "running":
        return f"process {state}"
    if "navigation" in sight.dead:
        return "process ended"
    if sight.nav_silence_ms > NAV_LIMIT_MS:
        return f"no output for {sight.nav_silence_ms / 1000:.1f} s"
    return None


def _integrity(sight: Sight) -> Iterator[Alarm]:
    state = str(sight.integrity.get("state"))
    if state in INTEGRITY:
        yield _alarm(
            f"integrity_{state}", *INTEGRITY[state], ", ".join(describe_reasons(sight.integrity.get("reasons")))
        )


def _sources(sight: Sight) -> Iterator[Alarm]:
    """What no device gives any more: who has taken its place, or that nobody has."""
    for role in ("position", "attitude", "altitude"):
        told = sight.solution.get(f"{role}_source")
        source = None if told is None else str(told)
        if source in NO_DEVICE and (role != "altitude" or source != sight.solution.get("position_source")):
            title = f"{role} by {NO_DEVICE[source]}".upper()
            sd = sight.solution.get(SIGMAS.get(role, ""))
            about = f"; ± {sd:.0f} m" if isinstance(sd, int | float) else ""
            yield _alarm(f"{role}_source", "amber", title, f"no device gives it{about}")
        elif source is None and sight.solution and role in sight.had:
            yield _alarm(f"{role}_source", "amber", f"NO {role.upper()}", "no device gives it, nor anything else")


def _losses(sight: Sight) -> Iterator[Alarm]:
    links = _table(sight.health, "links")
    dropped = {name: _table(links, name).get("dropped_frames") for name in links}
    detail = ", ".join(f"{count} frames on {name}" for name, count in dropped.items() if count)
    if detail:
        yield _alarm("losses", "amber", "DATA LOST", detail)


def _table(fields: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = fields.get(key)
    return found if isinstance(found, Mapping) else {}
