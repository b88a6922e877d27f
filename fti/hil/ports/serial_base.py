"""What every serial far end does: hand messages to a descriptor at the pace of the wire, and answer what comes.

What the kernel or the wire does not take waits here, and that is bounded: beyond BACKLOG_BYTES behind a full
descriptor, and beyond a second or BUFFER_BYTES of a wire that is too slow, the oldest whole messages are dropped,
counted and told once, until everything that waited has left.  A port that goes away in flight (an adapter is pulled
out) is told, and what its devices send is dropped: the others fly on.
"""

from __future__ import annotations

import asyncio
import os
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

from fti.hil.ports.counters import EndpointCounters
from fti.hil.ports.pacing import LinePacer, PacedMessage

#: Bytes that may wait behind a full descriptor, and behind a slow wire: what a device's own output buffer holds.
BACKLOG_BYTES = 16384
BUFFER_BYTES, BUFFER_S = 4096, 1.0

#: What a device answers to bytes; what is told to the person at the bench.
Responder = Callable[[bytes], list[bytes]]
Notifier = Callable[[str], None]


class SerialEndpoint(ABC):
    """A far end behind a descriptor that ``open`` puts into ``_fd``.

    name    : of the link; respond : what the device answers to bytes from the daemon
    byte_s  : how long a byte takes [s]; 0 : as fast as the kernel takes it
    carries : what the line carries, in words
    """

    is_stream: ClassVar[bool] = True

    def __init__(self, name: str, respond: Responder, byte_s: float, capacity_text: str, notify: Notifier) -> None:
        self.counters = EndpointCounters()
        self._name, self._respond, self._byte_s, self._capacity_text, self._notify = (
            name,
            respond,
            byte_s,
            capacity_text,
            notify,
        )
        self._fd = -1
        self._pacer = LinePacer()
        self._space = asyncio.Event()
        self._is_full = False  # the kernel takes nothing more
        self._is_behind = False  # something was dropped, and since then something has always waited
        self._is_gone = False  # the port went away
        self._timer: asyncio.TimerHandle | None = None

    @abstractmethod
    async def open(self) -> None:
        """Make the port."""

    def send(self, data: bytes) -> None:
        """Send a message, or queue it."""
        self._queue(PacedMessage(data, len(data) * self._byte_s, whole=False))

    async def send_all(self, data: bytes) -> None:
        """Send a message without losing any; wait while the line is full."""
        self._pacer.add(PacedMessage(data, 0.0, whole=False), self._now())
        self._flush()
        while self._pacer:
            self._space.clear()
            await self._space.wait()

    def _queue(self, message: PacedMessage) -> None:
        if self._is_gone:
            self._drop(len(message.data))
            return
        is_first = not self._pacer
        self._pacer.add(message, self._now())
        if is_first or self._timer is None:  # else the wire is busy, and the next look at it is due already
            self._flush()
        while self._is_overfull():
            self._drop_oldest()

    def _is_overfull(self) -> bool:
        wire = self._pacer
        if self._is_full:
            return wire.waiting_bytes > BACKLOG_BYTES
        return wire.waiting_bytes > BUFFER_BYTES and wire.waiting_s > BUFFER_S and len(wire) > 1

    def _drop_oldest(self) -> None:
        self._drop(len(self._pacer.drop_oldest().data))
        if not self._is_full:
            self.counters.too_slow_messages += 1
        if not self._is_behind:
            why = "nobody reads it" if self._is_full else f"{self._capacity_text}, and its devices send more"
            self._notify(f"{self._name}: {why}; the oldest messages are dropped")
            self._is_behind = True

    def _drop(self, count: int) -> None:
        self.counters.dropped_messages += 1
        self.counters.dropped_bytes += count

    def _flush(self) -> None:
        """Write what wire and kernel take; come back when they take more."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._set_full(False)
        now = self._now()
        try:
            self._set_full(self._hand_over(now))
        except OSError as error:
            self._on_port_lost(str(error.strerror))
        if self._is_full:
            return
        if self._pacer:
            self._timer = asyncio.get_running_loop().call_at(self._pacer.next_s(now), self._flush)
        else:
            self._is_behind = False
            self._space.set()

    def _hand_over(self, now: float) -> bool:
        """Write what has left the wire; true when the kernel takes no more."""
        due = self._pacer.due(now)
        written = self._write(due) if due else 0
        self.counters.messages += self._pacer.mark_written(written)
        return written < len(due)

    def _on_port_lost(self, why: str) -> None:
        """The port is gone: drop what waits, and what comes."""
        self._unregister()
        if not self._is_gone:
            self._notify(f"{self._name}: the port is gone: {why}; what is sent on it is dropped")
        self._is_gone = True
        while self._pacer:
            self._drop(len(self._pacer.drop_oldest().data))
        self._space.set()

    def _write(self, data: bytes) -> int:
        try:
            written = os.write(self._fd, data)
        except BlockingIOError:
            return 0
        self.counters.bytes += written
        return written

    def _set_full(self, full: bool) -> None:
        if full != self._is_full:
            loop = asyncio.get_running_loop()
            if full:
                loop.add_writer(self._fd, self._flush)
            else:
                loop.remove_writer(self._fd)
            self._is_full = full

    def _start_reading(self) -> None:
        asyncio.get_running_loop().add_reader(self._fd, self._receive)

    def _receive(self) -> None:
        try:
            data = os.read(self._fd, 4096)
        except BlockingIOError:
            return
        except OSError as error:
            self._on_port_lost(str(error.strerror))
            return
        if not data:
            self._on_port_lost("it was hung up")
            return
        self.counters.received_bytes += len(data)
        for answer in self._respond(data):
            self.send(answer)

    def _unregister(self) -> None:
        """Let the loop forget the descriptor, before it is closed."""
        if self._timer is not None:
            self._timer.cancel()
        loop = asyncio.get_running_loop()
        loop.remove_reader(self._fd)
        loop.remove_writer(self._fd)

    #: The clock of the loop.
    _now = staticmethod(time.monotonic)
