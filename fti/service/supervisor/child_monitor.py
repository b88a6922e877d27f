"""Starts the children of the supervisor, receives their messages, and restarts them."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Sequence

from fti.messages.control import FromChild, RecorderNote, ToRecorder
from fti.service.children import Child
from fti.service.fault_guard import FailureHandler, catch_failures

WATCH_PERIOD_S = 0.02
#: Maximum number of queued notes while there is no recorder.
MAX_WAITING_NOTES = 1000


class ChildMonitor:
    """Restarts children until ``stopping`` is set.

    on_message : called with each message of a child
    on_start   : called after each start
    on_exit    : called with the exit code, after the last message; it must not start the child
    """

    def __init__(
        self,
        children: Sequence[Child],
        *,
        on_message: Callable[[Child, FromChild], None],
        on_start: Callable[[Child], None],
        on_exit: Callable[[Child, int], None],
        report: FailureHandler,
    ) -> None:
        self._children = children
        self._on_message, self._on_start, self._on_exit = on_message, on_start, on_exit
        self._report = report
        self.stopping = False

    def start(self, child: Child) -> None:
        """Start a child and receive its messages."""
        channel = child.start()
        asyncio.get_running_loop().add_reader(channel.fileno(), self._listen, child)
        self._on_start(child)

    async def watch(self) -> None:
        """Restart children that have ended."""
        while True:
            for child in self._children:
                with catch_failures(child.name, self._report):
                    self._check_child(child)
            await asyncio.sleep(WATCH_PERIOD_S)

    def drain_messages(self, child: Child) -> None:
        """Handle the last messages of a child that has ended, and close its channel."""
        self._listen(child)
        if child.channel:
            asyncio.get_running_loop().remove_reader(child.channel.fileno())
            child.close()

    def _listen(self, child: Child) -> None:
        channel = child.channel
        if channel is None:
            return
        for message in channel.receive(lambda error: self._report(child.name, error)):
            with catch_failures(child.name, self._report):
                self._on_message(child, message)
        if channel.has_ended:
            asyncio.get_running_loop().remove_reader(channel.fileno())

    def _check_child(self, child: Child) -> None:
        code = child.poll_exit()
        if code is not None:
            self.drain_messages(child)
            self._on_exit(child, code)
        if not self.stopping and child.restart_is_due():
            child.restarts += 1
            self.start(child)
        if not self.stopping:
            child.ensure_standby()


class RecorderOutbox:
    """Notes for the recorder; without a recorder they are queued, and the oldest are dropped."""

    def __init__(self, recorder: Child) -> None:
        self._recorder = recorder
        self._waiting: deque[RecorderNote] = deque(maxlen=MAX_WAITING_NOTES)
        self._is_paused = False

    def add_note(self, note: RecorderNote) -> None:
        """Send a note for recording."""
        if self._is_paused or not self.send(note):
            self._waiting.append(note)

    def send(self, message: ToRecorder) -> bool:
        """Send a message to the recorder now; False without a recorder."""
        channel = self._recorder.channel
        return channel is not None and channel.send(message)

    def pause(self) -> None:
        """Queue notes: the recorder does not run, and might never record them."""
        self._is_paused = True

    def resume(self) -> None:
        """Send the queued notes: the recorder runs again."""
        self._is_paused = False
        while self._waiting and self.send(self._waiting[0]):
            self._waiting.popleft()
