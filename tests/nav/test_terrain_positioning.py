"""Position from the ground in the live filter: flights over known ground whose sensors are drawn by the study's code.

The truth is the flight; the ground of the truth is that of the map unless a test displaces it.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from fti.config import Altimeter, Device, TerrainPositionTable
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.messages.measurements import BeamRange, Stamp
from fti.messages.outputs import HeightAboveGround, TerrainFix
from fti.messages.reasons import Reason
from fti.nav import terrain_positioning
from fti.nav.filter.error_states import FilterModel
from fti.nav.filter.estimate import Estimate
from fti.nav.height_profile import ProfileSamples
from fti.nav.match_task import MatchTask
from fti.nav.navigation import NavState
from fti.nav.source_interpolation import AttitudeState
from fti.nav.terrain_positioning import TerrainPosition
from fti.nav.terrain_reference import Ground
from fti.ranging.multibeam import beams_across
from fti.study.ground_flights import LAT, LON, FixResult, GroundCase, GroundRun, Satellites, fly, relief
from fti.study.long_endurance.beams import BeamPosition
from fti.study.ppsan_aiding.experiment import SURVEY_SD_M, fly_schedule
from fti.terrain.dem_error import DemError

SEED, NUMBER = 3, 4
OUTAGE = (Satellites(40.0, 160.0, None),)


def run(**changes: object) -> GroundRun:
    return fly(GroundCase(**{"seconds": 160.0, "window_s": 10.0, "map_sd": 2.0, **changes}), SEED, NUMBER)  # type: ignore[arg-type]


def reasons(flown: GroundRun) -> set[Reason]:
    return {reason for fix in flown.fixes for reason in fix.fix.reasons}


def contradictions(flown: GroundRun) -> list[float]:
    """When fixes begin to contradict the filter [s]."""
    return [t for t, event in flown.events if "the map or the position is wrong" in event.text]


@pytest.fixture(scope="module")
def outage() -> GroundRun:
    return run(satellites=OUTAGE)


def test_without_satellites_the_ground_bounds_the_error(outage: GroundRun) -> None:
    alone = run(satellites=OUTAGE, window_s=None)
    assert alone.distance[-1] > 20.0
    assert outage.distance[np.array(outage.t) > 45.0].max() < 12.0
    assert np.all(outage.distance < np.array(outage.hpl))


def test_fixes_state_their_error_and_what_is_not_verified(outage: GroundRun) -> None:
    valid = [each for each in outage.fixes if each.fix.valid]
    assert len(valid) >= 10
    for each in valid:
        fix = each.fix
        assert fix.north_sd is not None
        assert fix.east_sd is not None
        assert abs(each.error[0]) < 4.0 * fix.north_sd + 0.5
        assert abs(each.error[1]) < 4.0 * fix.east_sd + 0.5
        assert (Reason.MAP_UNVERIFIED in fix.unchecked) == (fix.t_ns > 50e9)
        assert fix.length == pytest.approx(600.0, rel=0.1)


def test_profiles_do_not_overlap(outage: GroundRun) -> None:
    marks = np.array([each.fix.t_valid_ns for each in outage.fixes]) / 1e9
    assert np.diff(marks).min() >= 10.0
    assert {each.fix.samples for each in outage.fixes} <= set(range(48, 54))


def test_a_search_needs_three_fixes_that_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(terrain_positioning, "CERTAIN_SD_M", 0.0)
    flown = run(seconds=60.0)
    fixes = [each.fix for each in flown.fixes]
    first = next(k for k, fix in enumerate(fixes) if fix.valid)
    assert all(fix.is_search for fix in fixes[: first + 1])
    assert [fix.reasons for fix in fixes[max(first - 2, 0) : first]] == [(Reason.NOT_CONFIRMED,)] * 2
    assert not any(fix.is_search for fix in fixes[first + 1 :])


@pytest.mark.parametrize("north_m", [100.0, -60.0])
def test_a_displaced_map_is_announced_while_satellites_are_received(north_m: float) -> None:
    flown = run(seconds=70.0, map_shift=(0.0, north_m))
    assert not any(each.fix.valid for each in flown.fixes)
    assert contradictions(flown)[0] < 60.0
    assert flown.distance.max() < 8.0
    # the fix is where the displaced map has it: the distance is announced
    offsets = [each.error[0] for each in flown.fixes if each.fix.reasons == (Reason.REJECTED,)]
    assert offsets
    assert np.median(offsets) == pytest.approx(north_m, abs=8.0)


@pytest.mark.parametrize("dem_error", [None, DemError(noise_sd=1.0)], ids=["exact map", "map with errors"])
def test_flat_ground_gives_no_position(dem_error: DemError | None) -> None:
    flown = run(relief="flat", satellites=OUTAGE, dem_error=dem_error)
    assert not any(each.fix.valid for each in flown.fixes)
    assert Reason.GROUND_FLAT in reasons(flown)
    assert np.all(flown.distance < np.array(flown.hpl))


@pytest.mark.parametrize("speed_mps", [1.0])
def test_a_ramp_of_the_satellites_is_announced_by_the_ground(speed_mps: float) -> None:
    flown = run(seconds=140.0, ramp=(60.0, speed_mps, 0.1))
    alarms = [t for t, event in flown.events if event.level == "warning" and t > 60.0]
    assert alarms
    at = int(np.searchsorted(flown.t, alarms[0]))
    assert flown.distance[min(at, len(flown.t) - 1)] < 35.0
    assert np.all(flown.distance < np.array(flown.hpl) + 1.0)


def test_without_ramp_nothing_is_announced(outage: GroundRun) -> None:
    assert [event.text for _, event in outage.events if event.level == "warning"] == []
    assert not any(math.isnan(error) for each in outage.fixes for error in each.error)


def test_satellites_that_return_do_not_bend_a_profile() -> None:
    """They correct the position by 4 m at 100 s: a profile across that gave a fix of 5 sigma, which refused them."""
    flown = fly_schedule("outages", SURVEY_SD_M, 16, 6)
    marks = np.array([(each.fix.t_valid_ns or 0) / 1e9 for each in flown.fixes])
    assert len(marks) > 18
    assert np.abs(marks - 100.0).min() > 5.0
    assert [event.text for _, event in flown.events if event.level == "warning"] == []


#: Flights over three grounds, whose known elevation has errors, without satellites after 40 s.
BEAM_CASE = GroundCase(
    seconds=120.0,
    window_s=10.0,
    map_sd=2.0,
    satellites=(Satellites(40.0, 120.0, None),),
    dem_error=DemError(noise_sd=1.5),
)
BEAM_FLIGHTS = (0, 10, 20)


def beam_fixes(number: int) -> list[FixResult]:
    """Valid fixes without satellites of flights with a number of beams."""
    make = functools.partial(BeamPosition, number)
    flown = [fly(BEAM_CASE, SEED, flight, make) for flight in BEAM_FLIGHTS]
    return [each for run in flown for each in run.fixes if each.fix.valid and (each.fix.t_valid_ns or 0) > 40e9]


def rms_m(fixes: list[FixResult]) -> float:
    return float(np.sqrt(np.mean([error**2 for each in fixes for error in each.error])))


def test_five_beams_state_their_error_and_it_is_smaller_than_that_of_one() -> None:
    five, one = beam_fixes(5), beam_fixes(1)
    assert min(len(five), len(one)) >= 18
    assert {each.fix.method for each in five} == {"beams"}
    nees = []
    for each in five:
        fix, off = each.fix, np.array(each.error)
        assert fix.north_sd is not None and fix.east_sd is not None and fix.correlation is not None
        across = fix.correlation * fix.north_sd * fix.east_sd
        nees.append(0.5 * off @ np.linalg.solve([[fix.north_sd**2, across], [across, fix.east_sd**2]], off))
    assert 0.4 < np.mean(nees) < 1.7  # 24 fixes: three sigma of their mean are 0.6
    assert rms_m(five) < 0.7 * rms_m(one)


class Wanderer:
    """A filter whose state is anything: it is not aligned at times, jumps, and is more or less certain."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng, self.fed = rng, list[object]()

    def estimate(self, t_ns: int) -> Estimate | None:
        rng = self._rng
        if rng.random() < 0.002:
            return None
        jump = 1e4 * rng.standard_normal(3) if rng.random() < 0.002 else np.zeros(3)
        here, there = (ecef_from_geodetic(LAT, LON + 1e-5 * (t_ns / 1e9 + ahead), 400.0) for ahead in (0.0, 1.0))
        vel = there - here + rng.standard_normal(3)
        y = np.concatenate((here + jump, vel, [1.0, 0.0, 0.0, 0.0], np.zeros(6)))
        P = np.diag(10.0 ** rng.uniform(-2.0, 8.0, 15))
        return Estimate(t_ns, y, P, np.zeros(6), FilterModel())

    def feed_terrain_fix(self, t_ns: int, aiding: object) -> None:
        self.fed.append(aiding)

    def is_accepted(self, name: str, t_ns: int) -> bool | None:
        return (True, False, None)[self._rng.integers(3)]

    def has_satellites(self, t_ns: int) -> bool:
        return bool(self._rng.random() < 0.5)


class Steady(Wanderer):
    """A filter in level flight to the east."""

    def estimate(self, t_ns: int) -> Estimate:
        here, there = (ecef_from_geodetic(LAT, LON + 1e-5 * (t_ns / 1e9 + ahead), 400.0) for ahead in (0.0, 1.0))
        y = np.concatenate((here, there - here, [1.0, 0.0, 0.0, 0.0], np.zeros(6)))
        return Estimate(t_ns, y, np.eye(15), np.zeros(6), FilterModel())


class InclinedGround(Ground):
    """Its sigma grows to the east."""

    def sd_at(self, east: float, north: float) -> float:
        return 10.0 + 1e-3 * east


class ProfileRecorder:
    """Keeps the samples of each profile."""

    def __init__(self) -> None:
        self.samples: list[ProfileSamples] = []

    def see_mark(self, t_ns: int, mark: object) -> None:
        """Marks are not kept."""

    def see_profile(self, task: MatchTask, fix: TerrainFix, marked: Estimate) -> None:
        self.samples.append(task.heights.samples)


def feed_frame(position: TerrainPosition, k: int) -> None:
    """Three beams; the third is old in the first second, the second is sent twice, and the roll is 31 deg at 2 s."""
    t_ns = k * 20_000_000
    roll = math.radians(31.0) if k == 100 else 0.0  # beyond the limit of the altimeter
    nav = NavState(t_ns, AttitudeState(roll, 0.0, 0.0, 0.001, 0.001), None, None, None)
    for number in (0, 1, 1, 2):
        along, across = beams_across(3)[number]
        stamp = Stamp(t_ns + (200_000_000 if number == 2 and k < 50 else 0))
        beam = BeamRange(stamp=stamp, beam="", along=along, across=across, slant_range=300.0)
        position.feed_beam(beam, t_ns, lambda _: nav)


def test_frames_at_10_hz_become_samples_at_5_hz_with_all_beams_once() -> None:
    altimeter = Altimeter(kind="multibeam", range_m=(1.0, 3000.0), sd_m=0.3)
    device = Device(name="laser", link="l", driver="d", altimeter=altimeter, max_age_ms=100.0)
    table, recorder = TerrainPositionTable(altimeter="laser", window_s=5.0), ProfileRecorder()
    aided = Steady(np.random.default_rng(1))
    position = TerrainPosition(table, {"laser": device}, aided, recorder)  # type: ignore[arg-type]
    position.set_terrain(InclinedGround(relief("hills", 0), 0.2, "hills"))
    for k in range(300):
        if k % 5 == 0:
            feed_frame(position, k)
        position.tick(k * 20_000_000)
    (samples,) = recorder.samples
    times, counts = np.unique(samples.t, return_counts=True)
    assert times.tolist() == pytest.approx([*np.arange(0.0, 1.9, 0.2), *np.arange(2.1, 5.2, 0.2)])
    assert counts.tolist() == [2] * 5 + [3] * (len(times) - 5)
    assert np.linalg.norm(samples.axes, axis=1) == pytest.approx(1.0)
    points_east = samples.origins[:, 0] + 300.0 * samples.axes[:, 0]
    assert samples.dem_sds == pytest.approx(10.0 + 1e-3 * points_east)
    assert np.ptp(points_east[-3:]) == pytest.approx(2.0 * 300.0 * math.sin(math.radians(20.0)), rel=0.01)


def hostile_input(
    position: TerrainPosition, kind: str, rng: np.random.Generator, t_ns: int, attitude: AttitudeState | None
) -> None:
    """A height, or a frame of five beams, with any value, age and attitude."""
    nav = NavState(t_ns, attitude, None, None, None)
    late_ns = int(rng.integers(0, 300_000_000))
    values = [float(rng.choice([rng.uniform(0.0, 3000.0), 300.0, 1.0, math.nan])) for _ in range(5)]
    if kind == "multibeam":
        for (along, across), value in zip(beams_across(5), values, strict=True):
            slant_range = None if rng.random() < 0.1 else value
            beam = BeamRange(stamp=Stamp(t_ns), beam="b", along=along, across=across, slant_range=slant_range)
            valid_ns = t_ns - late_ns - int(rng.random() < 0.05)
            position.feed_beam(beam, valid_ns, lambda at_ns: structs.replace(nav, t_ns=at_ns))
        return
    raw = None if rng.random() < 0.05 else np.nan_to_num(values[0], nan=2.0).item()
    height = HeightAboveGround(
        t_ns=t_ns, t_valid_ns=t_ns - late_ns, sensor="laser", raw=raw, height_agl=raw, sd=0.3, valid=True,
        reasons=(), nearest=raw, nearest_sd=None if rng.random() < 0.1 else 0.3,
    )  # fmt: skip
    position.feed_height(height, nav)


@pytest.mark.parametrize("kind", ["laser", "radar", "multibeam"])
def test_hostile_ranges_raise_nothing_and_no_output_is_infinite(kind: Any) -> None:
    rng = np.random.default_rng([0, 99])
    ground = relief("hills", 0)
    holes = ground.finest.heights.copy()
    holes[rng.integers(0, len(holes), 400), rng.integers(0, len(holes), 400)] = np.nan
    altimeter = Altimeter(kind=kind, range_m=(1.0, 3000.0), beam_deg=40.0)
    devices = {"laser": Device(name="laser", link="l", driver="d", altimeter=altimeter)}
    table = TerrainPositionTable(altimeter="laser", window_s=5.0)
    position = TerrainPosition(table, devices, Wanderer(rng))  # type: ignore[arg-type]
    position.set_terrain(Ground(ground.with_finest(holes), 1.0, "holes"))
    outputs, matched = 0, 0
    for k in range(4000):
        t_ns = k * 20_000_000
        if k % 10 == 0:
            roll, pitch, heading = (rng.uniform(-1.5, 1.5, 3) if rng.random() < 0.1 else np.zeros(3)).tolist()
            attitude = None if rng.random() < 0.01 else AttitudeState(roll, pitch, heading, 0.001, 0.001)
            hostile_input(position, kind, rng, t_ns, attitude)
        for output in position.tick(t_ns):
            outputs += 1
            if isinstance(output, TerrainFix):
                numbers = [value for value in structs.asdict(output).values() if isinstance(value, float)]
                assert all(map(math.isfinite, numbers)), output
                matched += output.north_sd is not None
    assert outputs > 150
    assert matched > 0
