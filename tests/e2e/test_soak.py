"""The whole daemon on the aircraft's 23 links at ten times its rate: memory flat, ledger closed."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.e2e.soak_run import Soak, Usage, run_soak

pytestmark = [pytest.mark.e2e, pytest.mark.alone, pytest.mark.timeout(3600)]
FACTOR = 10
QUICK_S, FULL_S = 4.0, 1800.0
#: What each process may grow in 30 minutes; a run of some seconds says nothing of that.
GROWTH_MB = {"recorder": 2.0, "navigation": 10.0, "display": 5.0, "supervisor": 2.0}


def test_the_ledger_is_closed_and_memory_is_flat(tmp_path: Path, scale: int) -> None:
    soak = run_soak(tmp_path, QUICK_S if scale == 1 else FULL_S, FACTOR)
    print(soak.table())
    _assert_closed(soak)
    if scale > 1:
        assert {name: used.growth_mb(FULL_S) < GROWTH_MB[name] for name, used in soak.usage.items()} == dict.fromkeys(
            GROWTH_MB, True
        ), soak.table()


def _assert_closed(soak: Soak) -> None:
    """What was sent is recorded, frame by frame where there are frames, and the files say the same."""
    assert {name: size for name, (_, size) in soak.recorded.items()} == {n: size for n, (_, size) in soak.sent.items()}
    framed = [name for name in soak.sent if name.startswith(("other_", "ins_ethernet", "sensor_bus"))]
    assert [soak.recorded[name] for name in framed] == [soak.sent[name] for name in framed]
    assert sum(soak.dropped.values()) == 0
    assert soak.exit_code == 0, soak.verified


def test_growth_is_the_slope_behind_the_warm_up() -> None:
    memory = [50.0 * (t < 20) + 100.0 + 0.5 * t for t in range(100)]
    used = Usage([float(t) for t in range(100)], memory, [0.0] * 100)
    assert used.growth_mb(60.0) == pytest.approx(30.0)
