"""Airspeed of an air data computer on CAN and the field of a magnetometer, through bytes to the filter.

The pitot reads low from a time on; the magnetometer is sound, and the declination is that of the emulator's field.
"""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.e2e.flights import fly_faster
from tests.helpers import ROOT

pytestmark = pytest.mark.timeout(300)

#: Of the emulator's field at the flight, west (``fti.geodesy.magnetic``); a wrong one by 60 deg is refused.
DECLINATION_DEG, WRONG_DEG = -6.1, 54.0
SCENARIO = """
title = "A pitot that ices"
description = "The true airspeed falls by 40 % beside satellites, which are gone 8 s later."
config = "fallbacks.toml"
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


def write(folder: Path, declination_deg: float) -> Path:
    """The scenario beside the fallbacks' configuration, with a heading of the inertial unit."""
    text = (ROOT / "configs" / "fallbacks.toml").read_text().replace('"profiles/', f'"{ROOT / "configs"}/profiles/')
    logs = "options = { logs = { INSSOL = 1, MAGDATA = 0 } }"
    text = text.replace('driver = "imar_ixcom"', f'driver = "imar_ixcom"\n{logs}')
    aids = f'airspeed = "air_data"\nheading = "ins"\ndeclination_deg = {declination_deg}\n#'
    (folder / "fallbacks.toml").write_text(text.replace('airspeed = "air_data"', aids))
    (folder / "pitot.toml").write_text(SCENARIO)
    return folder / "pitot.toml"


def test_a_declination_that_is_wrong_is_a_heading_that_is_refused(tmp_path: Path) -> None:
    flight = fly_faster(str(write(tmp_path, WRONG_DEG)), tmp_path / "session", 12.0)
    rejected = [row["rejected"] for row in flight.outputs("/nav/filter_solution") if row["t"] >= 8.0]
    assert rejected
    assert all("ins.heading" in names for names in rejected)


def test_a_pitot_that_reads_low_is_refused_and_the_receiver_is_not(tmp_path: Path) -> None:
    flight = fly_faster(str(write(tmp_path, DECLINATION_DEG)), tmp_path / "session", 45.0)
    rejected = {row["t"]: tuple(row["rejected"]) for row in flight.outputs("/nav/filter_solution")}
    assert not any("air_data.airspeed" in names for t, names in rejected.items() if 5.0 <= t < 20.0)
    assert all("air_data.airspeed" in names for t, names in rejected.items() if 26.0 <= t < 44.0)
    assert not any("ins.heading" in names for names in rejected.values())
    solutions = list(flight.outputs("/nav/nav_solution"))
    assert {row["position_source"] for row in solutions if 5.0 <= row["t"] < 28.0} == {"receiver"}
    assert {row["position_source"] for row in solutions if 31.0 <= row["t"] < 37.0} == {"filter"}
    assert {row["position_source"] for row in solutions if row["t"] >= 43.0} == {"receiver"}
    assert not any(row["refused"] for row in solutions)
    for row in solutions[500::10]:
        true = flight.truth_at(float(row["t"]))
        north = (row["lat"] - true["lat"]) * 6.37e6
        east = (row["lon"] - true["lon"]) * 6.38e6 * math.cos(true["lat"])
        assert math.hypot(north, east) < 15.0
