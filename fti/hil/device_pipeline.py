"""One device, from what it measures to what leaves at its connector, with everything that goes wrong on the way.

    measure -> clock -> values -> encode -> bytes, message by message -> line

Faults of clock and values count from the time of the sample, those of bytes and lines from when a message leaves.
Nothing is opened here and nobody waits: ``due_s`` says when ``step`` has something to give.

The messages of the next cycles can be made before they are due (``prepare_cycle``), so that at their instant they only
leave.  What goes wrong with bytes and lines goes wrong then all the same; and a device that was switched off and on
since has forgotten what it had made.  Made at their instant are those of a device

    that is told something in flight    answers and messages keep their order, and settings act with the next message
    of which the scenario takes power   what it would have said without is not computed
    that says how others are            the power unit
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
from fti.types import Measurement


def _always(t: float | None) -> bool:
    return True


class DevicePipeline:
    """A device in one flight.

    until_s    : the flight is cut off there [s]; nothing is held back any longer
    is_powered : does it have power at t [s]?  None: at the last instant that it was asked for
    """

    def __init__(
        self,
        sensor: SimulatedSensor,
        scenario: Scenario,
        until_s: float = float("inf"),
        is_powered: Callable[[float | None], bool] = _always,
    ) -> None:
        faults, seed = scenario.fault, scenario.seed
        end_s = min(until_s, float(sensor.due[-1])) if len(sensor.due) else 0.0
        self.sensor, self._is_powered = sensor, is_powered
        self._clock = ClockFaults(sensor.bound, faults)
        self._values = DeviceFaults(sensor.name, faults, seed)
        self._stages = stages_of(sensor.bound, faults, seed, end_s)
        self._k = 0
        self._prepared: deque[list[bytes]] = deque()  # of the cycles from the next one on
        self._prepared_by: Encoder = sensor.encoder
        self._answers: list[bytes] = []  # to what it was told since it has made what is not due yet
        self._can_prepare = not sensor.is_live and not any(
            isinstance(fault, PowerFault) and fault.includes_device(sensor.name) for fault in faults
        )
        # arrays: the collector of cycles goes through every element of a list, and here are hundreds of thousands
        self._times, self._cycles_s = array("d", sensor.t), array("d", sensor.due)

    def due_s(self) -> float | None:
        """When something may leave next [s]; None when nothing will."""
        if not self._stages:
            return self.cycle_s
        instants = [self.cycle_s, *(stage.due_s() for stage in self._stages)]
        return min((due for due in instants if due is not None), default=None)

    @property
    def cycle_s(self) -> float | None:
        """When the device itself has the next thing to say [s]; None when it has said everything."""
        return self._cycles_s[self._k] if self._k < len(self._cycles_s) else None

    @property
    def unprepared_s(self) -> float | None:
        """When the first cycle is due that could be made ahead and is not [s]; None when there is none."""
        k = self._k + len(self._prepared)
        return self._cycles_s[k] if self._can_prepare and k < len(self._cycles_s) else None

    def step(self, start_ns: int) -> list[bytes]:
        """What leaves at ``due_s``.  start_ns : FTI time of the beginning of the flight."""
        t, cycle_s = self.due_s(), self.cycle_s
        assert t is not None
        messages = []
        if cycle_s is not None and cycle_s <= t:
            messages = self._pop_messages(start_ns) if self._is_powered(t) else self._discard_all()
            self._k += 1
        return self._apply_stages(t, messages)

    def prepare_cycle(self, start_ns: int, until_s: float = float("inf")) -> bool:
        """Make what leaves in the first cycle that is not made, if it is due until then; was it made?"""
        self._discard_outdated()
        unprepared_s = self.unprepared_s
        if unprepared_s is None or unprepared_s > until_s or not self._is_powered(None):
            return False
        self._prepared.append(self._cycle(self._k + len(self._prepared), start_ns))
        return True

    def complete(self, start_ns: int) -> None:
        """Make what leaves at ``due_s``, unless it is made or nothing does: ``step`` has nothing more to make then."""
        t, cycle_s = self.due_s(), self.cycle_s
        if t is not None and cycle_s is not None and cycle_s <= t and self._is_powered(t):
            self._prepare_due(start_ns)

    def _prepare_due(self, start_ns: int) -> None:
        """Make the messages of the cycle that is due, unless they are."""
        self._discard_outdated()
        if not self._prepared:
            self._prepared.append(self._answers + self._cycle(self._k, start_ns))
            self._answers = []

    def _discard_outdated(self) -> None:
        """What was made before a restart is made anew."""
        if self._prepared_by is not self.sensor.encoder:
            self._prepared.clear()
            self._prepared_by = self.sensor.encoder

    def _pop_messages(self, start_ns: int) -> list[bytes]:
        """The messages of the cycle that is due; behind the last that was made before an answer, the answer."""
        self._prepare_due(start_ns)
        messages = self._prepared.popleft()
        if self._answers and not self._prepared:
            messages, self._answers = messages + self._answers, []
        return messages

    def _discard_all(self) -> list[bytes]:
        """Without power nothing leaves, and nothing is kept."""
        self._prepared.clear()
        self._answers = []
        return []

    def respond(self, data: bytes, t: float) -> list[bytes]:
        """What it answers at t [s] to bytes from the daemon; before the flight begins (t < 0) nothing goes wrong."""
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
        """The messages of sample k, before anything is wrong with their bytes."""
        t = self._times[k]
        measurements = self._clock.apply(t, self.sensor.measure(k, start_ns))
        said = self._values.apply(t, measurements)
        encode = self._encode_faulty if said is not measurements else self.sensor.encoder.encode
        return [message for m in said for message in encode(m)]

    def _encode_faulty(self, measurement: Measurement) -> list[bytes]:
        """A wrong number may be one that no message can carry: then nothing is sent."""
        try:
            return self.sensor.encoder.encode(measurement)
        except (struct.error, OverflowError):
            return []

    def _apply_stages(self, t: float, messages: list[bytes]) -> list[bytes]:
        for stage in self._stages:
            messages = stage.apply(t, messages)
        return messages
