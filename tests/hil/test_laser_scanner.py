"""The emulated laser scanner: every point is measured from the pose of its own time, in real time."""

from __future__ import annotations

import copy
from functools import cache
from typing import Any

import numpy as np
import pytest

from fti.config import Device
from fti.devices import BoundDevice
from fti.drivers import velodyne_vlp16
from fti.drivers.velodyne_vlp16.options import Options
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.environment import Environment
from fti.hil.faults.values import DeviceFaults
from fti.hil.sensors import MODELS, SimulatedSensor
from fti.hil.tables.fault_types import Fog
from fti.hil.tables.schema import SensorSettings
from fti.messages.measurements import RangeScan
from fti.ranging.scan_points import ScanPoints, scan_points
from tests.hil.worlds import world

START_NS = 1_700_000_000_000_000_000
MOUNTING = (-90.0, 0.0, 90.0)
#: Azimuths are sent as hundredths of a degree, ranges as multiples of 2 mm.
AZIMUTH_RAD, SLANT_M = np.radians(0.01), 100.0


@cache
def environment(**settings: float) -> Environment:
    return world(2.0, 1200.0, sensor={"scanner": SensorSettings.model_validate({"shift_ms": 0.0, **settings})})


def sensor(mode: str = "strongest", **settings: float) -> SimulatedSensor:
    keys: dict[str, Any] = {"name": "scanner", "link": "eth", "driver": "velodyne_vlp16", "rpy_bs_deg": MOUNTING}
    bound = BoundDevice(Device.model_validate(keys), velodyne_vlp16, Options.model_validate({"return_mode": mode}))  # type: ignore[arg-type]
    return SimulatedSensor(bound, MODELS["velodyne_vlp16"], environment(**settings), seed=1)


def decoded(result: SimulatedSensor, count: int) -> list[ScanPoints]:
    """What the driver makes of the first packets; the times are those of the flight [ns]."""
    decoder, found = velodyne_vlp16.make_decoder(Options()), []
    for k in range(count):
        (packet,) = [data for m in result.measure(k, START_NS) for data in result.encoder.encode(m)]
        (scan,) = decoder.feed(packet, round(result.t[k] * 1e9))
        assert isinstance(scan, RangeScan)
        found.append(scan_points(scan))
    return found


def joined(points: list[ScanPoints]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], ranges and directions of all points."""
    return (
        np.concatenate([p.times_ns for p in points]) * 1e-9,
        np.concatenate([p.ranges for p in points]).astype(float),
        np.concatenate([p.directions_s for p in points]).astype(float),
    )


@pytest.mark.parametrize("mode", ["strongest", "dual"])
def test_every_point_is_the_range_from_the_pose_at_its_time(mode: str) -> None:
    """Level ground.  A quarter of a second is two turns, while the aircraft flies 15 m and sinks 0.8 m."""
    result = sensor(mode)
    t, ranges, directions = joined(decoded(result, 190))
    state = environment().state(t)
    rays = np.einsum(
        "nij,nj->ni",
        mat_from_rpy(state.roll, state.pitch, state.heading) @ mat_from_rpy(*np.radians(MOUNTING)),
        directions,
    )
    with np.errstate(divide="ignore"):
        level = (state.alt - environment().ground(state)) / rays[:, 2]
    inside = (level > 0.0) & (level < SLANT_M - 1.0)
    assert inside.sum() > 1000
    error = (ranges - level)[inside]
    tilt = np.sqrt(1.0 / rays[inside, 2] ** 2 - 1.0)
    assert np.abs(error).max() < 5 * 0.03 + 0.002 + (AZIMUTH_RAD * level[inside] * tilt).max()
    assert np.std(error[tilt < 0.3]) == pytest.approx(0.03, rel=0.1)
    assert np.isnan(ranges[(level < 0.0) | (level > SLANT_M + 1.0)]).all()


def test_dropouts_and_water_have_no_return() -> None:
    full = np.isfinite(joined(decoded(sensor(), 76))[1])
    some = np.isfinite(joined(decoded(sensor(dropout_share=0.3), 76))[1])
    assert not (some & ~full).any()
    assert some.sum() / full.sum() == pytest.approx(0.7, abs=0.03)
    assert not np.isfinite(joined(decoded(sensor(water_alt_m=505.0), 76))[1]).any()
    assert np.isfinite(joined(decoded(sensor(water_alt_m=495.0), 76))[1]).sum() == full.sum()


def test_a_copy_of_the_model_and_another_order_give_the_same_scans() -> None:
    one, other = sensor(), copy.deepcopy(sensor().model)
    stamp = one._stamp(0.0, START_NS)
    forward = [one.model.measure(k, stamp) for k in range(60)]
    assert [other.measure(k, stamp) for k in reversed(range(60))][::-1] == forward


def test_fog_hides_what_is_beyond_the_visibility() -> None:
    result = sensor()
    fog = Fog(kind="fog", from_s=0.0, to_s=9.0, visibility_m=85.0)
    scans = [m for k in range(76) for m in DeviceFaults("scanner", [fog]).apply(1.0, result.measure(k, START_NS))]
    ranges = np.concatenate([scan_points(m).ranges for m in scans if isinstance(m, RangeScan)])
    assert np.nanmax(ranges) <= 85.0 < np.nanmax(joined(decoded(sensor(), 76))[1])
