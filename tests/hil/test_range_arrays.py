"""Emulated images and lines of the shipped example: each point is the range from the pose of its own time."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from fti import config
from fti.arrays import Array
from fti.devices import bind_devices
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.environment import Environment
from fti.hil.sensors import SimulatedSensor, make_sensors
from fti.hil.sensors.sent_rates import sent_rates
from fti.hil.tables.fault_types import Fault
from fti.hil.tables.schema import SensorSettings
from fti.messages.measurements import RangeScan
from fti.ranging.scan_points import scan_points
from tests.helpers import ROOT
from tests.hil.worlds import world

START_NS = 1_700_000_000_000_000_000


@cache
def environment(name: str = "", **settings: float) -> Environment:
    """Above level ground at 5 degrees of bank and more: the approach wanders."""
    sensor = {name: SensorSettings.model_validate(settings)} if name else {}
    return world(3.0, 3000.0, sensor=sensor)


@cache
def sensors(there: Environment) -> dict[str, SimulatedSensor]:
    return {s.name: s for s in make_sensors(config.load(ROOT / "configs/range_scanner.toml"), there, 1, lambda _: None)}


def over_the_line(name: str, there: Environment) -> tuple[list[float], list[RangeScan]]:
    """Times of the samples that gave a scan, and what the driver makes of the frames."""
    sensor = sensors(there)[name]
    bound = next(b for b in bind_devices(config.load(ROOT / "configs/range_scanner.toml")) if b.device.name == name)
    decoder, begins, scans = bound.make_decoder(), [], []
    for k, t in enumerate(sensor.t):
        frames = [data for m in sensor.measure(k, START_NS) for data in sensor.encoder.encode(m)]
        found = [m for data in frames for m in decoder.feed(data, round(t * 1e9)) if isinstance(m, RangeScan)]
        scans += found
        begins += [float(t)] * len(found)
    assert not decoder.counters.skipped and not decoder.counters.lost
    return begins, scans


def level_ranges(there: Environment, t: Array, directions_b: Array) -> Array:
    """Ranges (n,) [m] to the level ground at t (n,) [s] along directions (n, 3)."""
    state = there.state(t)
    # The plane of the frame is the ground; the vertical of the aircraft is tilted by 0.5 mrad against it.
    frame = there.terrain.frame
    mat_lb = frame.mat_ln(state.lat, state.lon) @ mat_from_rpy(state.roll, state.pitch, state.heading)
    up = np.einsum("nj,nj->n", mat_lb[:, 2], directions_b)
    return np.asarray(-frame.to_local(state.lat, state.lon, state.alt)[:, 2] / up)


@pytest.mark.parametrize(
    ("fault", "late_s", "angles_deg"),
    [
        ({"kind": "latency", "by_s": 0.35}, 0.35, (0.0, 0.0, 0.0)),
        ({"kind": "mounting", "roll_deg": 4.0, "pitch_deg": -3.0, "yaw_deg": 30.0}, 0.0, (4.0, -3.0, 30.0)),
    ],
)
def test_images_of_a_wrong_time_and_of_a_wrong_mounting(
    fault: dict[str, Any], late_s: float, angles_deg: tuple[float, float, float]
) -> None:
    """From 1 s on: ranges of earlier, to a fraction of the time between images, or along turned directions."""
    table = {"devices": ("imager",), "from_s": 1.0, "to_s": 9.0, **fault}
    there = world(3.0, 3000.0, fault=(TypeAdapter(Fault).validate_python(table),))
    begins, scans = over_the_line("imager", there)
    turn = mat_from_rpy(*np.radians(angles_deg))
    for begin, points in zip(begins, map(scan_points, scans), strict=True):
        is_faulty, directions = begin >= 1.0, points.directions_s.astype(float)
        true = directions @ turn.T if is_faulty else directions
        t = np.minimum(points.times_ns * 1e-9, there.duration) - late_s * is_faulty
        level = level_ranges(there, t, true)
        error = (points.ranges - level)[(level < 299.0) & (points.times_ns * 1e-9 <= there.duration)]
        assert abs(error.mean()) < 0.01 and np.std(error) == pytest.approx(0.05, rel=0.1)
    assert sum(begin >= 1.0 for begin in begins) >= 3


@pytest.mark.parametrize(("name", "points", "count"), [("imager", 5625, 6), ("lines", 200, 150)])
def test_every_point_is_the_range_from_the_pose_at_its_time(name: str, points: int, count: int) -> None:
    there = environment()
    begins, scans = over_the_line(name, there)
    assert len(scans) == pytest.approx(count, abs=1) and {scan.points for scan in scans} == {points}
    found = [scan_points(scan) for scan in scans]
    t, ranges = np.concatenate([p.times_ns for p in found]) * 1e-9, np.concatenate([p.ranges for p in found])
    directions = np.concatenate([p.directions_s for p in found]).astype(float)
    level = level_ranges(there, np.minimum(t, there.duration), directions)
    error = (ranges - level)[(level < 299.0) & (t <= there.duration)]
    assert np.abs(error).max() < 0.05 * 6 + 0.005 and np.std(error) == pytest.approx(0.05, rel=0.05)
    assert begins == pytest.approx([p.times_ns[0] * 1e-9 for p in found])


def test_points_of_a_line_are_measured_one_after_the_other() -> None:
    """200 points in 19.9 ms, while the aircraft sinks 6 cm."""
    _, scans = over_the_line("lines", environment())
    for scan in scans[:3]:
        times = scan_points(scan).times_ns
        assert times[-1] - times[0] == pytest.approx(19.9e6, abs=10)


def test_points_are_lost_by_reach_chance_and_water() -> None:
    full = over_the_line("imager", environment())[1][0]
    near = over_the_line("imager", environment("imager", reach_m=200.0))[1][0]
    expected = np.isfinite(full_ranges := scan_points(full).ranges) & (full_ranges < 200.0)
    differing = np.isfinite(scan_points(near).ranges) != expected
    assert 0 < near.returns < full.returns and np.abs(full_ranges[differing] - 200.0).max(initial=0.0) < 0.4
    some = over_the_line("imager", environment("imager", dropout_share=0.2))[1][0]
    assert some.returns / full.returns == pytest.approx(0.8, abs=0.02)
    assert over_the_line("imager", environment("imager", water_alt_m=505.0))[1][0].returns == 0


def test_the_rate_is_that_of_the_scans() -> None:
    """Of images in 15 frames two in a second."""
    rates = sent_rates(list(sensors(environment()).values()))
    assert rates["imager"]["range_scan"] == pytest.approx(2.0, rel=0.1)
    assert rates["lines"]["range_scan"] == 50.0 and rates["scanner"]["range_scan"] == 754.0
