"""Derives alarm conditions of recording, processes, links and devices from health.

Expected states are not conditions: ports that open after the start, devices that are switched on with the computer,
the end of the session.  While navigation is silent or behind, devices are not assessed.
Source: docs/alarms.md.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from fti.alarms.condition import Condition, ConditionReport, Severity, device_id, in_title
from fti.constants import SECOND_NS
from fti.messages.frames import LinkState
from fti.service.children import ProcessState
from fti.service.supervisor.health import MAX_LAG_MS

Fields = Mapping[str, Any]

#: Grace period after the start of the session or of a new flight for links and devices that were not good yet.
START_NS = 10 * SECOND_NS
#: States of the storage: severity and title; "opening" only after the start of the session.
STORAGE: dict[str, tuple[Severity, str]] = {
    "full": (Severity.CAUTION, "STORAGE ALMOST FULL"),
    "overdue": (Severity.CAUTION, "NEXT FILE OVERDUE"),
    "slow": (Severity.CAUTION, "STORAGE SLOW"),
    "fallback": (Severity.CAUTION, "RECORDING TO THE FALLBACK"),
    "gone": (Severity.WARNING, "RECORDING TO A LOST FILE"),
    "opening": (Severity.WARNING, "NOT RECORDING"),
    "error": (Severity.WARNING, "NOT RECORDING"),
}
#: The rate is measured over 4 s; after a start or interruption of a device it is too low for this time.
RATE_COUNTED_NS = 5 * SECOND_NS
STOPPED_LINK_STATES = frozenset({LinkState.ABSENT, LinkState.DENIED, LinkState.BUSY, LinkState.SILENT})
#: Number of restarts within a minute that is a condition.
MIN_RESTARTS, RESTARTS_SPAN_NS = 3, 60 * SECOND_NS
#: Begin and end of the alarm about free recording time [s], at the rate of the last minute.
SPACE_ALARM_S, SPACE_CLEAR_S = 3600.0, 4000.0
RATE_SPAN_NS, MIN_RATE_SPAN_NS = 60 * SECOND_NS, 10 * SECOND_NS
#: Conditions of the daemon and its media, independent of the flight.
SYSTEM_CONDITIONS = frozenset(
    {"recording", "space", "losses", "stamps", "clock_step", "recorder", "navigation", "navigation_late"}
    | {f"storage_{state}" for state in STORAGE}
)
#: Conditions that may cause those of links and devices.
RECORDER_CAUSES, NAVIGATION_CAUSES = ("recording",), ("navigation", "navigation_late")


class HealthConditions:
    """Derives conditions from each health message (twice a second)."""

    def __init__(self, begin_ns: int) -> None:
        self._begin_ns: int | None = begin_ns
        self._were_good: set[str] = set()
        self._space = SpaceForecast()
        self._navigation_ran = False
        self._wrong_rate_ns: dict[str, int] = {}
        self._restarts: dict[str, deque[int]] = {}
        self._restarts_known: dict[str, int] = {}

    def suppress_device_alarms(self) -> None:
        """Suppress conditions of links and devices until ``resume_device_alarms``: they are not switched on yet."""
        self._begin_ns = None

    def resume_device_alarms(self, t_ns: int) -> None:
        """All devices are switched on."""
        self._begin_ns, self._were_good = t_ns, set()

    def start_new_flight(self, t_ns: int) -> None:
        """A new flight begins: devices may be switched off and on."""
        if self._begin_ns is not None:
            self.resume_device_alarms(t_ns)

    def reports(self, health: Fields) -> Iterator[ConditionReport]:
        """A report for each subject in the health message."""
        if health["session"].get("state") == "stopping":
            return
        t_ns = health["t_ns"]
        for subject, condition in self._conditions(health, t_ns):
            yield ConditionReport(t_ns, subject, condition)

    def _conditions(self, health: Fields, t_ns: int) -> Iterator[tuple[str, Condition | None]]:
        yield "recording", _recording(health)
        yield "space", self._space.assess(health["storage"], t_ns)
        yield "navigation", self._assess_navigation(health["processes"])
        yield "terrain loading", _terrain(health["navigation"])
        for name, process in health["processes"].items():
            yield f"process {name}", self._assess_restarts(name, process, t_ns)
        for name, link in health["links"].items():
            yield f"link {name}", self._assess_link(name, link, t_ns)
        if "hint" in health["navigation"] or (health["navigation"].get("lag_ms") or 0.0) > MAX_LAG_MS:
            return  # silent, or behind
        for name, device in health["devices"].items():
            if device.get("is_known", True):
                yield f"device {name}", self._assess_device(name, device, t_ns)

    def _assess_navigation(self, processes: Fields) -> Condition | None:
        if "navigation" not in processes:  # it runs in this process: an accelerated flight
            return None
        state = processes["navigation"]["state"]
        if state == ProcessState.RUNNING:
            self._navigation_ran = True
            return None
        if state in (ProcessState.STARTING, ProcessState.STOPPED) and not self._navigation_ran:
            cause = "its code is loaded (on a new machine: compiled); recording already runs"
            return Condition("navigation_starting", Severity.ADVISORY, "NAVIGATION STARTING", cause, is_latched=False)
        cause = f"its process is {state}; its last values are struck out; recording continues"
        return Condition("navigation", Severity.WARNING, "NAVIGATION STOPPED", cause)

    def _assess_restarts(self, name: str, process: Fields, t_ns: int) -> Condition | None:
        """The condition that a process was restarted several times in the last minute."""
        count, times = int(process.get("restarts") or 0), self._restarts.setdefault(name, deque())
        times.extend([t_ns] * (count - self._restarts_known.get(name, 0)))
        self._restarts_known[name] = count
        while times and t_ns - times[0] > RESTARTS_SPAN_NS:
            times.popleft()
        if len(times) < MIN_RESTARTS:
            return None
        cause = f"{len(times)} restarts in the last minute"
        title = f"{in_title(name)} FAILS REPEATEDLY"
        return Condition(f"process:{name}", Severity.CAUTION, title, cause, float(len(times)))

    def _assess_link(self, name: str, link: Fields, t_ns: int) -> Condition | None:
        state = link.get("port_state", link["state"])
        if state not in STOPPED_LINK_STATES:
            self._were_good.add(f"link:{name}")
            return None
        return self._find(f"link:{name}", f"LINK {in_title(name)} {state.upper()}", link, RECORDER_CAUSES, t_ns)

    def _assess_device(self, name: str, device: Fields, t_ns: int) -> Condition | None:
        state = device["state"]
        if state == LinkState.GOOD:
            self._were_good.add(device_id(name))
        if state != LinkState.WRONG_RATE:
            self._wrong_rate_ns.pop(name, None)
        is_counted = t_ns - self._wrong_rate_ns.setdefault(name, t_ns) >= RATE_COUNTED_NS
        if state == LinkState.GOOD or (state == LinkState.WRONG_RATE and not is_counted):
            return None
        causes = (f"link:{device.get('link')}", *RECORDER_CAUSES, *NAVIGATION_CAUSES)
        return self._find(device_id(name), f"DEVICE {in_title(name)} {state.upper()}", device, causes, t_ns)

    def _find(self, identity: str, title: str, fields: Fields, causes: tuple[str, ...], t_ns: int) -> Condition | None:
        """The condition of a link or device that is not good; None if that is expected."""
        if self._begin_ns is None or (identity not in self._were_good and t_ns - self._begin_ns < START_NS):
            return None
        cause = str(fields.get("hint") or "")
        return Condition(identity, Severity.CAUTION, title, cause, explained_by=causes)


class SpaceForecast:
    """Forecast of the recording time that the free space allows, from the growth of the files."""

    def __init__(self) -> None:
        self._free: deque[tuple[int, float]] = deque()
        self._is_short = False

    def assess(self, storage: Fields, t_ns: int) -> Condition | None:
        """The condition that the space lasts less than an hour; value : remaining time [s]"""
        free_mb = storage.get("free_mb")
        if not isinstance(free_mb, int | float) or storage.get("state") != "ok":
            self._free.clear()  # another medium, or none
            return None
        self._free.append((t_ns, float(free_mb)))
        while t_ns - self._free[0][0] > RATE_SPAN_NS:
            self._free.popleft()
        begin_ns, begin_mb = self._free[0]
        used_mb = begin_mb - free_mb
        if t_ns - begin_ns < MIN_RATE_SPAN_NS or used_mb <= 0.0:
            return None
        remaining_s = free_mb / used_mb * (t_ns - begin_ns) / SECOND_NS
        self._is_short = remaining_s < (SPACE_CLEAR_S if self._is_short else SPACE_ALARM_S)
        if not self._is_short:
            return None
        cause = f"{free_mb:.0f} MB are free, {used_mb / (t_ns - begin_ns) * SECOND_NS:.2f} MB/s are used"
        return Condition("space", Severity.CAUTION, "SPACE FOR LESS THAN AN HOUR", cause, remaining_s)


def find_losses(before: Fields, health: Fields) -> Iterable[Condition]:
    """Conditions for losses between two health messages."""
    counters = (
        ("dropped_frames", "losses", "DATA LOST", "frames were dropped"),
        ("stamp_refused", "stamps", "KERNEL STAMPS REFUSED", "frames have the time of the read"),
    )
    for key, name, title, text in counters:
        found = {
            link: int(fields.get(key) or 0) - int(before["links"].get(link, {}).get(key) or 0)
            for link, fields in health["links"].items()
        }
        if more := {link: count for link, count in found.items() if count > 0}:
            counts = ", ".join(f"{count} on {link}" for link, count in more.items())
            yield Condition(name, Severity.CAUTION, title, f"{text}: {counts}", float(sum(more.values())))


def _recording(health: Fields) -> Condition | None:
    storage, session = health["storage"], health["session"]
    state = "error" if session.get("state") == "storage_error" else str(storage.get("state", "ok"))
    recorder = health["processes"].get("recorder", {})
    process = recorder.get("state", ProcessState.RUNNING)
    if state == "ok" and process in (ProcessState.RESTARTING, ProcessState.STOPPED):
        return Condition("recording", Severity.WARNING, "NOT RECORDING", f"the recorder is {process}")
    if state == "ok" or (state == "opening" and not recorder.get("restarts")):  # the session begins
        return None
    severity, title = STORAGE.get(state, (Severity.CAUTION, f"STORAGE {state.upper()}"))
    name = "recording" if severity is Severity.WARNING else f"storage_{state}"
    return Condition(name, severity, title, str(storage.get("hint") or f"storage {state}"))


def _terrain(navigation: Fields) -> Condition | None:
    if not navigation.get("is_terrain_loading"):
        return None
    cause = "heights are not compared with it yet"
    return Condition("terrain_loading", Severity.ADVISORY, "TERRAIN LOADING", cause, is_latched=False)
