"""Expected flags depend on the same truth for a planned flight and for a recorded one."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from fti.config import Altimeter, Device
from fti.hil.oracle.truth_columns import planned_truth, truth_of_columns
from fti.hil.truth_log import TruthLog, TruthRows
from fti.post.score import truth_reader
from tests.hil.worlds import world

ALTIMETER = Altimeter(kind="laser", range_m=(0.2, 500.0))
LASER = Device(name="laser", link="line", driver="lightware_binary", altimeter=ALTIMETER)


def test_columns_are_named_as_in_the_truth_file() -> None:
    t = np.array([0.0, 1.0])
    columns = {"s": t + 500.0, "y": t, "vel_down": t + 2.0, "range_laser": t + 90.0}
    truth = truth_of_columns(t, columns, 300.0)
    assert truth.before_threshold.tolist() == [200.0, 201.0]
    assert truth.climb.tolist() == [-2.0, -3.0]
    assert truth.ranges["laser"][0].tolist() == [90.0, 91.0]
    assert np.isnan(truth.height_agl).all()


def test_a_planned_flight_has_the_truth_of_the_same_flight_flown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    air = world(3.0)
    planned = planned_truth(air, [LASER])
    rows = TruthRows(air, [LASER])
    log = TruthLog(tmp_path / "truth_000.mcap", rows)
    for k in range(len(rows.t)):
        log.write(k, 10**18, 10**18)
    log.close()
    monkeypatch.setattr(truth_reader, "_intercept_m", lambda: float(air.path.x_gpi))
    written = truth_reader.read_flight_truth(tmp_path / "truth_000.mcap", air.scenario).truth
    for name in ("t", "height_agl", "before_threshold", "offset", "roll", "pitch", "climb"):
        assert getattr(planned, name) == pytest.approx(getattr(written, name), abs=1e-9)
    for here, there in zip(planned.ranges["laser"], written.ranges["laser"], strict=True):
        assert here == pytest.approx(there, nan_ok=True)
    assert planned.end_s == pytest.approx(3.0, abs=0.05)
    assert math.isfinite(float(planned.ranges["laser"][0][0]))
