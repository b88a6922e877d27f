"""How late outputs were in the last whole period, and not before or after it."""

from __future__ import annotations

import pytest

from fti.messages.tables import to_table
from fti.service.navigation.process import PERIOD_NS, OutputLatency

MS = 1_000_000


def test_percentiles_of_the_last_whole_period() -> None:
    delay = OutputLatency(0)
    for k in range(100):
        delay.add(k * MS, k * MS + (40 if k == 50 else 8) * MS)
    assert delay.percentiles(PERIOD_NS - 1) is None
    delay.add(0, 8 * MS)
    percentiles = delay.percentiles(PERIOD_NS)
    assert percentiles is not None
    assert to_table(percentiles) == {
        "p50_ms": pytest.approx(8.0, rel=0.07),
        "p99_ms": pytest.approx(8.0, rel=0.07),
        "max_ms": 40.0,
    }
    delay.add(0, 2 * MS)
    assert delay.percentiles(PERIOD_NS + MS) == percentiles
    following = delay.percentiles(2 * PERIOD_NS)
    assert following is not None
    assert following.max_ms == 2.0


def test_without_outputs_nothing_is_reported() -> None:
    delay = OutputLatency(0)
    delay.add(0, MS)
    assert delay.percentiles(PERIOD_NS)
    assert delay.percentiles(2 * PERIOD_NS) is None
