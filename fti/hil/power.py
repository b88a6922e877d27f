"""The electrical layer of the laboratory: a circuit breaker for each device, and a supply that can sag.

    off, on     by hand                              trip, reset    it opens by itself, and is closed again
    brown-out   the supply is below what the device needs: it stops, and starts anew when the voltage is back
    starting    power is there, and the first message comes ``boot_s`` later

A device that gets power again has forgotten what it was told: a receiver that is silent until asked is silent until it
is asked, what counts begins at 0, and so does a time since power-on.

Two hands are on the breakers: the faults ``breaker`` of the scenario, and a person's commands.  **A person wins**: a
breaker that was commanded once is his for the rest of the flight, and the scenario touches it no more.  The voltage is
nobody's: ``brown_out`` comes whoever has the breaker.

Time is that of the flight [s], and the unit has no clock: it is where its devices are.  A command takes effect with
the next message that any of them is due to send.

Source: Spiegel 2018, section 6.5 and figure 6.16 (power distribution unit, breakers per sensor); voltages of a 28 V
system: MIL-STD-704F, 28 V steady, 18 V the least in an emergency.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from fti.hil.tables.fault_types import Breaker, BrownOut, Fault

SUPPLY_V = 28.0
#: What a device draws [A]; none of them is known, so it is the same for all and only shows that there is a load.
LOAD_A = 0.5


class BreakerState(StrEnum):
    """What becomes of a device's power."""

    ON = "on"
    STARTING = "starting"
    OFF = "off"
    TRIPPED = "tripped"
    BROWN_OUT = "brown_out"


#: Command: from which position of the breaker to which; from others it is refused.
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


def _ignore_restart(t: float) -> None:
    """Nobody is told."""


@dataclass(frozen=True, slots=True)
class PowerFeed:
    """A device behind its breaker.

    boot_s    : from power to its first message [s]; minimum_v : below this voltage it stops [V]
    restart   : told when it gets power again [s of the flight]
    """

    name: str
    boot_s: float
    minimum_v: float
    restart: Callable[[float], None] = _ignore_restart


@dataclass(slots=True)
class _Circuit:
    """A breaker and what is behind it.  since_s : it has had power since then; None while it has none"""

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
        """Give power or take it, at a time [s]."""
        if self.position is not BreakerState.ON or self.volts < self.feed.minimum_v:
            self.since_s = None
        elif self.since_s is None:
            self.since_s = at
            self.feed.restart(at)


class PowerUnit:
    """The breakers of the devices of one flight; at its beginning all are closed and every device has started.

    Devices that it does not feed (itself) always have power.
    """

    def __init__(self, feeds: Sequence[PowerFeed], faults: Sequence[Fault] = ()) -> None:
        self._circuits = {feed.name: _Circuit(feed) for feed in feeds}
        self._trips = [fault for fault in faults if isinstance(fault, Breaker)]
        self._sags = [fault for fault in faults if isinstance(fault, BrownOut)]
        self._edges = deque(sorted({s for fault in (*self._trips, *self._sags) for s in (fault.from_s, fault.to_s)}))
        self._t = 0.0

    def is_on(self, device: str, t: float | None = None) -> bool:
        """Does the device work at t [s]?  None: at the last instant that the unit was told."""
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
        """Do what a person wants with a breaker.  Returns whether it was done, and what there is to say."""
        line = self._circuits.get(breaker)
        if line is None:
            return False, f"it has no breaker: {breaker} is not fed by this unit"
        if line.position not in TRANSITIONS[command]:
            return False, REFUSAL_TEXTS[command, line.position]
        line.position, line.is_manual = TRANSITIONS[command][line.position], True
        line.settle(self._t)
        return True, line.state(self._t).value

    def _step(self, t: float) -> None:
        """What the scenario does to the power up to t [s], each at its own time."""
        while self._edges and self._edges[0] <= t:
            self._change(self._edges.popleft())
        self._t = max(self._t, t)

    def _change(self, at: float) -> None:
        for name, line in self._circuits.items():
            if not line.is_manual:
                tripped = any(_acts(trip, at, name) for trip in self._trips)
                line.position = BreakerState.TRIPPED if tripped else BreakerState.ON
            line.volts = min((sag.supply_v for sag in self._sags if _acts(sag, at, name)), default=SUPPLY_V)
            line.settle(at)


def _acts(fault: Breaker | BrownOut, t: float, device: str = "") -> bool:
    return fault.from_s <= t < fault.to_s and fault.includes_device(device)
