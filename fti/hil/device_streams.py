"""Streams of the scheduler: messages of a device, a babbling CAN node, error flags of slcan adapters."""

from __future__ import annotations

import time
from collections.abc import Sequence

from fti.canframe import STANDARD_MASK, pack_can
from fti.hil.device_pipeline import DevicePipeline
from fti.hil.ports.endpoints import Endpoint, SlcanEndpoint
from fti.hil.report import Meter
from fti.hil.tables.fault_types import Babbling, BusOff, CanStatus
from fti.links.slcan_status import FLAGS

STATUS_PERIOD_S = 0.25
#: The estimate of the encoding time decays by this share with each message.
DECAY_PER_MESSAGE = 0.02
#: Flags that a controller reports on a bus that is off.
OFF_FLAGS = ("error_warning", "error_passive", "bus_error")


class SensorStream:
    """The messages of one simulated device, as a stream of the scheduler.  messages : number of messages sent"""

    def __init__(self, line: DevicePipeline, endpoint: Endpoint, start_ns: int) -> None:
        self._line, self._endpoint, self._start_ns = line, endpoint, start_ns
        self.meter = Meter(line.sensor.name, line.sensor.link, line.sensor.rate_hz)
        self.messages = 0
        self._preparation_s = 0.0

    def note(self, due_s: float, late_s: float) -> None:
        """Record the lateness of the next message."""
        self.meter.note(due_s, late_s, is_cycle=due_s == self._line.cycle_s)

    def due_s(self) -> float | None:
        """Time of the next message."""
        return self._line.due_s()

    def unprepared_s(self) -> float | None:
        """Due time of the first message that can be prepared and is not."""
        return self._line.unprepared_s

    def prepare(self, within_s: float, until_s: float) -> bool:
        """Encode messages due by until_s while the expected encoding time fits into within_s.  Returns success.

        Several in a row take half the time of single ones, because caches are warm.  The encoding time is the CPU time
        of this thread, since other load on the machine does not predict the next message.
        """
        latest_s, prepared = time.monotonic() + within_s, False
        begin_s = time.thread_time()
        while time.monotonic() + self._preparation_s <= latest_s and self._line.prepare_cycle(self._start_ns, until_s):
            end_s = time.thread_time()
            self._preparation_s, begin_s, prepared = max(end_s - begin_s, self._preparation_s), end_s, True
        return prepared

    def complete(self) -> None:
        """Encode the message that is due unless it is prepared."""
        self._line.complete(self._start_ns)

    async def send(self) -> None:
        """Send the messages that are due; a serial line gets a whole cycle in one call."""
        self._preparation_s *= 1.0 - DECAY_PER_MESSAGE
        messages = self._line.step(self._start_ns)
        self.messages += len(messages)
        if self._endpoint.is_stream:
            messages = [b"".join(messages)] if messages else []
        for message in messages:
            self._endpoint.send(message)


class BabbleStream:
    """A babbling node, as a stream of the scheduler: it sends frames of eight zero bytes at the rate of the fault."""

    def __init__(self, fault: Babbling, endpoints: Sequence[Endpoint]) -> None:
        self._fault, self._endpoints, self._k = fault, endpoints, 0
        self._frame = pack_can(fault.can_id, bytes(8), extended=fault.can_id > STANDARD_MASK)

    def due_s(self) -> float | None:
        """Time of the next frame."""
        due_s = self._fault.from_s + self._k / self._fault.rate_hz
        return due_s if due_s < self._fault.to_s else None

    async def send(self) -> None:
        """Send a frame."""
        self._k += 1
        for endpoint in self._endpoints:
            endpoint.send(self._frame)


class StatusStream:
    """A fault of the controllers of slcan adapters, as a stream of the scheduler: flags every ``STATUS_PERIOD_S``."""

    def __init__(self, fault: CanStatus | BusOff, adapters: Sequence[SlcanEndpoint]) -> None:
        self._adapters, self._end_s, self._due_s = adapters, fault.to_s, fault.from_s
        names = fault.flags if isinstance(fault, CanStatus) else OFF_FLAGS
        self._flags = sum(bit for bit, name in FLAGS.items() if name.removeprefix("slcan_") in names)

    def due_s(self) -> float | None:
        """Time of the next flags."""
        return self._due_s if self._due_s < self._end_s else None

    async def send(self) -> None:
        """Raise the flags."""
        for adapter in self._adapters:
            adapter.raise_flags(self._flags)
        self._due_s += STATUS_PERIOD_S
