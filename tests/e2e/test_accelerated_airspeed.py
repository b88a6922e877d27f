"""A pitot that reads low, through bytes: of an air data computer on CAN, whose airspeed aids the filter."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.e2e.flights import fly_faster
from tests.helpers import ROOT

pytestmark = pytest.mark.timeout(300)

SCENARIO = f"""
title = "A pitot that ices"
description = "The true airspeed falls by 40 % beside satellites, which are gone 8 s later."
config = "{ROOT / "configs" / "fallbacks.toml"}"
seed = 3

[[fault]]
kind = "scale"
quantity = "airspeed.tas"
percent = -40
devices = ["air_data"]
from_s = 20
to_s = 45

[[fault]]
kind = "gnss_outage"
devices = ["receiver"]
from_s = 28
to_s = 38
"""


def test_a_pitot_that_reads_low_is_refused_and_the_receiver_is_not(tmp_path: Path) -> None:
    scenario = tmp_path / "pitot.toml"
    scenario.write_text(SCENARIO)
    flown = fly_faster(str(scenario), tmp_path / "session", 45.0)
    rejected = {row["t"]: tuple(row["rejected"]) for row in flown.outputs("/nav/filter_solution")}
    assert not any("air_data.airspeed" in names for t, names in rejected.items() if 5.0 <= t < 20.0)
    assert all("air_data.airspeed" in names for t, names in rejected.items() if 26.0 <= t < 44.0)
    solutions = list(flown.outputs("/nav/nav_solution"))
    assert {row["position_source"] for row in solutions if 5.0 <= row["t"] < 28.0} == {"receiver"}
    assert {row["position_source"] for row in solutions if 31.0 <= row["t"] < 37.0} == {"filter"}
    assert {row["position_source"] for row in solutions if 43.0 <= row["t"]} == {"receiver"}
    assert not any(row["refused"] for row in solutions)
    for row in solutions[500::10]:
        true = flown.truth_at(float(row["t"]))
        north = (row["lat"] - true["lat"]) * 6.37e6
        east = (row["lon"] - true["lon"]) * 6.38e6 * math.cos(true["lat"])
        assert math.hypot(north, east) < 15.0
