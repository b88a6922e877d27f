"""One emulated device, from its measurements to the bytes at its connector, with all its faults.

    measure -> clock -> values -> encode -> bytes, message by message -> line

Faults of clock and values act by the time of the sample, faults of bytes and lines by the send time of the message.
This class opens nothing and never waits: ``due_s`` is the time at which ``step`` returns the next messages.

``prepare_cycle`` encodes the messages of the next cycles before they are due.  Faults of bytes and lines still act at
the send time.  A restart of the device discards its prepared messages.  These devices are not prepared:

    those that receive bytes in flight    answers and messages keep their order; settings act with the next message
    those whose power the scenario cuts   nothing is computed for a device without power
    power units                           their messages depend on the state of other devices
"""

from __future__ import annotations

import struct
from array import array
from collections import deque
from collections.abc import Callable

from fti.drivers import Encoder
from fti.hil.faults.applicability import stages_of
from fti.hil.faults.clocks import ClockFaults
from fti.hil.faults.values import DeviceFaults
from fti.hil.sensors.base import SimulatedSensor
from fti.hil.tables.fault_types import PowerFault
from fti.hil.tables.schema import Scenario
from fti.messages.measurements import Measurement


class DevicePipeline:
    """A device in one flight.

    until_s    : end of the flight [s]; line faults hold nothing back beyond it
    is_powered : whether the device has power at t [s]; None: at the time of the last call
    """

    def __init__(
        self,
        sensor: SimulatedSensor,
        scenario: Scenario,
        until_s: float = float("inf"),
        is_powered: Callable[[float | None], bool] = lambda t: True,
    ) -> None:
        faults, seed = scenario.fault, scenario.seed
        end_s = min(until_s, float(sensor.due[-1])) if len(sensor.due) else 0.0
        self.sensor, self._is_powered = sensor, is_powered
        self._clock = ClockFaults(sensor.bound, faults)
        self._values = DeviceFaults(sensor.name, faults, seed)
        self._stages = stages_of(sensor.bound, faults, seed, end_s)
        self._k = 0
        self._prepared: deque[list[bytes]] = deque()  # messages by cycle, beginning with the next one
        self._prepared_by: Encoder = sensor.encoder
        self._answers: list[bytes] = []  # answers to commands, to be sent after the prepared messages
        self._can_prepare = not sensor.is_live and not any(
            isinstance(fault, PowerFault) and fault.includes_device(sensor.name) for fault in faults
        )
        # arrays: the garbage collector would traverse lists of hundreds of thousands of floats
        self._times, self._cycles_s = array("d", sensor.t), array("d", sensor.due)

    def due_s(self) -> float | None:
        """Time of the next possible message [s]; None at the end."""
        if not self._stages:
            return self.cycle_s
        instants = [self.cycle_s, *(stage.due_s() for stage in self._stages)]
        return min((due for due in instants if due is not None), default=None)

    @property
    def cycle_s(self) -> float | None:
        """Time of the next cycle of the device itself [s]; None after the last one."""
        return self._cycles_s[self._k] if self._k < len(self._cycles_s) else None

    @property
    def unprepared_s(self) -> float | None:
        """Due time of the first cycle that can be prepared and is not [s]; None when there is none."""
        k = self._k + len(self._prepared)
        return self._cycles_s[k] if self._can_prepare and k < len(self._cycles_s) else None

    def step(self, start_ns: int) -> list[bytes]:
        """Messages that leave at ``due_s``.  start_ns : FTI time of the beginning of the flight."""
        t, cycle_s = self.due_s(), self.cycle_s
        assert t is not None
        messages = []
        if cycle_s is not None and cycle_s <= t:
            if self._is_powered(t):
                messages = self._pop_messages(start_ns)
            else:  # a device without power loses prepared messages and answers
                self._prepared.clear()
                self._answers = []
            self._k += 1
        return self._apply_stages(t, messages)

    def prepare_cycle(self, start_ns: int, until_s: float = float("inf")) -> bool:
        """Encode the first cycle that is not prepared if it is due by until_s [s].  Returns whether it was encoded."""
        self._discard_outdated()
        unprepared_s = self.unprepared_s
        if unprepared_s is None or unprepared_s > until_s or not self._is_powered(None):
            return False
        self._prepared.append(self._cycle(self._k + len(self._prepared), start_ns))
        return True

    def complete(self, start_ns: int) -> None:
        """Encode the messages of the cycle due at ``due_s`` unless they are prepared, so that ``step`` only sends."""
        t, cycle_s = self.due_s(), self.cycle_s
        if t is not None and cycle_s is not None and cycle_s <= t and self._is_powered(t):
            self._prepare_due(start_ns)

    def _prepare_due(self, start_ns: int) -> None:
        """Encode the messages of the next cycle unless they are prepared."""
        self._discard_outdated()
        if not self._prepared:
            self._prepared.append(self._answers + self._cycle(self._k, start_ns))
            self._answers = []

    def _discard_outdated(self) -> None:
        """Discard messages that were prepared before a restart."""
        if self._prepared_by is not self.sensor.encoder:
            self._prepared.clear()
            self._prepared_by = self.sensor.encoder

    def _pop_messages(self, start_ns: int) -> list[bytes]:
        """The messages of the cycle that is due; answers follow the last cycle that was prepared before them."""
        self._prepare_due(start_ns)
        messages = self._prepared.popleft()
        if self._answers and not self._prepared:
            messages, self._answers = messages + self._answers, []
        return messages

    def respond(self, data: bytes, t: float) -> list[bytes]:
        """Answers at t [s] to bytes from the daemon; before the flight begins (t < 0) no fault acts."""
        if not self._is_powered(t):
            return []
        answers = self.sensor.encoder.respond(data)
        if t < 0.0:
            return answers
        self._can_prepare = False
        if self._prepared:
            self._answers += answers
            return []
        return self._apply_stages(t, answers)

    def _cycle(self, k: int, start_ns: int) -> list[bytes]:
        """The messages of sample k, before faults of bytes and lines."""
        t = self._times[k]
        measurements = self._clock.apply(t, self.sensor.measure(k, start_ns))
        faulty = self._values.apply(t, measurements)
        encode = self._encode_faulty if faulty is not measurements else self.sensor.encoder.encode
        return [message for m in faulty for message in encode(m)]

    def _encode_faulty(self, measurement: Measurement) -> list[bytes]:
        """Encode a faulty measurement; a value outside the range of its field gives no message."""
        try:
            return self.sensor.encoder.encode(measurement)
        except (struct.error, OverflowError):
            return []

    def _apply_stages(self, t: float, messages: list[bytes]) -> list[bytes]:
        for stage in self._stages:
            messages = stage.apply(t, messages)
        return messages
