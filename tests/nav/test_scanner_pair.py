"""Two line scanners, one of which looks ahead and one back: strips of the same ground, one after the other.

The scans are computed with the ground and the flight of ``test_ground_drift``, which share no model with the product.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from fti.arrays import Array
from fti.config import Config
from fti.messages.measurements import RangeScan, Stamp
from fti.messages.reasons import Reason
from fti.nav.pipeline import Pipeline
from fti.ranging.scan_points import make_scan, point_arrays
from tests.nav.test_ground_drift import (
    ARM_B,
    RANGE_SD,
    Outputs,
    drifts,
    events,
    known_sensor,
    last_solution,
    north_error,
    ranges,
    sigmas_that_hold,
    waves,
)
from tests.nav.test_ground_drift import config as of_imager
from tests.nav.test_inertial_aiding import ALT, GROUND_UP, MS, SPEED, T0, measurements

#: Angle of both scanners from the vertical [rad], and duration of a strip [s].
TILT, STRIP_S = math.radians(20.0), 1.0
#: Points of a line, which takes 20 ms, and half of its angle [rad].
POINTS, HALF = 80, math.radians(30.0)
NAMES = "front", "rear"
SATELLITES_S = 50.0


@dataclass(frozen=True)
class LineScanner:
    """Fifty lines a second, from left to right, with mounting errors.

    tilt : ahead [rad];  turn : additional angles about x, y, z of the body that the configuration does not have [rad]
    late : time from a measurement to its stamp [s];  arrival_s : from the first point of a line to its arrival [s]
    has_returns : whether there is a return at a time [s];  ground : height at north, east [m]
    """

    tilt: float
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    late: float = 0.0
    arrival_s: float = 0.0
    has_returns: Callable[[float], bool] = lambda _: True
    ground: Callable[[Array, Array], Array] = waves

    def scans(self, k: int) -> list[RangeScan]:
        k -= round(100 * self.arrival_s)
        if k % 2 or k < 0:
            return []
        offsets = np.linspace(0.0, 0.02, POINTS, endpoint=False)
        across = np.linspace(-HALF, HALF, POINTS)
        rays_s = np.stack((np.zeros(POINTS), np.sin(across), np.cos(across)), axis=1)
        c, s = math.cos(self.tilt), math.sin(self.tilt)
        rays_b = rays_s @ np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
        rays_b = rays_b + np.cross(self.turn, rays_b)
        rays_b /= np.linalg.norm(rays_b, axis=1)[:, None]
        measured = ranges(0.01 * k + offsets - self.late, rays_b, self.ground)
        measured += RANGE_SD * np.random.default_rng([k, self.tilt > 0.0]).standard_normal(POINTS)
        if not self.has_returns(0.01 * k):
            measured[:] = np.nan
        return [make_scan(Stamp(T0 + k * 10 * MS), measured, point_arrays(rays_s, offsets))]


def config(front: LineScanner, rear: LineScanner, exposure_s: float) -> Config:
    """Both scanners, as they look without the additional angles, with the lever arm of the imager that they replace."""
    found = of_imager()
    *others, imager = found.device
    tilts = (math.degrees(front.tilt), math.degrees(rear.tilt))
    pair = [
        imager.model_copy(update={"name": name, "rpy_bs_deg": (0.0, tilt, 0.0), "lever_arm_b": ARM_B})
        for name, tilt in zip(NAMES, tilts, strict=True)
    ]
    drift: dict[str, Any] = {
        "device": "front",
        "second_device": "rear",
        "exposure_s": exposure_s,
        "range_sd_m": RANGE_SD,
    }
    table = type(found.nav).model_validate({"scan_drift": drift}).scan_drift
    nav = found.nav.model_copy(update={"scan_drift": table})
    return found.model_copy(update={"device": (*others, *pair), "nav": nav})


def fly(front: LineScanner, rear: LineScanner, end_s: float = 80.0, exposure_s: float = STRIP_S) -> Outputs:
    pipeline, out = Pipeline(config(front, rear, exposure_s), None), Outputs()
    for k in range(round(end_s * 100)):
        for device, m in measurements(k, gnss=0.01 * k < SATELLITES_S):
            if device != "laser":
                out += pipeline.feed(device, m)
        for name, scanner in zip(NAMES, (front, rear), strict=True):
            for scan in scanner.scans(k):
                out += pipeline.feed(name, scan)
        if k % 2 == 0:
            out += pipeline.tick(T0 + k * 10 * MS)
    return out


@pytest.fixture(scope="module", autouse=True)
def _known_sensor() -> Iterator[None]:
    with known_sensor():
        yield


FRONT, REAR = LineScanner(TILT), LineScanner(-TILT)


@pytest.fixture(scope="module")
def nominal() -> Outputs:
    return fly(FRONT, REAR)


def test_the_rear_strip_is_compared_with_the_front_strip_of_the_same_ground(nominal: Outputs) -> None:
    found = drifts(nominal, 20.0)
    assert len(found) > 20
    expected = 2.0 * math.tan(TILT) * (ALT - GROUND_UP) / SPEED
    for each in found:
        assert each.interval == pytest.approx(expected, abs=0.1)
        assert each.overlap is not None and each.overlap > 0.2  # hills move the strip ahead and the one behind apart
    whole = [each for each in found if each.directions == 3]
    assert len(whole) > 0.9 * len(found)
    assert sigmas_that_hold(whole)[:, :2].max() < 0.15


def test_near_the_ground_a_strip_is_shorter_than_the_exposure() -> None:
    """The rear scanner sees the ground of the front one after 0.6 s; strips of 1.5 s would hardly overlap."""
    tilt = math.radians(5.0)
    out = fly(LineScanner(tilt), LineScanner(-tilt), end_s=20.0, exposure_s=1.5)
    found = drifts(out, 10.0)
    assert len(found) > 12
    assert np.mean([each.overlap or 0.0 for each in found]) > 0.4
    assert all(
        each.interval == pytest.approx(2.0 * math.tan(tilt) * (ALT - GROUND_UP) / SPEED, abs=0.05) for each in found
    )


def test_the_pair_aids_without_satellites(nominal: Outputs) -> None:
    assert all(each.valid for each in drifts(nominal, SATELLITES_S))
    alone = last_solution(fly(FRONT, LineScanner(-TILT, has_returns=lambda _: False)))
    aided = last_solution(nominal)
    assert aided.horizontal_sd is not None and alone.horizontal_sd is not None
    assert aided.horizontal_sd < 0.7 * alone.horizontal_sd
    assert abs(north_error(aided)) < 3.0 * aided.horizontal_sd


def test_a_mounting_within_the_survey_is_estimated_and_the_pair_is_used() -> None:
    """0.2 deg of the rear scanner about each axis: 0.7 m a pair along and across, 0.3 m/s if nothing corrected it."""
    turn = np.radians([0.2, -0.15, 0.1])
    out = fly(FRONT, LineScanner(-TILT, tuple(turn)))
    found = drifts(out, SATELLITES_S)
    assert len(found) > 8 and all(each.valid for each in found)
    shift = np.array([[each.north, each.east] for each in found], dtype=float).mean(axis=0)
    height = ALT - GROUND_UP - ARM_B[2]
    true_minus_computed = np.cross(turn, [-height * math.tan(TILT), 0.0, height])
    assert shift == pytest.approx(-true_minus_computed[:2], abs=0.1)
    last = found[-1]
    assert last.second_roll is not None and last.second_roll_sd is not None
    assert -last.second_roll == pytest.approx(turn[0], abs=4.0 * last.second_roll_sd)
    assert last.second_pitch_sd is not None and last.second_clock_sd is not None
    solution = last_solution(out)
    assert solution.horizontal_sd is not None
    assert abs(north_error(solution)) < 3.0 * solution.horizontal_sd


def descending(north: Array, east: Array) -> Array:
    """The waves; from 3100 m on the ground falls by 200 m."""
    return np.asarray(waves(north, east) - 200.0 * np.clip((north - 3100.0) / 1500.0, 0.0, 1.0))


def test_a_rear_scanner_that_is_late_is_inside_the_sigma_at_another_height() -> None:
    """20 ms are calibrated with satellites as 0.34 deg of pitch at 200 m; 400 m above the ground they are not that."""
    front, rear = (LineScanner(tilt, late=late, ground=descending) for tilt, late in ((TILT, 0.0), (-TILT, 0.02)))
    out = fly(front, rear, end_s=95.0)
    assert sum(each.valid for each in drifts(out, SATELLITES_S)) > 5
    solution = last_solution(out)
    assert solution.horizontal_sd is not None
    assert abs(north_error(solution)) < 3.0 * solution.horizontal_sd


def test_one_scanner_whose_lines_arrive_late_is_waited_for() -> None:
    """The rear one arrives 120 ms after its first point: later than a look of one scanner is waited for."""
    out = fly(FRONT, LineScanner(-TILT, arrival_s=0.12), end_s=30.0)
    found = drifts(out, 10.0)
    assert sum(each.directions == 3 for each in found) > 5


def test_a_mounting_beyond_the_survey_is_announced_and_never_used() -> None:
    out = fly(FRONT, LineScanner(-TILT, (0.0, math.radians(1.0), 0.0)), end_s=60.0)
    assert not any(each.valid for each in drifts(out))
    text = " ".join(map(str, events(out)))
    named = re.search(
        r"pairs of front and rear contradict the filter: the rear one is turned (\d\.\d) deg too far front", text
    )
    assert named and float(named[1]) == pytest.approx(1.0, abs=0.25)


def test_with_one_scanner_there_is_no_drift() -> None:
    """From 50 s on the rear one measures no ground: a look is tried again soon."""
    out = fly(FRONT, LineScanner(-TILT, has_returns=lambda t: t < 50.0), end_s=65.0)
    assert any(each.valid for each in drifts(out, 0.0, 50.0))
    late = drifts(out, 54.0)
    assert len(late) > 5
    assert {(each.valid, each.reasons) for each in late} == {(False, (Reason.FEW_POINTS,))}
