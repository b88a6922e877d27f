"""A flight that leaves the known terrain: altimeters find nothing there and say so, and the truth leaves it out."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from fti import config, drivers
from fti.config import Device
from fti.devices import BoundDevice
from fti.errors import ConfigError
from fti.hil.environment import Environment
from fti.hil.sensors import MODELS, SimulatedSensor
from fti.hil.truth_log import TruthLog, TruthRows
from fti.logger.reading.mcap_file import McapFile
from fti.messages.measurements import RadioHeight, Range
from tests.hil.worlds import flat_terrain, path, scenario

#: Westwards at 60 m/s and 700 m: over the terrain, which is 6 km to each side of 11 deg east, from about 28 s on.
EAST = {"lat_deg": 48.0, "lon_deg": 11.103, "alt_m": 700, "speed_mps": 60}
WEST = {"lat_deg": 48.0, "lon_deg": 11.05, "alt_m": 700, "speed_mps": 60}


def environment(first: dict[str, float] = EAST, last: dict[str, float] = WEST) -> Environment:
    flight = {"kind": "waypoints", "waypoint": (first, last)}
    return Environment(scenario(flight=flight), path(), flat_terrain(100.0), undulation=47.0)


@pytest.fixture(scope="module")
def leaving() -> Environment:
    return environment()


def heights(world: Environment, driver: str) -> dict[float, float | None]:
    """What an altimeter says, by time."""
    device = Device.model_validate({"name": "device", "link": "line", "driver": driver, "rate_hz": 2})
    module = drivers.load(driver)
    sensor = SimulatedSensor(
        BoundDevice(device, module, config.bind(module.Options, {}, "test")), MODELS[driver], world, seed=1
    )
    values: dict[float, float | None] = {}
    for k, t in enumerate(sensor.t):
        for m in sensor.measure(k, 0):
            if isinstance(m, RadioHeight | Range):
                values[float(t)] = m.height_agl if isinstance(m, RadioHeight) else m.slant_range
    return values


@pytest.mark.parametrize("driver", ["freeflight_ra4500", "lightware_ascii"])
def test_an_altimeter_finds_no_ground_where_none_is_known(leaving: Environment, driver: str) -> None:
    values = heights(leaving, driver)
    edge = _edge(leaving)
    before = [value for t, value in values.items() if t < edge - 3.0]
    after = [value for t, value in values.items() if t > edge + 3.0]
    assert set(before) == {None}
    assert np.abs(np.array(after, dtype=float) - 200.0).max() < 5.0


def _edge(world: Environment) -> float:
    """When the terrain begins below the flight [s]."""
    t = np.arange(0.0, world.duration, 0.1)
    return float(t[np.argmax(np.isfinite(world.ground(world.state(t))))])


def test_the_share_without_terrain_is_reported(leaving: Environment) -> None:
    remark = re.fullmatch(
        r"no terrain data below (\d+) % of the flight, first at 0 s: no ranges there", leaving.remarks[0]
    )
    assert remark is not None
    assert int(remark[1]) == pytest.approx(100.0 * _edge(leaving) / leaving.duration, abs=2.0)


def test_the_truth_leaves_out_what_nobody_knows(leaving: Environment, tmp_path: Path) -> None:
    log = TruthLog(tmp_path / "truth.mcap", TruthRows(leaving))
    rows = round(leaving.duration * 25)
    for k in (10, rows - 10):
        log.write(k, 0, 0)
    log.close()
    first, last = (json.loads(item.data) for item in McapFile(tmp_path / "truth.mcap").items())
    assert "height_agl" not in first
    assert last["height_agl"] == pytest.approx(200.0, abs=5.0)
    assert first["alt"] == pytest.approx(700.0, abs=1e-3)
    assert {"lat", "lon", "s", "y", "dh", "roll", "tas"} <= set(first)


def test_below_the_ground_is_refused_with_when_and_how_deep() -> None:
    under = {**WEST, "alt_m": 400}
    with pytest.raises(ConfigError, match=r"test: flight: 9\d m below the ground at 6\d s"):
        environment(EAST, under)


def test_above_the_ground_there_is_no_remark() -> None:
    assert environment({**EAST, "lon_deg": 11.06}, WEST).remarks == ()
