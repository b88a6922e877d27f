"""Shutdown of a session: ends the children, and closes files of killed sessions and killed children."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fti.buffers.ring import Ring
from fti.messages.control import ControlMessage, Hurry, Stop
from fti.service.children import Child, ProcessState
from fti.service.fault_guard import catch_failures
from fti.service.supervisor import child_shutdown
from fti.service.supervisor.child_monitor import ChildMonitor
from fti.service.supervisor.event_publisher import Announce, EventPublisher
from fti.service.supervisor.session_storage import SessionStorage

NAVIGATION_END_S = 20.0
DISPLAY_END_S = 3.0
#: States of the storage in which a storage target may block every access.
UNHEALTHY_STATES = ("opening", "slow", "gone", "fallback", "error")


class SessionShutdown:
    """Ends the children in order; ``hurry_requested`` shortens only the steps after the raw file.

    children : recorder, navigation, and the optional processes; recorded : the recorder has reported its stop
    """

    def __init__(
        self,
        children: list[Child],
        child_monitor: ChildMonitor,
        ring: Ring,
        session_storage: SessionStorage,
        announce: Announce,
    ) -> None:
        self.hurry_requested = asyncio.Event()
        self.recorded = asyncio.Event()
        self._children = children
        self._child_monitor = child_monitor
        self._ring = ring
        self._session_storage = session_storage
        self._announce = announce

    async def end_recording(self) -> None:
        """End recorder and navigation; no child is restarted."""
        self._child_monitor.stopping = True
        recorder, navigation, *_ = self._children
        await self._end_recorder(recorder)
        await self._end_child(navigation, Hurry(), NAVIGATION_END_S)

    async def end_display(self) -> None:
        """End the processes that show the recording."""
        for child in self._children[2:]:
            if child.channel:
                child.channel.send(Stop())
            await self._end_child(child, Stop(), DISPLAY_END_S)

    async def _end_recorder(self, recorder: Child) -> None:
        """End the recorder without a timeout: its buffers must be written."""
        if recorder.channel:
            recorder.channel.send(Stop())
        code = await child_shutdown.await_recorder(recorder, self.recorded, self._announce)
        self._child_monitor.drain_messages(recorder)
        if code:
            self._announce(
                f"error: recorder: ended with {child_shutdown.describe_exit(code)} before it closed its files"
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
        """Close files of sessions of earlier starts, after this session records."""
        await recording.wait()
        with catch_failures("repair", event_publisher.report):
            for level, text in await asyncio.to_thread(
                self._session_storage.close_killed_sessions, lambda: not self.hurry_requested.is_set()
            ):
                event_publisher.publish_event(level, "repair", text)

    def close_own_files(self, storage: Mapping[str, Any]) -> None:
        """Close open files of killed children on working media; remove the folder of a session that did not begin.

        storage : last storage health of the recorder
        """
        healthy_folders = self._session_storage.folders
        if storage.get("state") in UNHEALTHY_STATES:
            healthy_folders = [folder for folder in healthy_folders if folder == Path(storage["file"] or "").parent]
        with catch_failures("repair", lambda unit, error: self._announce(f"error: {unit}: {error}")):
            for level, text in self._session_storage.close_files(healthy_folders):
                self._announce(f"{level}: repair: {text}")
