"""Composes health from the reports of recorder, navigation and supervisor, for display, bus and file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from fti.logger.storage import StorageState
from fti.messages.frames import LinkState
from fti.service.children import Child

#: Recorder and navigation report twice a second, the publish process once; an older report is not valid.
LATE_NS = 3_000_000_000
#: Navigation with a larger lag decodes answers late [ms].
MAX_LAG_MS = 500.0
#: Priority of the device states for the state of a link: the best one counts.
STATE_PRIORITY = (LinkState.GOOD, LinkState.WRONG_RATE, LinkState.INVALID, LinkState.NOISE, LinkState.SILENT)


@dataclass(slots=True)
class HealthBoard:
    """The last report of each process."""

    session: dict[str, Any]
    recorder: dict[str, Any] = field(default_factory=dict)
    navigation: dict[str, Any] = field(default_factory=dict)
    sinks: dict[str, Any] | None = None
    _last_navigation: dict[str, Any] = field(default_factory=dict)
    _last_navigation_ns: int = 0
    _last_sinks: dict[str, Any] | None = None
    _last_sinks_ns: int = 0

    def compose(self, now_ns: int, children: Iterable[Child]) -> dict[str, Any]:
        """One health message."""
        silent_ns = self._navigation_silence(now_ns)
        navigation, devices = self._assess_navigation(silent_ns)
        current_devices = devices if silent_ns <= LATE_NS else {}
        storage = self.recorder.get("storage", {})
        if hint := self._describe_silence(now_ns):
            storage = {**storage, "state": "error", "hint": hint}
        links = self._assess_links(now_ns)
        return {
            "t_ns": now_ns,
            "session": {**self.session, "state": _session_state(self.session["state"], storage.get("state"))},
            "processes": {c.name: {"state": c.state, "pid": c.pid, "restarts": c.restarts} for c in children},
            "links": {name: merge_link(name, link, current_devices) for name, link in links.items()},
            "devices": devices,
            "storage": storage,
            "snapshot": self.recorder.get("snapshot"),
            "navigation": navigation,
            **self._assess_sinks(now_ns),
        }

    def answer_delay_reason(self) -> str:
        """Why navigation may not have decoded a device's answer yet; "" if it should have."""
        lag_ms = self.navigation.get("navigation", {}).get("lag_ms")
        if lag_ms is None:
            return "navigation, which decodes the answers, is not ready yet"
        return f"navigation, which decodes the answers, is {lag_ms / 1000:.1f} s behind" if lag_ms > MAX_LAG_MS else ""

    def _navigation_silence(self, now_ns: int) -> int:
        """Time since the last report of navigation [ns]."""
        if self._last_navigation is not self.navigation:
            self._last_navigation, self._last_navigation_ns = self.navigation, now_ns
        return now_ns - self._last_navigation_ns

    def _assess_navigation(self, silent_ns: int) -> tuple[dict[str, Any], dict[str, Any]]:
        """Navigation and devices from its report; all are bad if the report is old."""
        navigation, devices = self.navigation.get("navigation", {}), self.navigation.get("devices", {})
        if silent_ns <= LATE_NS or not navigation:
            return navigation, devices
        hint = f"no report from navigation for {silent_ns / 1e9:.0f} s"
        late = {
            **navigation,
            "lag_ms": navigation["lag_ms"] + silent_ns / 1e6,
            "output_delay": None,
            "hint": hint,
        }
        constant = (
            f"no report from navigation for more than {LATE_NS / 1e9:.0f} s"  # constant, so that records do not change
        )
        stopped = {"state": LinkState.SILENT, "hint": constant, "clocks": []}
        return late, {name: {**device, **stopped} for name, device in devices.items()}

    def _assess_sinks(self, now_ns: int) -> dict[str, Any]:
        """Sinks from the report of the publish process, absent without one; all are silent if the report is old."""
        if self.sinks is None:
            return {}
        if self._last_sinks is not self.sinks:
            self._last_sinks, self._last_sinks_ns = self.sinks, now_ns
        if now_ns - self._last_sinks_ns <= LATE_NS:
            return {"sinks": self.sinks}
        silent = {
            "state": "silent",
            "hint": f"no report from publish for more than {LATE_NS / 1e9:.0f} s",
            "peers": None,
        }
        return {"sinks": {name: {**sink, **silent} for name, sink in self.sinks.items()}}

    def _assess_links(self, now_ns: int) -> dict[str, dict[str, Any]]:
        """Links from the report of the recorder; all are silent if the report is old."""
        links: dict[str, dict[str, Any]] = self.recorder.get("links", {})
        if hint := self._describe_silence(now_ns):
            return {
                name: {**link, "state": LinkState.SILENT, "hint": hint, "rate_hz": 0.0} for name, link in links.items()
            }
        return links

    def _describe_silence(self, now_ns: int) -> str:
        """A hint if the last report of the recorder is old; otherwise ""."""
        silent_ns = now_ns - self.recorder.get("t_ns", now_ns)
        return f"no report from the recorder for {silent_ns / 1e9:.0f} s" if silent_ns > LATE_NS else ""


def _session_state(state: str, storage: str | None) -> str:
    """State of the session, combined with the storage: "waiting" for the first file, "storage_error"."""
    if storage == StorageState.ERROR:
        return "storage_error"
    return "waiting" if storage == StorageState.OPENING and state == "recording" else state


def merge_link(name: str, link: dict[str, Any], devices: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """A link whose port is good gets the state of its best device.

    port_state : state of the port
    """
    link = {**link, "port_state": link["state"]}
    here = {n: d for n, d in devices.items() if d["link"] == name and d.get("is_known", True)}
    if link["state"] != LinkState.GOOD or not here:
        return link
    best = min(here.items(), key=lambda item: STATE_PRIORITY.index(LinkState(item[1]["state"])))
    hint = f"{best[0]}: {best[1]['hint']}" if best[1]["hint"] else link["hint"]
    return {**link, "state": best[1]["state"], "hint": hint}
