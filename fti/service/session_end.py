"""The end of a session: recorder, navigation, display, and what was left open by others and by our own dead."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fti.buffers.ring import Ring
from fti.service import ending
from fti.service.bulletin import Announce, Bulletin
from fti.service.children import Child, ProcessState
from fti.service.control import Message
from fti.service.guard import guarded
from fti.service.keeping import Keeper
from fti.service.session_places import SessionPlaces

NAVIGATION_END_S = 20.0
DISPLAY_END_S = 3.0
#: States of the storage in which a place may hold whoever looks at it.
SICK = ("opening", "slow", "gone", "fallback", "error")


class SessionEnd:
    """Ends the children in good order; ``hurry`` shortens what comes after the raw file, never what comes before.

    children : recorder, navigation, and the display if there is one; recorded : the recorder has said that it stopped
    """

    def __init__(
        self, children: list[Child], keeper: Keeper, ring: Ring, places: SessionPlaces, announce: Announce
    ) -> None:
        self.hurry = asyncio.Event()
        self.recorded = asyncio.Event()
        self._children = children
        self._keeper = keeper
        self._ring = ring
        self._places = places
        self._announce = announce

    async def end_children(self) -> None:
        """Recorder, navigation, display; nobody is started again any more."""
        self._keeper.stopping = True
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
        code = await ending.await_recorder(recorder, self.recorded, self._announce)
        self._keeper.hear_out(recorder)
        if code:
            self._announce(f"error: recorder: ended with {ending.describe_exit(code)} before it had closed its files")
        if not self.recorded.is_set():
            self._ring.end()
        recorder.state = ProcessState.STOPPED

    async def _end_child(self, child: Child, shorten: Message, patience_s: float) -> None:
        await ending.end_child(child, patience_s, self._announce, lambda: shorten if self.hurry.is_set() else None)
        self._keeper.hear_out(child)

    async def close_killed_sessions(self, recording: asyncio.Event, bulletin: Bulletin) -> None:
        """Those of other starts.  Not before this session records."""
        await recording.wait()
        with guarded("repair", bulletin.report):
            for level, text in await asyncio.to_thread(self._places.close_others, lambda: not self.hurry.is_set()):
                bulletin.event(level, "repair", text)

    def close_own_files(self, storage: Mapping[str, Any]) -> None:
        """What a killed child left open, where the medium is well; a session that has not begun leaves nothing.

        storage : what the recorder said last of its storage
        """
        well = self._places.folders
        if storage.get("state") in SICK:
            well = [folder for folder in well if folder == Path(storage["file"] or "").parent]
        with guarded("repair", self._report_to_user):
            for level, text in self._places.close_files(well):
                self._announce(f"{level}: repair: {text}")

    def _report_to_user(self, unit: str, error: Exception) -> None:
        self._announce(f"error: {unit}: {error}")
