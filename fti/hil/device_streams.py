"""What the emulator hands to the scheduler: the messages of each device, a node that babbles, troubles of adapters."""

from __future__ import annotations

import time
from collections.abc import Sequence

from fti.canframe import STANDARD_MASK, pack_can
from fti.hil.device_pipeline import DevicePipeline
from fti.hil.ports.endpoints import Endpoint, SlcanEndpoint
from fti.hil.rate_statistics import Meter
from fti.hil.tables.fault_types import Babbling, BusOff, CanStatus
from fti.links.slcan_status import FLAGS

STATUS_PERIOD_S = 0.25
#: What making a message took is remembered, and forgotten by this share with each message.
DECAY_PER_MESSAGE = 0.02
#: What a controller says of a bus that is off.
OFF_FLAGS = ("error_warning", "error_passive", "bus_error")


class SensorStream:
    """The messages of one simulated device, as a stream of the scheduler.  messages : how many have left"""

    def __init__(self, line: DevicePipeline, endpoint: Endpoint, start_ns: int) -> None:
        self._line, self._endpoint, self._start_ns = line, endpoint, start_ns
        self.meter = Meter(line.sensor.name, line.sensor.link, line.sensor.rate_hz)
        self.messages = 0
        self._preparation_s = 0.0

    def note(self, due_s: float, late_s: float) -> None:
        """How late the next message leaves."""
        self.meter.note(due_s, late_s, is_cycle=due_s == self._line.cycle_s)

    def due_s(self) -> float | None:
        """When the next message leaves."""
        return self._line.due_s()

    def unprepared_s(self) -> float | None:
        """When the first message is due that could be made ahead and is not."""
        return self._line.unprepared_s

    def prepare(self, within_s: float, until_s: float) -> bool:
        """Make messages that are due until then, while there is time for what one has taken lately; was one made?

        Several in a row take half of what they take one by one, each behind others: caches are warm.  What one takes
        is the time of this thread: what the machine did meanwhile says nothing of the next one.
        """
        latest_s, made = time.monotonic() + within_s, False
        begin_s = time.thread_time()
        while time.monotonic() + self._preparation_s <= latest_s and self._line.prepare_cycle(self._start_ns, until_s):
            end_s = time.thread_time()
            self._preparation_s, begin_s, made = max(end_s - begin_s, self._preparation_s), end_s, True
        return made

    def complete(self) -> None:
        """Make the message that is due, unless it is made."""
        self._line.complete(self._start_ns)

    async def send(self) -> None:
        """Send what leaves now; a device hands its line a whole cycle, not byte by byte."""
        self._preparation_s *= 1.0 - DECAY_PER_MESSAGE
        messages = self._line.step(self._start_ns)
        self.messages += len(messages)
        if self._endpoint.is_stream:
            messages = [b"".join(messages)] if messages else []
        for message in messages:
            self._endpoint.send(message)


class BabbleStream:
    """A node that talks all the time, as a stream of the scheduler: eight bytes of zeros each time."""

    def __init__(self, fault: Babbling, endpoints: Sequence[Endpoint]) -> None:
        self._fault, self._endpoints, self._k = fault, endpoints, 0
        self._frame = pack_can(fault.can_id, bytes(8), extended=fault.can_id > STANDARD_MASK)

    def due_s(self) -> float | None:
        """When it talks next."""
        due_s = self._fault.from_s + self._k / self._fault.rate_hz
        return due_s if due_s < self._fault.to_s else None

    async def send(self) -> None:
        """Talk."""
        self._k += 1
        for endpoint in self._endpoints:
            endpoint.send(self._frame)


class StatusStream:
    """A fault of the controllers of slcan adapters, as a stream of the scheduler: trouble every quarter of a second."""

    def __init__(self, fault: CanStatus | BusOff, adapters: Sequence[SlcanEndpoint]) -> None:
        self._adapters, self._end_s, self._due_s = adapters, fault.to_s, fault.from_s
        names = fault.flags if isinstance(fault, CanStatus) else OFF_FLAGS
        self._flags = sum(bit for bit, name in FLAGS.items() if name.removeprefix("slcan_") in names)

    def due_s(self) -> float | None:
        """When there is trouble next."""
        return self._due_s if self._due_s < self._end_s else None

    async def send(self) -> None:
        """Raise the flags."""
        for adapter in self._adapters:
            adapter.raise_flags(self._flags)
        self._due_s += STATUS_PERIOD_S
