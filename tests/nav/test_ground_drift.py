"""Looks at the ground aid the live filter: over waves of ground that share no model with the product."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from fti.arrays import Array
from fti.config import Config
from fti.messages.measurements import RangeScan, Stamp
from fti.messages.outputs import Event, FilterSolution, GroundDrift, Output
from fti.messages.reasons import Reason
from fti.nav import ground_drift
from fti.nav.filter import look_mark
from fti.nav.filter.error_states import Drift
from fti.nav.filter.navigator import InertialNavigator
from fti.nav.ground_drift import Calibration
from fti.nav.pipeline import Pipeline
from fti.ranging.scan_points import make_scan, point_arrays
from tests.helpers import ROOT
from tests.nav.test_inertial_aiding import ALT, GROUND_UP, MS, RADIUS, SPEED, T0, S, latitude, measurements
from tests.nav.test_inertial_aiding import config as of_aiding

SIDE = 50
ARM_B = (2.0, -1.0, 0.5)
RANGE_SD = 0.05
SATELLITES_S, END_S = 70.0, 110.0

Rays = tuple[Array, Array]


def config(**table: Any) -> Config:
    found = of_aiding(filter={"imu": "imu", "gnss": ["gnss"]}, altimeters=[])
    mounted = {"lever_arm_b": ARM_B, **table.pop("mounted", {})}
    imager = found.device[0].model_copy(update={"name": "imager", "max_age_ms": 2000.0, **mounted})
    drift = {"device": "imager", "range_sd_m": RANGE_SD, **table}
    nav = found.nav.model_copy(update={"scan_drift": type(found.nav).model_validate({"scan_drift": drift}).scan_drift})
    return found.model_copy(update={"device": (*found.device, imager), "nav": nav})


def directions(half_angle: float = math.radians(30.0)) -> Array:
    """Of the pixels, down."""
    side = math.tan(half_angle) * np.linspace(-1.0, 1.0, SIDE)
    x, y = (each.ravel() for each in np.meshgrid(side, side))
    rays = np.stack((x, y, np.ones(len(x))), axis=1)
    return np.asarray(rays / np.linalg.norm(rays, axis=1)[:, None])


def waves(north: Array, east: Array) -> Array:
    """Height of the ground over GROUND_UP [m]: hills of 5 to 150 m length."""
    up = np.zeros(np.broadcast(north, east).shape)
    for k, length in enumerate((150.0, 97.0, 61.0, 41.0)):
        angle = 0.7 + 1.9 * k
        along = north * math.cos(angle) + east * math.sin(angle)
        up = up + 0.035 * length * np.sin(2.0 * math.pi * along / length + k)
    return np.asarray(up)


def level_ground(north: Array, east: Array) -> Array:
    return np.zeros(np.broadcast(north, east).shape)


def ranges(t: Array | float, rays_n: Array, ground: Callable[[Array, Array], Array]) -> Array:
    """Along rays (n, 3), north, east, down, from the sensor of the level flight to the north at t [s] or (n,)."""
    north = SPEED * np.asarray(t) + ARM_B[0]
    above = ALT - GROUND_UP - ARM_B[2]
    found = np.full(len(rays_n), above)
    for _ in range(60):
        at = north + found * rays_n[:, 0], ARM_B[1] + found * rays_n[:, 1]
        bulge = ((at[0] - SPEED * np.asarray(t)) ** 2 + at[1] ** 2) / (2.0 * RADIUS)
        before, found = found, (above - ground(*at) + bulge) / rays_n[:, 2]
        if (np.abs(found - before) < 1e-4).all():  # of ranges with a noise of 5 cm [m]
            break
    return np.asarray(found)


@dataclasses.dataclass(frozen=True)
class Imager:
    """An imager with errors.

    yaw, roll : of its mounting [rad];  late : time from a measurement to its stamp [s]
    scale : of its ranges;  ground : height at north, east [m]
    lasts : whether there is a scan at a time [s];  has_returns : whether there is a return at a time [s]
    """

    yaw: float = 0.0
    roll: float = 0.0
    late: float = 0.0
    scale: float = 1.0
    ground: Callable[[Array, Array], Array] = waves
    lasts: Callable[[float], bool] = lambda _: True
    has_returns: Callable[[float], bool] = lambda _: True

    def scans(self, k: int) -> list[RangeScan]:
        """Twice a second."""
        t, stamp = 0.01 * k, Stamp(T0 + k * 10 * MS)
        if k % 50 or not self.lasts(t):
            return []
        rays_s, rng = directions(), np.random.default_rng(k)
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        rays_n = rays_s @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        c, s = math.cos(self.roll), math.sin(self.roll)
        rays_n = rays_n @ np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
        measured = self.scale * ranges(t - self.late, rays_n, self.ground) + RANGE_SD * rng.standard_normal(len(rays_s))
        if not self.has_returns(t):
            measured[:] = np.nan
        return [make_scan(stamp, measured, point_arrays(rays_s, np.zeros(len(rays_s))))]


Outputs = list[Output | Event]


@contextlib.contextmanager
def known_sensor(sd: float = math.radians(0.05), clock_sd: float = 0.002) -> Iterator[None]:
    """The filter begins with a heading and a clock of the scans as it has after turns; straight on it sees neither."""
    sds = math.radians(0.5), math.radians(0.5), sd
    with pytest.MonkeyPatch.context() as patch:
        original = InertialNavigator.feed_attitude
        patch.setattr(InertialNavigator, "feed_attitude", functools.partialmethod(original, sd=sds))
        patch.setattr(look_mark, "CLOCK_DRIFT", Drift(clock_sd))
        yield


@pytest.fixture(scope="module", autouse=True)
def _known_sensor() -> Iterator[None]:
    with known_sensor():
        yield


def fly(
    sensor: Any, satellites: Callable[[float], bool] = lambda t: t < SATELLITES_S, end_s: float = END_S, **table: Any
) -> Outputs:
    pipeline, out = Pipeline(config(**table), None), Outputs()
    for k in range(round(end_s * 100)):
        for device, m in measurements(k, gnss=satellites(0.01 * k)):
            if device != "laser":
                out += pipeline.feed(device, m)
        for scan in sensor.scans(k):
            out += pipeline.feed("imager", scan)
        if k % 2 == 0:
            out += pipeline.tick(T0 + k * 10 * MS)
    return out


def drifts(out: Outputs, from_s: float = 0.0, until_s: float = math.inf) -> list[GroundDrift]:
    """Each once, of pairs whose later look is in an interval."""
    found = {o.t_valid_ns: o for o in out if isinstance(o, GroundDrift) and o.t_valid_ns is not None}
    return [o for t_ns, o in found.items() if from_s <= (t_ns - T0) / S < until_s]


def events(out: Outputs) -> list[tuple[float, str]]:
    found = [o for o in out if isinstance(o, Event) and o.text.startswith(ground_drift.NAME)]
    return [((o.t_ns - T0) / S, o.text) for o in found]


def sigmas_that_hold(whole: Sequence[GroundDrift]) -> Array:
    """North, east, down [m], shape (n, 3): the errors are within 5 of them, with the true drift of the filter."""
    errors = np.array([[each.north, each.east, each.down] for each in whole], dtype=float)
    sds = np.array([[each.north_sd, each.east_sd, each.down_sd] for each in whole], dtype=float)
    assert (np.abs(errors) < 5.0 * np.hypot(sds, [0.2, 0.4, 0.3])).all()
    return sds


def last_solution(out: Outputs) -> FilterSolution:
    return [o for o in out if isinstance(o, FilterSolution)][-1]


def north_error(solution: FilterSolution) -> float:
    assert solution.lat is not None and solution.t_valid_ns is not None
    return (solution.lat - latitude((solution.t_valid_ns - T0) / S)) * RADIUS


@pytest.fixture(scope="module")
def nominal() -> Outputs:
    return fly(Imager())


@pytest.fixture(scope="module")
def alone() -> Outputs:
    return fly(Imager(lasts=lambda _: False))


def test_pairs_are_compared_after_half_of_a_look_and_are_inside_their_sigma(nominal: Outputs) -> None:
    found = drifts(nominal, 20.0)
    assert len(found) > 30
    half = math.tan(math.radians(30.0)) * (ALT - GROUND_UP) / SPEED
    for each in found:
        assert each.interval == pytest.approx(half, abs=0.65)  # the next of two images in a second
        assert each.overlap is not None and 0.25 < each.overlap < 0.65
        assert each.points == SIDE**2
    whole = [each for each in found if each.directions == 3]
    assert len(whole) > 0.8 * len(found)
    assert sigmas_that_hold(whole)[:, :2].max() < 0.3


def test_it_aids_after_it_has_agreed_with_satellites(nominal: Outputs) -> None:
    (when, text), *others = events(nominal)
    assert "agree with satellites" in text and not others
    assert 30.0 < when < 60.0
    assert not any(each.valid for each in drifts(nominal, 0.0, when - 0.5))
    assert {each.reasons for each in drifts(nominal, 20.0, when - 0.5)} == {(Reason.NOT_CALIBRATED,)}
    assert all(each.valid for each in drifts(nominal, when + 0.5))


def test_the_sigma_without_satellites_is_smaller_and_holds(nominal: Outputs, alone: Outputs) -> None:
    aided, inertial = last_solution(nominal), last_solution(alone)
    assert aided.horizontal_sd is not None and inertial.horizontal_sd is not None
    assert aided.horizontal_sd < 0.7 * inertial.horizontal_sd
    assert abs(north_error(aided)) < 3.0 * aided.horizontal_sd
    assert aided.mode == "coasting"  # a drift bounds no position


def test_a_look_without_a_partner_changes_nothing(alone: Outputs) -> None:
    assert {o.reasons for o in alone if isinstance(o, GroundDrift)} == {(Reason.SILENT,)}


def test_water_gives_no_return_and_no_drift() -> None:
    out = fly(Imager(has_returns=lambda t: t < 60.0), end_s=80.0)
    found = drifts(out, 62.0)
    assert len(found) > 20  # a look is tried again soon
    assert {each.reasons for each in found} == {(Reason.FEW_POINTS,)}
    assert not events(out)[1:]


def test_level_ground_gives_no_horizontal_drift() -> None:
    found = drifts(fly(Imager(ground=level_ground), end_s=60.0), 20.0)
    assert found
    assert all(each.directions is not None and each.directions <= 1 for each in found)


def test_a_scanner_that_dies_leaves_a_stale_drift() -> None:
    out = fly(Imager(lasts=lambda t: t < 60.0), end_s=80.0)
    late = [o for o in out if isinstance(o, GroundDrift) and o.t_ns > T0 + 69 * S]
    assert late and {(o.valid, o.reasons) for o in late} == {(False, (Reason.STALE,))}


def test_a_wrong_mounting_is_announced_with_satellites_and_never_used() -> None:
    out = fly(Imager(yaw=math.radians(1.0)))
    assert not any(each.valid for each in drifts(out))
    when, text = events(out)[0]
    assert "contradict the filter" in text and when < 60.0
    named = re.search(r"rpy_bs_deg turns it (\d\.\d) deg too far to the (left|right)", " ".join(map(str, events(out))))
    assert named and float(named[1]) == pytest.approx(1.0, abs=0.25)
    assert Reason.CONTRADICTION in drifts(out, 60.0)[-1].reasons


@pytest.mark.parametrize("sensor", [Imager(roll=math.radians(1.0)), Imager(late=0.05)], ids=["roll", "clock"])
def test_straight_on_a_roll_mounting_and_a_wrong_clock_cancel(sensor: Imager) -> None:
    """They are inside the sigma: pairs are used after the calibration, and the sigma without satellites holds."""
    out = fly(sensor, satellites=lambda t: t < 55.0, end_s=80.0)
    assert all(each.valid for each in drifts(out, 58.0))
    whole = [each for each in drifts(out, 20.0) if each.directions == 3]
    assert len(whole) > 20
    sigmas_that_hold(whole)
    solution = last_solution(out)
    assert solution.horizontal_sd is not None
    assert abs(north_error(solution)) < 3.0 * solution.horizontal_sd


def test_before_a_roll_has_shown_the_clock_a_drift_is_not_used() -> None:
    with known_sensor(clock_sd=0.015):
        out = fly(Imager(late=0.05), end_s=70.0)
    assert len(drifts(out, 20.0)) > 15
    assert not any(each.valid for each in drifts(out))
    assert {each.reasons for each in drifts(out, 20.0)} == {(Reason.NOT_CALIBRATED,)}
    assert drifts(out)[-1].clock_sd == pytest.approx(0.015, rel=0.1)


def test_without_a_known_heading_a_wrong_mounting_is_not_used() -> None:
    with known_sensor(math.radians(2.0)):
        out = fly(Imager(yaw=math.radians(1.0)), end_s=70.0)
    assert len(drifts(out, 20.0)) > 15
    assert not any(each.valid for each in drifts(out))
    assert {each.reasons for each in drifts(out, 20.0)} == {(Reason.NOT_CALIBRATED,)}


def test_a_wrong_mounting_that_begins_in_the_outage_ends_the_aiding() -> None:
    sound, turned = Imager(), Imager(yaw=math.radians(3.0))

    class Turning:
        def scans(self, k: int) -> list[RangeScan]:
            return (turned if k >= 7500 else sound).scans(k)

    out = fly(Turning())
    assert all(each.valid for each in drifts(out, 60.0, 74.0))
    assert not any(each.valid for each in drifts(out, 77.0))
    assert "contradict the filter" in events(out)[-1][1]


def test_without_satellites_there_is_no_calibration() -> None:
    out = fly(Imager(lasts=lambda t: t > 20.0), satellites=lambda t: t < 15.0, end_s=80.0)
    assert not any(each.valid for each in drifts(out))
    assert {each.reasons for each in drifts(out, 25.0)} == {(Reason.NOT_CALIBRATED,)}
    alone = fly(Imager(lasts=lambda _: False), satellites=lambda t: t < 15.0, end_s=80.0)
    assert last_solution(out).horizontal_sd == pytest.approx(last_solution(alone).horizontal_sd, rel=1e-9)


def test_on_trial_position_and_velocity_do_not_depend_on_it() -> None:
    with_drift, without = (fly(Imager(lasts=lasts), end_s=25.0) for lasts in (lambda _: True, lambda _: False))
    assert len(drifts(with_drift, 10.0)) > 3
    first, second = last_solution(with_drift), last_solution(without)
    assert (first.lat, first.lon, first.alt) == (second.lat, second.lon, second.alt)
    assert first.horizontal_sd == second.horizontal_sd


class Turntable:
    """A scanner that turns about the axis of the aircraft, ten times a second, in parts of 5 ms."""

    def __init__(self, mat_bs: Array | None = None) -> None:
        self._mat_bs = np.eye(3) if mat_bs is None else mat_bs

    def scans(self, k: int) -> list[RangeScan]:
        t, found = 0.01 * k, []
        for part in (0.0, 0.005):
            offsets = np.repeat(np.arange(40) * 0.005 / 40, 16)
            azimuth = 2.0 * math.pi * 10.0 * (t + part + offsets)
            along = np.tile(np.radians(np.linspace(-30.0, 30.0, 16)), 40)
            rays = np.stack((np.sin(along), np.cos(along) * np.sin(azimuth), np.cos(along) * np.cos(azimuth)), axis=1)
            down = rays[:, 2] > 0.35
            measured = np.full(len(rays), np.nan)
            measured[down] = ranges(t + part + offsets[down], rays[down], waves)
            measured += RANGE_SD * np.random.default_rng(k).standard_normal(len(rays))
            stamp = Stamp(T0 + k * 10 * MS + round(part * S))
            found.append(make_scan(stamp, measured, point_arrays(rays @ self._mat_bs, offsets)))
        return found


def test_the_parts_of_a_turn_are_one_look_and_each_point_has_its_pose() -> None:
    mounted = {"rpy_bs_deg": (0.0, 0.0, 90.0)}
    mat_bs = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    out = fly(Turntable(mat_bs), end_s=60.0, exposure_s=0.2, mounted=mounted)
    found = [each for each in drifts(out, 20.0) if each.directions == 3]
    assert len(found) > 10
    errors = np.array([[each.north, each.east, each.down] for each in found])
    assert (np.abs(errors) < [0.6, 0.9, 0.6]).all()  # 6 m if all points had the pose of the first
    assert any(each.valid for each in found)


def test_any_cut_of_scans_of_another_length_raises_nothing() -> None:
    scan = Imager().scans(50)[0]
    arrays = scan.arrays

    class Damaged:
        def scans(self, k: int) -> Sequence[RangeScan]:
            if k % 50:
                return []
            stamp = Stamp(T0 + k * 10 * MS)
            broken = (
                replace(scan, points=7),
                replace(scan, arrays=replace(arrays, ranges=np.full(SIDE**2, 1e30, "<f4").tobytes())),
                replace(scan, arrays=replace(arrays, directions=np.full(3 * SIDE**2, np.nan, "<f4").tobytes())),
                replace(scan, arrays=replace(arrays, offsets=np.full(SIDE**2, np.inf, "<f4").tobytes())),
                replace(scan, arrays=replace(arrays, ranges=np.full(SIDE**2, 100.0, "<f4").tobytes())),
                replace(scan, valid=False),
            )
            return [replace(broken[k // 50 % len(broken)], stamp=stamp)]

    out = fly(Damaged(), end_s=40.0)
    assert not any(each.valid for each in drifts(out))
    assert last_solution(out).valid


@pytest.mark.parametrize("ahead_s", [100.0, -9.9])
def test_one_scan_of_another_time_ends_no_looks(ahead_s: float) -> None:
    """100 s ahead or 10 s behind, as after a fault of the clock of a device: looks go on with the next scans."""

    class Jumping:
        def scans(self, k: int) -> Sequence[RangeScan]:
            found = Imager().scans(k)
            return [
                replace(each, stamp=Stamp(T0 + round(ahead_s * S) + k * 10 * MS)) for each in found if k == 1000
            ] or found

    found = drifts(fly(Jumping(), end_s=25.0), 14.0)
    assert sum(each.directions == 3 for each in found) > 5


def test_a_calibration_needs_time_and_pairs_in_succession() -> None:
    calibration = Calibration()
    assert not any(calibration.agree(k * S) for k in range(20))  # enough pairs, too soon
    assert not calibration.agree(60 * S, knows_clock=False)
    assert not calibration.contradict(20 * S)
    assert [calibration.agree(k * S) for k in range(21, 60, 4)] == [False] * 8 + [True, False]
    assert calibration.is_complete
    assert [calibration.contradict(k * S) for k in (70, 140, 141, 142)] == [False, False, True, False]
    assert calibration.reasons == (Reason.CONTRADICTION, Reason.NOT_CALIBRATED)
    assert any(calibration.agree(k * S) for k in range(250, 290))
    assert not calibration.reasons


def test_the_first_pair_of_a_flight_compiles_nothing() -> None:
    """In an interpreter of its own: navigation must not stand still for seconds."""
    script = """
from fti.nav import look_pairs
from fti.nav.filter import kernels, look_mark, navigator
from fti.nav.scan_matching import plane_lattice, residuals, shift_search
from tests.nav.test_ground_drift import Imager, Turntable, drifts, fly, known_sensor

used = (
    residuals.add_scores, plane_lattice._sort_by_cell, plane_lattice._fit_planes, plane_lattice.surfaces_at,
    shift_search._patch_means, look_mark._carry_turn, kernels.consider, kernels.fuse, kernels.correct,
)
navigator.warm_up()
look_pairs.warm_up()
compiled = [len(kernel.signatures) for kernel in used]
assert min(compiled) > 0, compiled
with known_sensor():
    assert any(each.valid for each in drifts(fly(Imager(), end_s=60.0)))
assert drifts(fly(Turntable(), end_s=20.0, exposure_s=0.2))
assert [len(kernel.signatures) for kernel in used] == compiled
"""
    subprocess.run([sys.executable, "-c", script], cwd=ROOT, check=True)
