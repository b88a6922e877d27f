"""Power supply of the emulated devices: a circuit breaker for each device, and a supply that can sag.

    off, on     switched by command                  trip, reset    opens by itself, and is closed again
    brown-out   the supply is below the minimum voltage of the device: it stops, and restarts when the voltage is back
    starting    the device has power; its first message comes ``boot_s`` later

A power cycle resets a device: its settings are those of the configuration, and its counters and its time since
power-on begin at 0.

Faults ``breaker`` of the scenario and operator commands switch the breakers.  **Commands win**: after its first command
a breaker ignores the scenario for the rest of the flight.  ``brown_out`` acts on all breakers.

Time is that of the flight [s].  The unit has no clock: a command takes effect with the next message of any device.

Source: Spiegel 2018, section 6.5 and figure 6.16 (power distribution unit, breakers per sensor); voltages of a 28 V
system: MIL-STD-704F, 28 V steady, at least 18 V in an emergency.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from fti.hil.tables.fault_types import Breaker, BrownOut, Fault

SUPPLY_V = 28.0
#: Current of a device [A]: assumed, the same for all, to show that there is a load.
LOAD_A = 0.5


class BreakerState(StrEnum):
    """State of the power of a device."""

    ON = "on"
    STARTING = "starting"
    OFF = "off"
    TRIPPED = "tripped"
    BROWN_OUT = "brown_out"


#: Allowed transitions of the breaker by command; others are refused.
TRANSITIONS: Mapping[str, Mapping[BreakerState, BreakerState]] = {
    "on": {BreakerState.OFF: BreakerState.ON, BreakerState.ON: BreakerState.ON},
    "off": dict.fromkeys((BreakerState.ON, BreakerState.OFF, BreakerState.TRIPPED), BreakerState.OFF),
    "trip": dict.fromkeys((BreakerState.ON, BreakerState.TRIPPED), BreakerState.TRIPPED),
    "reset": {BreakerState.TRIPPED: BreakerState.ON, BreakerState.ON: BreakerState.ON},
}
REFUSAL_TEXTS = {
    ("on", BreakerState.TRIPPED): "it has tripped: reset it",
    ("reset", BreakerState.OFF): "it is off: switch it on",
    ("trip", BreakerState.OFF): "it is off and cannot trip",
}


@dataclass(frozen=True, slots=True)
class PowerFeed:
    """A device behind its breaker.

    boot_s    : from power to its first message [s]; minimum_v : below this voltage it stops [V]
    restart   : called with the time at which power returns [s of the flight]
    """

    name: str
    boot_s: float
    minimum_v: float
    restart: Callable[[float], None] = lambda _: None


@dataclass(slots=True)
class _Circuit:
    """A breaker with its device.  since_s : time since which the device has power [s]; None while it has none"""

    feed: PowerFeed
    position: BreakerState = BreakerState.ON  # or off, or tripped
    is_manual: bool = False
    volts: float = SUPPLY_V
    since_s: float | None = field(default=-math.inf)

    def state(self, t: float) -> BreakerState:
        if self.position is not BreakerState.ON:
            return self.position
        if self.since_s is None:
            return BreakerState.BROWN_OUT
        return BreakerState.ON if t >= self.since_s + self.feed.boot_s else BreakerState.STARTING

    def settle(self, at: float) -> None:
        """Switch the power on or off at a time [s], by position and voltage."""
        if self.position is not BreakerState.ON or self.volts < self.feed.minimum_v:
            self.since_s = None
        elif self.since_s is None:
            self.since_s = at
            self.feed.restart(at)


class PowerUnit:
    """The breakers of the devices of one flight; at its beginning all are closed and every device has started.

    Devices without a breaker, such as the unit itself, always have power.
    """

    def __init__(self, feeds: Sequence[PowerFeed], faults: Sequence[Fault] = ()) -> None:
        self._circuits = {feed.name: _Circuit(feed) for feed in feeds}
        self._trips = [fault for fault in faults if isinstance(fault, Breaker)]
        self._sags = [fault for fault in faults if isinstance(fault, BrownOut)]
        self._edges = deque(sorted({s for fault in (*self._trips, *self._sags) for s in (fault.from_s, fault.to_s)}))
        self._t = 0.0

    def is_on(self, device: str, t: float | None = None) -> bool:
        """Whether the device works at t [s]; None: at the time of the last call."""
        self._step(self._t if t is None else t)
        line = self._circuits.get(device)
        return line is None or line.state(self._t) is BreakerState.ON

    def states(self) -> dict[str, BreakerState]:
        """Every breaker."""
        return {name: line.state(self._t) for name, line in self._circuits.items()}

    @property
    def volts(self) -> float:
        """Voltage of the supply, before the breakers [V]."""
        return min((s.supply_v for s in self._sags if not s.devices and _acts(s, self._t)), default=SUPPLY_V)

    def amps(self, device: str) -> float:
        """Current through a breaker [A]."""
        return 0.0 if self._circuits[device].since_s is None else LOAD_A

    def handle_command(self, command: str, breaker: str) -> tuple[bool, str]:
        """Execute an operator command on a breaker.  Returns success, and the new state or the reason for refusal."""
        line = self._circuits.get(breaker)
        if line is None:
            return False, f"it has no breaker: {breaker} is not fed by this unit"
        if line.position not in TRANSITIONS[command]:
            return False, REFUSAL_TEXTS[command, line.position]
        line.position, line.is_manual = TRANSITIONS[command][line.position], True
        line.settle(self._t)
        return True, line.state(self._t).value

    def _step(self, t: float) -> None:
        """Apply the power faults of the scenario up to t [s], each at its own time."""
        while self._edges and self._edges[0] <= t:
            at = self._edges.popleft()
            for name, line in self._circuits.items():
                if not line.is_manual:
                    tripped = any(_acts(trip, at, name) for trip in self._trips)
                    line.position = BreakerState.TRIPPED if tripped else BreakerState.ON
                line.volts = min((sag.supply_v for sag in self._sags if _acts(sag, at, name)), default=SUPPLY_V)
                line.settle(at)
        self._t = max(self._t, t)


def _acts(fault: Breaker | BrownOut, t: float, device: str = "") -> bool:
    return fault.from_s <= t < fault.to_s and fault.includes_device(device)
