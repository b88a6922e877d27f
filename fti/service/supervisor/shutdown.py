"""The end of a session: recorder, navigation, display, and what was left open by others and by our own dead."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fti.buffers.ring import Ring
from fti.service.children import Child, ProcessState
from fti.service.control_channel import ControlMessage
from fti.service.fault_guard import catch_failures
from fti.service.supervisor import child_shutdown
from fti.service.supervisor.child_monitor import ChildMonitor
from fti.service.supervisor.event_publisher import Announce, EventPublisher
from fti.service.supervisor.session_storage import SessionStorage

NAVIGATION_END_S = 20.0
DISPLAY_END_S = 3.0
#: States of the storage in which a place may hold whoever looks at it.
UNHEALTHY_STATES = ("opening", "slow", "gone", "fallback", "error")


class SessionShutdown:
    """Ends the children in good order; ``hurry_requested`` shortens what comes after the raw file, never what comes before.

    children : recorder, navigation, and the display if there is one; recorded : the recorder has said that it stopped
    """

    def __init__(
        self, children: list[Child], child_monitor: ChildMonitor, ring: Ring, places: SessionStorage, announce: Announce
    ) -> None:
        self.hurry_requested = asyncio.Event()
        self.recorded = asyncio.Event()
        self._children = children
        self._child_monitor = child_monitor
        self._ring = ring
        self._places = places
        self._announce = announce

    async def end_children(self) -> None:
        """Recorder, navigation, display; nobody is started again any more."""
        self._child_monitor.stopping = True
        recorder, navigation, *display = self._children
        await self._end_recorder(recorder)
        await self._end_child(navigation, {"hurry": True}, NAVIGATION_END_S)
        for child in display:
            if child.channel:
                child.channel.send({"stop": True})
            await self._end_child(child, {"stop": True}, DISPLAY_END_S)

    async def _end_recorder(self, recorder: Child) -> None:
        """However long it takes: what the buffers hold must come to the medium."""
        if recorder.channel:
            recorder.channel.send({"stop": True})
        code = await child_shutdown.await_recorder(recorder, self.recorded, self._announce)
        self._child_monitor.drain_messages(recorder)
        if code:
            self._announce(
                f"error: recorder: ended with {child_shutdown.describe_exit(code)} before it had closed its files"
            )
        if not self.recorded.is_set():
            self._ring.end()
        recorder.state = ProcessState.STOPPED

    async def _end_child(self, child: Child, shorten: ControlMessage, timeout_s: float) -> None:
        await child_shutdown.end_child(
            child, timeout_s, self._announce, lambda: shorten if self.hurry_requested.is_set() else None
        )
        self._child_monitor.drain_messages(child)

    async def close_killed_sessions(self, recording: asyncio.Event, event_publisher: EventPublisher) -> None:
        """Those of other starts.  Not before this session records."""
        await recording.wait()
        with catch_failures("repair", event_publisher.report):
            for level, text in await asyncio.to_thread(
                self._places.close_others, lambda: not self.hurry_requested.is_set()
            ):
                event_publisher.event(level, "repair", text)

    def close_own_files(self, storage: Mapping[str, Any]) -> None:
        """What a killed child left open, where the medium is well; a session that has not begun leaves nothing.

        storage : what the recorder said last of its storage
        """
        healthy_folders = self._places.folders
        if storage.get("state") in UNHEALTHY_STATES:
            healthy_folders = [folder for folder in healthy_folders if folder == Path(storage["file"] or "").parent]
        with catch_failures("repair", self._report_to_user):
            for level, text in self._places.close_files(healthy_folders):
                self._announce(f"{level}: repair: {text}")

    def _report_to_user(self, unit: str, error: Exception) -> None:
        self._announce(f"error: {unit}: {error}")
