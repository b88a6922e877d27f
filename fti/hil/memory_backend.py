"""Clock and ports of an emulator in memory: the clock jumps from one instant to the next, and nothing waits.

Not modelled: transmission time at the baud rate, status of controllers and adapters, and kernel timestamps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import ClassVar

from fti.clock import Clock, FakeClock
from fti.config import Link
from fti.constants import SECOND_NS
from fti.hil.ports.counters import EndpointCounters
from fti.hil.ports.endpoints import Endpoint
from fti.hil.ports.serial_base import Responder
from fti.hil.scheduler import Stream

#: FTI time at the beginning of every flight: 2026-01-01, 00:00 UTC.
BEGIN_NS = 1_767_225_600 * SECOND_NS


class MemoryEndpoint:
    """A link in memory: messages are received at once."""

    is_stream: ClassVar[bool] = False

    def __init__(self, receive: Callable[[bytes], None]) -> None:
        self.counters = EndpointCounters()
        self._receive = receive

    async def open(self) -> None:
        """Nothing to open."""

    async def wait_for_reader(self) -> None:
        """Return at once: the receiver is always present."""

    def send(self, data: bytes) -> None:
        """Hand over."""
        self.counters.messages += 1
        self.counters.bytes += len(data)
        self._receive(data)

    async def send_all(self, data: bytes) -> None:
        """Hand over."""
        self.send(data)

    async def drain(self) -> None:
        """Return at once: nothing is queued."""

    def close(self) -> None:
        """Nothing to close."""


class MemoryStreamEndpoint(MemoryEndpoint):
    """A serial line in memory."""

    is_stream: ClassVar[bool] = True


class MemoryBackend:
    """Clock and endpoints of an offline flight.

    receive : gets each message with the name of its link; streams : in addition to those of the devices
    """

    is_real_time: ClassVar[bool] = False

    def __init__(self, receive: Callable[[str, bytes], None], streams: Sequence[Stream]) -> None:
        self._time = FakeClock(BEGIN_NS)
        self.clock: Clock = self._time
        self._receive, self._streams = receive, streams

    def make_endpoint(self, link: Link, respond: Responder) -> Endpoint:
        """An endpoint in memory.  ``respond`` is not used, because the chain sends nothing."""
        kind = MemoryStreamEndpoint if link.kind == "serial" else MemoryEndpoint
        return kind(lambda data: self._receive(link.name, data))

    async def sleep(self, seconds: float) -> None:
        """Advance the clock, rounded up to a whole nanosecond."""
        self._time.time_ns += math.ceil(seconds * SECOND_NS)

    def streams(self, start_ns: int) -> Sequence[Stream]:
        """Those of the constructor."""
        return self._streams
