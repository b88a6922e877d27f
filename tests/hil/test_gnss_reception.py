"""The satellite receiver: terrain in the way, a fix and how good it is, and what each fault does to it."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.config import Device
from fti.devices import BoundDevice
from fti.geodesy.formulas import SEMI_MAJOR
from fti.hil.environment import Environment
from fti.hil.scenario import Scenario
from fti.hil.sensors.gnss_reception import (
    KNOT_S,
    NAVIGATION,
    REACQUIRE_S,
    Reception,
    _visible_long_enough,
    terrain_mask,
)
from fti.hil.tables.fault_types import Fault, GnssDegraded, GnssOffset, GnssOutage
from fti.messages.measurements import Position, Stamp
from fti.terrain.terrain import Terrain
from tests.hil.worlds import flat_terrain, path, scenario

Array = NDArray[np.float64]
DURATION_S = 60.0
T = np.arange(0.0, DURATION_S, 0.2)
CELL_M, HALF_M = 20.0, 6000.0
FLIGHT = Scenario.model_validate(
    {"title": "", "description": "", "config": "", "flight": {"duration_s": DURATION_S}}
).flight


def made(*faults: Fault, terrain: Terrain | None = None, seed: int = 1, name: str = "gnss") -> Reception:
    plan = scenario(flight=FLIGHT, fault=faults, seed=seed)
    world = Environment(plan, path(), terrain or flat(), undulation=47.0)
    return Reception(receiver(name), NAVIGATION, world, T, np.random.default_rng(seed))


@functools.cache
def flat() -> Terrain:
    return flat_terrain(CELL_M)


def receiver(name: str = "gnss") -> BoundDevice:
    device = Device.model_validate({"name": name, "link": "line", "driver": "nmea0183"})
    return BoundDevice(device, None, None)  # type: ignore[arg-type]


def errors(reception: Reception, samples: slice = slice(None)) -> tuple[Array, Array]:
    """Of position, north, east, up [m], and what it states, horizontal and vertical [m]; samples without a fix NaN."""
    positions = [reception.position(k, Stamp(0)) for k in range(len(T))[samples]]
    place = reception.place[samples]
    lat, lon, alt, sd_h, sd_v = (
        np.array([getattr(p, name) if p.valid else np.nan for p in positions])
        for name in ("lat", "lon", "alt", "horizontal_sd", "vertical_sd")
    )
    north, east = lat - place[:, 0], (lon - place[:, 1]) * np.cos(place[:, 0])
    error = np.stack([north * SEMI_MAJOR, east * SEMI_MAJOR, alt - place[:, 2]], axis=1)
    return error, np.stack([sd_h, sd_v], axis=1)


@functools.cache
def at_first(seed: int) -> tuple[Array, Array]:
    """Errors and what is stated at the beginning of a short flight, shapes (3,) and (2,)."""
    there = Environment(scenario(flight={"duration_s": 3.0}, seed=seed), path(), flat(), undulation=47.0)
    short = Reception(receiver(), NAVIGATION, there, T[:5], np.random.default_rng(seed))
    error, stated = errors(short, slice(0, 1))
    return error[0], stated[0]


def walls(half_width_m: float, begin_m: float, end_m: float, height_m: float, left: bool = True) -> Terrain:
    """The flat country with walls beside the approach between two distances before the threshold."""
    side = np.arange(-HALF_M, HALF_M + CELL_M, CELL_M)
    east, north = np.meshgrid(side, side)
    course = math.radians(250.0)
    before = -(east * math.sin(course) + north * math.cos(course))
    right = east * math.cos(course) - north * math.sin(course)
    away = np.abs(right) if left else right
    inside = (before > end_m) & (before < begin_m) & (away > half_width_m)
    return flat().with_finest(np.where(inside, height_m, 0.0))


# --------------------------------------------------------------------------------------------------------- the fix


def test_what_it_states_is_how_wrong_it_is() -> None:
    """One sample of each of 40 flights: squares over the variances stated are those of one degree of freedom each."""
    rows = [at_first(seed) for seed in range(40)]
    normed = np.array([error / sd[[0, 0, 1]] for error, sd in rows])
    assert np.mean(normed**2, axis=0).mean() == pytest.approx(1.0, abs=4 * math.sqrt(2.0 / 120.0))
    assert abs(normed.mean()) < 4 / math.sqrt(120.0)


def test_on_an_open_sky_it_is_as_good_as_an_undisturbed_receiver() -> None:
    """Spiegel 2018, section 7.3.4: 2 m horizontally and 3 m vertically; here it goes with the sky."""
    stated = np.array([at_first(seed)[1] for seed in range(20)])
    assert np.median(stated[:, 0]) == pytest.approx(2.0, abs=0.6)
    assert np.median(stated[:, 1]) == pytest.approx(3.0, abs=0.9)


def test_errors_wander_and_do_not_jump() -> None:
    error, _ = errors(made())
    assert np.abs(np.diff(error, axis=0)).max() < 0.5
    assert error.std(axis=0).min() > 0.02


def test_the_same_scenario_has_the_same_sky_and_another_seed_another_one() -> None:
    first, again, other = made(), made(), made(seed=2)
    np.testing.assert_array_equal(errors(first)[0], errors(again)[0])
    assert first.satellites(0, Stamp(0)) == again.satellites(0, Stamp(0))
    assert first.satellites(0, Stamp(0)) != other.satellites(0, Stamp(0))
    second = made(name="other", seed=1)
    assert second.satellites(0, Stamp(0)) == first.satellites(0, Stamp(0))


# ----------------------------------------------------------------------------------------------------- the terrain


def test_a_wall_hides_what_stands_lower_than_its_edge() -> None:
    """A wall of 3000 m, 400 m right of a straight track: the tangent of the least elevation is height over distance."""
    terrain = walls(400.0, 5900.0, -3000.0, 3000.0)
    wgs = terrain.frame.to_geodetic(np.array([[0.0, 0.0, 100.0]]))
    place = np.array([[wgs[0][0], wgs[1][0], wgs[2][0]]])
    course = math.radians(250.0)
    aside = np.deg2rad(np.arange(20.0, 161.0, 10.0))
    edge = np.arctan2(2900.0, 400.0 / np.sin(aside))
    for above, hidden in ((-0.02, True), (0.02, False)):
        az, el = (course + aside)[None, :] % (2 * math.pi), (edge + above)[None, :]
        mask = terrain_mask(terrain, place, az, el, np.ones_like(az, dtype=bool))
        assert (mask == hidden).all()
    level = np.full((1, len(aside)), 0.1)
    along = terrain_mask(terrain, place, np.full_like(level, course), level, np.ones_like(level, dtype=bool))
    assert not along.any()  # along the gorge


@functools.cache
def gorge() -> Reception:
    """At 60 m/s from 4500 m on: between walls from 20 s to 40 s."""
    return made(terrain=walls(60.0, 3300.0, 2100.0, 1200.0))


def test_between_walls_satellites_and_fix_are_lost_and_come_back_after_a_time() -> None:
    reception = gorge()
    used = np.array([reception.satellites(k, Stamp(0)).used for k in range(len(T))])
    inside, before, later = (T > 22.0) & (T < 38.0), T < 18.0, T > 40.0 + REACQUIRE_S + 2.0
    assert used[0] > 8
    assert used[inside].max() == 0
    assert not reception.fix[inside].any()
    assert reception.fix[before].all()
    assert reception.fix[later].all()


def test_a_satellite_that_comes_into_view_is_used_after_a_time() -> None:
    visible = np.array([1, 1, 0, 1, 1, 1, 1], dtype=bool)[:, None]
    assert _visible_long_enough(visible, 2)[:, 0].tolist() == [True, True, False, False, False, True, True]
    reception = gorge()
    lost = T[~reception.fix]
    opened = 40.0 - KNOT_S  # 2100 m before the threshold, at 60 m/s
    assert opened + REACQUIRE_S <= lost.max() <= 40.0 + REACQUIRE_S + 2.0 * KNOT_S


def test_without_a_fix_it_says_nothing_else() -> None:
    reception = gorge()
    k = int(np.flatnonzero(~reception.fix)[0])
    assert reception.position(k, Stamp(3)) == Position(stamp=Stamp(3), valid=False)
    velocity, satellites = reception.velocity(k, Stamp(3)), reception.satellites(k, Stamp(3))
    assert (velocity.valid, velocity.north, velocity.ground_speed) == (False, None, None)
    assert (satellites.used, satellites.hdop, satellites.pdop) == (0, None, None)


def test_with_satellites_hidden_the_dilution_grows_and_so_does_what_it_states() -> None:
    """A single wall: half of the sky is left."""
    open_sky, hidden = made(), made(terrain=walls(150.0, 5900.0, -3000.0, 1200.0, left=False))
    fixed = np.flatnonzero(hidden.fix)
    assert len(fixed) > 50
    k = int(fixed[0])
    assert (hidden.satellites(k, Stamp(0)).used or 0) < (open_sky.satellites(k, Stamp(0)).used or 0)
    assert (hidden.satellites(k, Stamp(0)).pdop or 0) > 1.2 * (open_sky.satellites(k, Stamp(0)).pdop or 99.0)
    assert (hidden.position(k, Stamp(0)).vertical_sd or 0) > 1.2 * (open_sky.position(k, Stamp(0)).vertical_sd or 99.0)


# ------------------------------------------------------------------------------------------------------ the faults


def test_an_outage_ends_with_the_signals_and_the_time_to_find_them() -> None:
    reception = made(GnssOutage(kind="gnss_outage", devices=("gnss",), from_s=20.0, to_s=30.0))
    expected = (T < 20.0) | (T >= 30.0 + REACQUIRE_S)
    np.testing.assert_array_equal(reception.fix, expected)
    assert not reception.used_satellites(int(np.searchsorted(T, 25.0))).any()
    assert made(GnssOutage(kind="gnss_outage", devices=("other",), from_s=20.0, to_s=30.0)).fix.all()
    assert not made(GnssOutage(kind="gnss_outage", from_s=20.0, to_s=30.0)).fix.all()


def test_a_degraded_receiver_states_what_it_is() -> None:
    """The errors grow in the ratio of the sigmas, at once, and are as usual before and after."""
    fault = GnssDegraded(kind="gnss_degraded", from_s=20.0, to_s=40.0, horizontal_m=6.0, vertical_m=8.0)
    (usual, sd), (worse, stated) = errors(made()), errors(made(fault))
    inside = (T >= 20.0) & (T < 40.0)
    np.testing.assert_array_equal(worse[~inside], usual[~inside])
    np.testing.assert_allclose(stated[inside], [[6.0, 8.0]] * int(inside.sum()))
    np.testing.assert_allclose(worse[inside, 2] / usual[inside, 2], 8.0 / sd[inside, 1], rtol=1e-6)
    every = [errors(made(fault, seed=seed), slice(150, 151))[0][0] / (6.0, 6.0, 8.0) for seed in range(40)]
    assert np.mean(np.square(every)) == pytest.approx(1.0, abs=4 * math.sqrt(2.0 / 120.0))


def test_a_false_signal_moves_position_and_velocity_together_and_is_not_stated() -> None:
    fault = GnssOffset(kind="gnss_offset", from_s=20.0, to_s=50.0, north_m=200.0, up_m=60.0, over_s=20.0)
    plain, drawn = made(), made(fault)
    here, there = (np.array([_numbers(r, k) for k in range(len(T))]) for r in (plain, drawn))
    moved = there - here
    np.testing.assert_allclose(moved[T < 20.0], 0.0, atol=1e-6)
    np.testing.assert_allclose(moved[T >= 50.0], 0.0, atol=1e-6)
    share = np.clip((T - 20.0) / 20.0, 0.0, 1.0)
    inside = (T >= 20.0) & (T < 50.0)
    np.testing.assert_allclose(moved[inside, 0], 200.0 * share[inside], rtol=0.01, atol=0.01)
    np.testing.assert_allclose(moved[inside, 1], 60.0 * share[inside], atol=0.01)
    drawing = (T >= 20.0) & (T < 40.0)
    np.testing.assert_allclose(moved[drawing][:, 2:4], [[10.0, -3.0]] * int(drawing.sum()), atol=1e-9)
    np.testing.assert_allclose(moved[inside & ~drawing][:, 2:4], 0.0, atol=1e-9)
    np.testing.assert_array_equal(moved[:, 4:], 0.0)


def _numbers(reception: Reception, k: int) -> list[float]:
    """North [m], height [m], velocity north and down [m/s], what is stated of both heights and of the velocity."""
    p, v = reception.position(k, Stamp(0)), reception.velocity(k, Stamp(0))
    numbers = (p.lat, p.alt, v.north, v.down, p.horizontal_sd, p.vertical_sd, v.sd)
    known = [math.nan if value is None else value for value in numbers]
    return [known[0] * SEMI_MAJOR, *known[1:]]
