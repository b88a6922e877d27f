"""What the emulator hands to the scheduler: the messages of each device, and the troubles of adapters."""

from __future__ import annotations

from collections.abc import Sequence

from fti.hil.faults.kinds import CanStatus
from fti.hil.faults.values import DeviceFaults
from fti.hil.lateness import Meter
from fti.hil.ports.endpoints import Endpoint, SlcanEndpoint
from fti.hil.power import PowerUnit
from fti.hil.sensors import Sensor
from fti.links.slcan_status import FLAGS

TROUBLE_S = 0.25


class SensorStream:
    """The messages of one simulated device, as a stream of the scheduler."""

    def __init__(
        self, sensor: Sensor, faults: DeviceFaults, endpoint: Endpoint, start_ns: int, power: PowerUnit
    ) -> None:
        self._sensor, self._faults, self._endpoint, self._start_ns = sensor, faults, endpoint, start_ns
        self._power = power
        self._k = 0
        self.meter = Meter(sensor.name, sensor.link, sensor.rate_hz)

    def note(self, due_s: float, late_s: float) -> None:
        """How late the next message leaves."""
        self.meter.note(due_s, late_s)

    def due_s(self) -> float | None:
        """When the next message leaves."""
        return float(self._sensor.due[self._k]) if self._k < len(self._sensor.due) else None

    async def send(self) -> None:
        """Measure, spoil, encode, send; without power nothing of all that."""
        k, self._k = self._k, self._k + 1
        if not self._power.is_on(self._sensor.name, float(self._sensor.due[k])):
            return
        t = float(self._sensor.t[k])
        measurements = self._sensor.measure(k, self._start_ns)
        sent = self._faults.apply(t, measurements)
        messages = [message for m in sent for message in self._sensor.encoder.encode(m)]
        if self._endpoint.is_stream:  # a device hands its line a whole cycle, not byte by byte
            messages = [b"".join(messages)] if messages else []
        for message in messages:
            self._endpoint.send(message)


class StatusStream:
    """A fault of the controllers of slcan adapters, as a stream of the scheduler: trouble every quarter of a second."""

    def __init__(self, fault: CanStatus, adapters: Sequence[SlcanEndpoint]) -> None:
        self._adapters, self._end_s, self._due_s = adapters, fault.to_s, fault.from_s
        self._flags = sum(bit for bit, name in FLAGS.items() if name.removeprefix("slcan_") in fault.flags)

    def due_s(self) -> float | None:
        """When there is trouble next."""
        return self._due_s if self._due_s < self._end_s else None

    async def send(self) -> None:
        """Raise the flags."""
        for adapter in self._adapters:
            adapter.raise_flags(self._flags)
        self._due_s += TROUBLE_S
