"""Flights of simulated receivers past the tests of one source, with faults in the decoded measurements."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fti.config import parse
from fti.messages.measurements import Measurement, Position, Velocity
from fti.messages.outputs import Event
from fti.nav.plausibility.source import SourceTests, UnstatedSigmas
from tests.nav.healthy_receivers import RECEIVERS, Receiver, Truth, fly, measure

S = 1_000_000_000
T0 = 1000 * S
#: Changes a measurement at a time of flight [s].
Change = Callable[[float, Measurement], Measurement | None]
BY_NAME = {receiver.name: receiver for receiver in RECEIVERS}
UBX1, UBX10, ARINC = BY_NAME["ubx 1 Hz"], BY_NAME["ubx 10 Hz"], BY_NAME["arinc 20 bits 5 Hz"]


@dataclass
class Result:
    """valid : time [s] and whether the newest position was admitted with its altitude; events as told"""

    valid: list[tuple[float, bool, bool]] = field(default_factory=list)
    events: list[tuple[float, Event]] = field(default_factory=list)

    @property
    def refused_s(self) -> float | None:
        """When position or altitude was refused first [s]."""
        return next((t for t, event in self.events if " refused: " in event.text), None)

    @property
    def test(self) -> str:
        """Name of the test that refused first."""
        texts = [event.text for _, event in self.events if " refused: " in event.text]
        return texts[0].split(": ")[1] if texts else ""

    def is_valid_at(self, t: float) -> bool:
        """Whether the last position until a time was admitted."""
        return [valid for at, valid, _ in self.valid if at <= t][-1]


def make_tests(device: dict[str, Any] | None = None, limits: dict[str, float] | None = None) -> SourceTests:
    table = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [{"name": "gnss", "link": "l", "driver": "d", **(device or {})}],
        "nav": {"position": ["gnss"], "limits": limits or {}},
    }
    config = parse(table, "", Path("t.toml"))
    return SourceTests(config.device[0], config.nav.limits, UnstatedSigmas(3.3, 6.6))


def run(
    measurements: Iterable[tuple[int, Measurement]], change: Change, tests: SourceTests, readmit_s: float | None = None
) -> Result:
    """Feed a flight; None of a change leaves a measurement out."""
    result = Result()
    for t_ns, whole in measurements:
        t = (t_ns - T0) / S
        m = change(t, whole)
        if m is None:
            continue
        if readmit_s is not None and t >= readmit_s:
            result.events += [(t, event) for event in tests.readmit(t_ns)]
            readmit_s = None
        if isinstance(m, Position):
            admitted, events = tests.feed_position(m, t_ns)
            result.valid.append((t, admitted[0].valid, len(admitted) == 1))
        elif isinstance(m, Velocity):
            _, events = tests.feed_velocity(m, t_ns)
        result.events += [(t, event) for event in events]
    return result


def simulate(
    change: Change,
    *,
    receiver: Receiver = UBX1,
    seconds: int = 240,
    seed: int = 1,
    truth: Truth | None = None,
    readmit_s: float | None = None,
    limits: dict[str, float] | None = None,
) -> Result:
    """A flight of a receiver with a change."""
    rng = np.random.default_rng(seed)
    truth = fly(rng, seconds, 1.5) if truth is None else truth
    return run(measure(rng, truth, receiver, T0), change, make_tests(limits=limits), readmit_s)


def straight(seconds: int, speed: float = 60.0, climb: float = 0.0) -> Truth:
    """North at a constant speed [m/s]."""
    n = seconds * 20
    velocity = np.tile([speed, 0.0, climb], (n, 1))
    return Truth(np.arange(n)[:, None] / 20.0 * velocity, velocity)
