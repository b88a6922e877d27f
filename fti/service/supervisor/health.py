"""Health: what recorder, navigation and supervisor know, put together for the display, the bus and the file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from fti.logger.storage import StorageState
from fti.service.children import Child
from fti.types import LinkState

#: Recorder and navigation report twice a second; what they said longer ago is not true any more.
LATE_NS = 3_000_000_000
#: A navigation that is later than that hears an answer late [ms].
BEHIND_MS = 500.0
#: Order in which the state of a link's devices becomes the state of the link: the best one counts.
STATE_PRIORITY = (LinkState.GOOD, LinkState.WRONG_RATE, LinkState.INVALID, LinkState.NOISE, LinkState.SILENT)


@dataclass(slots=True)
class HealthBoard:
    """The last word of each process."""

    session: dict[str, Any]
    recorder: dict[str, Any] = field(default_factory=dict)
    navigation: dict[str, Any] = field(default_factory=dict)
    _last_navigation: dict[str, Any] = field(default_factory=dict)
    _last_navigation_ns: int = 0

    def compose(self, now_ns: int, children: Iterable[Child]) -> dict[str, Any]:
        """One health message."""
        silent_ns = self._navigation_silence(now_ns)
        navigation, devices = self._judge_navigation(silent_ns)
        heard = devices if silent_ns <= LATE_NS else {}
        storage = self._judge_storage(now_ns)
        links = self._judge_links(now_ns)
        return {
            "t_ns": now_ns,
            "session": {**self.session, "state": _session_state(self.session["state"], storage.get("state"))},
            "processes": {c.name: {"state": c.state, "pid": c.pid, "restarts": c.restarts} for c in children},
            "links": {name: merge_link(name, link, heard) for name, link in links.items()},
            "devices": devices,
            "storage": storage,
            "snapshot": self.recorder.get("snapshot"),
            "navigation": navigation,
        }

    def answer_delay_reason(self) -> str:
        """Why a device's answer may not have come out of navigation yet; "" when it should have."""
        lag_ms = self.navigation.get("navigation", {}).get("lag_ms")
        if lag_ms is None:
            return "navigation, which reads the answers, is not ready yet"
        return f"navigation, which reads the answers, is {lag_ms / 1000:.1f} s behind" if lag_ms > BEHIND_MS else ""

    def _navigation_silence(self, now_ns: int) -> int:
        """Time since navigation said something new [ns]."""
        if self._last_navigation is not self.navigation:
            self._last_navigation, self._last_navigation_ns = self.navigation, now_ns
        return now_ns - self._last_navigation_ns

    def _judge_navigation(self, silent_ns: int) -> tuple[dict[str, Any], dict[str, Any]]:
        """What navigation said of itself and of the devices; of a stopped one nothing is good any more."""
        navigation, devices = self.navigation.get("navigation", {}), self.navigation.get("devices", {})
        if silent_ns <= LATE_NS or not navigation:
            return navigation, devices
        hint = f"navigation has said nothing for {silent_ns / 1e9:.0f} s"
        late = {
            **navigation,
            "lag_ms": navigation["lag_ms"] + silent_ns / 1e6,
            "output_delay": None,
            "hint": hint,
        }
        constant = f"navigation has said nothing for more than {LATE_NS / 1e9:.0f} s"  # not a change in every record
        gone = {"state": LinkState.SILENT, "hint": constant, "clocks": []}
        return late, {name: {**device, **gone} for name, device in devices.items()}

    def _judge_storage(self, now_ns: int) -> dict[str, Any]:
        """What the recorder said of the storage, unless that is long ago: late is not valid."""
        storage: dict[str, Any] = self.recorder.get("storage", {})
        hint = self._describe_silence(now_ns)
        return {**storage, "state": "error", "hint": hint} if hint else storage

    def _judge_links(self, now_ns: int) -> dict[str, dict[str, Any]]:
        """What the recorder said of the links; of one that says nothing any more none is good."""
        links: dict[str, dict[str, Any]] = self.recorder.get("links", {})
        if hint := self._describe_silence(now_ns):
            return {
                name: {**link, "state": LinkState.SILENT, "hint": hint, "rate_hz": 0.0} for name, link in links.items()
            }
        return links

    def _describe_silence(self, now_ns: int) -> str:
        """That the recorder has said nothing for long; "" when it has."""
        silent_ns = now_ns - self.recorder.get("t_ns", now_ns)
        return f"the recorder has said nothing for {silent_ns / 1e9:.0f} s" if silent_ns > LATE_NS else ""


def _session_state(state: str, storage: str | None) -> str:
    """The session as the storage lets it be: "waiting" for the first file, "storage_error"."""
    if storage == StorageState.ERROR:
        return "storage_error"
    return "waiting" if storage == StorageState.OPENING and state == "recording" else state


def merge_link(name: str, link: dict[str, Any], devices: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """A link that hears bytes is as good as the best of its devices; what the port says comes first.

    port_state : what the port says
    """
    link = {**link, "port_state": link["state"]}
    here = {n: d for n, d in devices.items() if d["link"] == name and d.get("is_known", True)}
    if link["state"] != LinkState.GOOD or not here:
        return link
    best = min(here.items(), key=lambda item: STATE_PRIORITY.index(LinkState(item[1]["state"])))
    hint = f"{best[0]}: {best[1]['hint']}" if best[1]["hint"] else link["hint"]
    return {**link, "state": best[1]["state"], "hint": hint}
