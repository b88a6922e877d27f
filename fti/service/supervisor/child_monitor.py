"""The children of the supervisor: started, heard, and started again when they have died."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from fti.service.children import Child
from fti.service.control_channel import ControlMessage
from fti.service.fault_guard import FailureHandler, catch_failures

WATCH_PERIOD_S = 0.02
#: Notes that wait for a recorder while there is none.
MAX_WAITING_NOTES = 1000


class ChildMonitor:
    """Keeps children alive until ``stopping`` is set.

    hear    : gets each message of a child
    started : told after each start
    died    : told the exit code, when the last words were heard; what it must not do is start the child
    """

    def __init__(
        self,
        children: Sequence[Child],
        *,
        on_message: Callable[[Child, ControlMessage], None],
        started: Callable[[Child], None],
        died: Callable[[Child, int], None],
        report: FailureHandler,
    ) -> None:
        self._children = children
        self._on_message, self._started, self._died = on_message, started, died
        self._report = report
        self.stopping = False

    def start(self, child: Child) -> None:
        """Start a child and listen to it."""
        channel = child.start()
        asyncio.get_running_loop().add_reader(channel.fileno(), self._listen, child)
        self._started(child)

    async def watch(self) -> None:
        """Start again what has died."""
        while True:
            for child in self._children:
                with catch_failures(child.name, self._report):
                    self._check_child(child)
            await asyncio.sleep(WATCH_PERIOD_S)

    def drain_messages(self, child: Child) -> None:
        """Take the last words of a child that has ended, and close its channel."""
        self._listen(child)
        if child.channel:
            asyncio.get_running_loop().remove_reader(child.channel.fileno())
            child.close()

    def _listen(self, child: Child) -> None:
        channel = child.channel
        if channel is None:
            return
        for message in channel.receive():
            with catch_failures(child.name, self._report):
                self._on_message(child, message)
        if channel.ended:
            asyncio.get_running_loop().remove_reader(channel.fileno())

    def _check_child(self, child: Child) -> None:
        code = child.died()
        if code is not None:
            self.drain_messages(child)
            self._died(child, code)
        if not self.stopping and child.restart_is_due():
            child.restarts += 1
            self.start(child)
        if not self.stopping:
            child.ensure_standby()


class RecorderOutbox:
    """Notes for the recorder; while there is none they wait, and the oldest go."""

    def __init__(self, recorder: Child) -> None:
        self._recorder = recorder
        self._waiting: deque[ControlMessage] = deque(maxlen=MAX_WAITING_NOTES)
        self._held = False

    def note(self, topic: str, t_ns: int, content: dict[str, Any]) -> None:
        """Have a JSON message recorded.  t_ns : FTI time of it"""
        message = {"note": {"topic": topic, "t_ns": t_ns, "content": content}}
        if self._held or not self.send(message):
            self._waiting.append(message)

    def send(self, message: ControlMessage) -> bool:
        """Tell the recorder something now; False when there is none."""
        channel = self._recorder.channel
        return channel is not None and channel.send(message)

    def pause(self) -> None:
        """The recorder does not move: what it is sent now may never be recorded."""
        self._held = True

    def resume(self) -> None:
        """There is a recorder again, or it moves again."""
        self._held = False
        while self._waiting and self.send(self._waiting[0]):
            self._waiting.popleft()
