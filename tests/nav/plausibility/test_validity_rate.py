"""How often the validity of a source is given out, on ticks that jitter."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from fti.config import parse
from fti.messages.measurements import Attitude, Stamp
from fti.messages.outputs import SourceValidity
from fti.nav.plausibility.monitor import PlausibilityMonitor

S, MS = 1_000_000_000, 1_000_000
SECONDS = 60


def test_a_validity_that_does_not_change_is_repeated_twice_a_second() -> None:
    """Ticks every 20 ms, 3 ms of jitter: 2 Hz, and never more than a tick and its jitter late."""
    table = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [{"name": "ahrs", "link": "l", "driver": "d"}],
        "nav": {"attitude": ["ahrs"]},
    }
    monitor, rng = PlausibilityMonitor(parse(table, "", Path("t.toml"))), np.random.default_rng(5)
    jitter_ns = rng.integers(0, 3 * MS, 50 * SECONDS).tolist()
    ticks_ns = [1000 * S + 20 * MS * k + jitter for k, jitter in enumerate(jitter_ns)]
    nanoseconds = [o.t_ns for t_ns in ticks_ns for o in given(monitor, t_ns) if o.valid]
    apart = np.diff(nanoseconds) / S
    assert math.isclose(len(nanoseconds), 2 * SECONDS, abs_tol=2)
    assert apart.max() < 0.53


def given(monitor: PlausibilityMonitor, t_ns: int) -> list[SourceValidity]:
    """Feed an attitude and a tick."""
    monitor.check("ahrs", Attitude(stamp=Stamp(t_ns), roll=0.0, pitch=0.0, heading=0.0), t_ns)
    return [o for o in monitor.tick(t_ns) if isinstance(o, SourceValidity)]
