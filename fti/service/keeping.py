"""The children of the supervisor: started, heard, and started again when they have died."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from fti.service.children import Child
from fti.service.control import Message
from fti.service.guard import Report, guarded

WATCH_PERIOD_S = 0.02
#: Notes that wait for a recorder while there is none.
MOST_UNRECORDED = 1000


class Keeper:
    """Keeps children alive until ``stopping`` is set.

    hear    : gets each message of a child
    started : told after each start
    died    : told the exit code, when the last words were heard; what it must not do is start the child
    """

    def __init__(
        self,
        children: Sequence[Child],
        *,
        hear: Callable[[Child, Message], None],
        started: Callable[[Child], None],
        died: Callable[[Child, int], None],
        report: Report,
    ) -> None:
        self._children = children
        self._hear, self._started, self._died = hear, started, died
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
                with guarded(child.name, self._report):
                    self._look_after(child)
            await asyncio.sleep(WATCH_PERIOD_S)

    def hear_out(self, child: Child) -> None:
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
            with guarded(child.name, self._report):
                self._hear(child, message)
        if channel.ended:
            asyncio.get_running_loop().remove_reader(channel.fileno())

    def _look_after(self, child: Child) -> None:
        code = child.died()
        if code is not None:
            self.hear_out(child)
            self._died(child, code)
        if not self.stopping and child.restart_is_due():
            child.restarts += 1
            self.start(child)
        if not self.stopping:
            child.tend_stand_in()


class RecorderMail:
    """Notes for the recorder; while there is none they wait, and the oldest go."""

    def __init__(self, recorder: Child) -> None:
        self._recorder = recorder
        self._waiting: deque[Message] = deque(maxlen=MOST_UNRECORDED)
        self._held = False

    def note(self, topic: str, t_ns: int, content: dict[str, Any]) -> None:
        """Have a JSON message recorded.  t_ns : FTI time of it"""
        message = {"note": {"topic": topic, "t_ns": t_ns, "content": content}}
        if self._held or not self.send(message):
            self._waiting.append(message)

    def send(self, message: Message) -> bool:
        """Tell the recorder something now; False when there is none."""
        channel = self._recorder.channel
        return channel is not None and channel.send(message)

    def hold(self) -> None:
        """The recorder does not move: what it is sent now may never be recorded."""
        self._held = True

    def go_on(self) -> None:
        """There is a recorder again, or it moves again."""
        self._held = False
        while self._waiting and self.send(self._waiting[0]):
            self._waiting.popleft()
