"""Base class of serial endpoints: writes messages to a descriptor at the pace of the line, and answers input.

Messages that kernel or line do not accept are queued.  The queue is limited: beyond BACKLOG_BYTES behind a full
descriptor, and beyond BUFFER_S and BUFFER_BYTES of a line that is too slow, the oldest whole messages are dropped and
counted.  One notification is sent until the queue is empty again.  The loss of a port in flight (an adapter is pulled
out) is notified and its messages are dropped; the other devices continue.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

from fti.hil.ports.counters import EndpointCounters
from fti.hil.ports.pacing import LinePacer, PacedMessage

#: Limits of the queue behind a full descriptor [bytes], and behind a slow line: a typical output buffer of a device.
BACKLOG_BYTES = 16384
BUFFER_BYTES, BUFFER_S = 4096, 1.0

#: Returns the answers of a device to bytes; receives messages for the user.
Responder = Callable[[bytes], list[bytes]]
Notifier = Callable[[str], None]


class SerialEndpoint(ABC):
    """An endpoint on a descriptor that ``open`` puts into ``_fd``.

    name          : of the link; respond : returns the answers of the device to bytes from the daemon
    byte_s        : transmission time of a byte [s]; 0 : no limit
    capacity_text : capacity of the line as text
    """

    is_stream: ClassVar[bool] = True

    def __init__(self, name: str, respond: Responder, byte_s: float, capacity_text: str, notify: Notifier) -> None:
        self.counters = EndpointCounters()
        self._name, self._respond, self._notify = name, respond, notify
        self._byte_s, self._capacity_text = byte_s, capacity_text
        self._fd = -1
        self._pacer = LinePacer()
        self._space = asyncio.Event()
        self._is_full = False  # the buffer of the kernel is full
        self._is_behind = False  # messages were dropped, and the queue has not been empty since
        self._is_lost = False  # the port was lost
        self._timer: asyncio.TimerHandle | None = None

    @abstractmethod
    async def open(self) -> None:
        """Open the port."""

    def send(self, data: bytes) -> None:
        """Send or queue a message."""
        self._queue(PacedMessage(data, len(data) * self._byte_s, whole=False))

    async def send_all(self, data: bytes) -> None:
        """Send a message without losing any; wait while the line is full."""
        self._pacer.add(PacedMessage(data, 0.0, whole=False), self._now())
        self._flush()
        while self._pacer:
            self._space.clear()
            await self._space.wait()

    def _queue(self, message: PacedMessage) -> None:
        if self._is_lost:
            self._drop(len(message.data))
            return
        is_first = not self._pacer
        self._pacer.add(message, self._now())
        if is_first or self._timer is None:  # else the line is busy, and the timer is set
            self._flush()
        while self._is_overfull():
            self._drop_oldest()

    def _is_overfull(self) -> bool:
        pacer = self._pacer
        if self._is_full:
            return pacer.waiting_bytes > BACKLOG_BYTES
        return pacer.waiting_bytes > BUFFER_BYTES and pacer.waiting_s > BUFFER_S and len(pacer) > 1

    def _drop_oldest(self) -> None:
        self._drop(len(self._pacer.drop_oldest().data))
        if not self._is_full:
            self.counters.too_slow_messages += 1
        if not self._is_behind:
            reason = "no program reads it" if self._is_full else f"{self._capacity_text}, and its devices send more"
            self._notify(f"{self._name}: {reason}; the oldest messages are dropped")
            self._is_behind = True

    def _drop(self, count: int) -> None:
        self.counters.dropped_messages += 1
        self.counters.dropped_bytes += count

    def _flush(self) -> None:
        """Write the bytes that line and kernel accept now; schedule the next call."""
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
        """Write the bytes that are due; True when the buffer of the kernel is full."""
        due, written = self._pacer.due(now), 0
        if due:
            with contextlib.suppress(BlockingIOError):
                written = os.write(self._fd, due)
        self.counters.bytes += written
        self.counters.messages += self._pacer.mark_written(written)
        return written < len(due)

    def _on_port_lost(self, reason: str) -> None:
        """Drop queued messages, and all later ones."""
        self._unregister()
        if not self._is_lost:
            self._notify(f"{self._name}: the port is lost: {reason}; its messages are dropped")
        self._is_lost = True
        while self._pacer:
            self._drop(len(self._pacer.drop_oldest().data))
        self._space.set()

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
            self._on_port_lost("hang-up")
            return
        self.counters.received_bytes += len(data)
        for answer in self._respond(data):
            self.send(answer)

    def _unregister(self) -> None:
        """Remove the descriptor from the event loop before it is closed."""
        if self._timer is not None:
            self._timer.cancel()
        loop = asyncio.get_running_loop()
        loop.remove_reader(self._fd)
        loop.remove_writer(self._fd)

    #: The clock of the loop.
    _now = staticmethod(time.monotonic)
