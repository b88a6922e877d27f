"""A flight explains flags where it is beyond the limits of the configuration, and nowhere else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fti.arrays import Array
from fti.config import Config
from fti.devices import bind_devices
from fti.hil import scenario as scenarios
from fti.hil.oracle.fault_flags import flags_of_fault
from fti.hil.oracle.flag_definitions import FlagAllowance
from fti.hil.oracle.flight_flags import flight_allowances
from fti.hil.oracle.roles import AircraftRoles, TruthSeries
from fti.hil.tables.fault_types import Obstacle, Stuck

OF_GROUND = ("dispersion", "incidence")
T = np.arange(0.0, 60.0, 0.1)
LEVEL = TruthSeries(T, 0 * T + 200.0, 4000.0 - 50.0 * T, *[0 * T] * 4)
#: The middle twenty seconds.
MIDDLE = (T >= 20.0) & (T <= 40.0)
LASER = "/nav/height_above_ground/autopilot"
ALTIMETER, INTEGRITY = "/nav/height_above_ground/altimeter", "/nav/clearance_integrity"


@pytest.fixture(scope="module")
def craft() -> AircraftRoles:
    scenario = scenarios.load(scenarios.find("nominal"))
    config = scenarios.load_config(scenario)
    return AircraftRoles(config, bind_devices(config), scenario)


def at(place: str, allowances: tuple[FlagAllowance, ...]) -> list[FlagAllowance]:
    """Allowances at a place, without those of uneven ground."""
    return [allowance for allowance in allowances if allowance.place == place and allowance.words != OF_GROUND]


def test_uneven_ground_explains_itself_and_nothing_else(craft: AircraftRoles) -> None:
    (allowance,) = [allowance for allowance in flight_allowances(craft, LEVEL) if allowance.place == ALTIMETER]
    assert allowance.words == OF_GROUND
    assert allowance.explains(ALTIMETER, "incidence")
    assert not allowance.explains(ALTIMETER, "deviation")


def beam(here: Array, aside: float | Array = 0.0) -> TruthSeries:
    """A flight on which the laser measures so much, and so much more to the side of it [m]."""
    return replace(LEVEL, ranges={"autopilot": (here, here, here + aside)})


def edges(allowances: tuple[FlagAllowance, ...]) -> list[tuple[float, float]]:
    return [(a.from_s, a.until_s) for a in allowances if a.explains(LASER, "deviation")]


def test_the_edge_of_a_wood_in_the_beam_explains_a_deviation_just_there(craft: AircraftRoles) -> None:
    (edge,) = edges(flight_allowances(craft, beam(np.where(T < 30.0, 180.0, 199.0))))
    assert 29.85 < edge[0] < 30.0 < edge[1] < 30.45
    (to_the_side,) = edges(flight_allowances(craft, beam(0.0 * T + 180.0, np.where(MIDDLE, 19.0, 0.0))))
    assert 19.85 < to_the_side[0] < 20.0
    assert 40.0 < to_the_side[1] < 40.45


@pytest.mark.parametrize(
    "here",
    [
        pytest.param(180.0 + 20.0 * np.sin(T), id="a slope that is climbed within a second"),
        pytest.param(np.where(T < 30.0, 180.0, 184.0), id="an edge that is lower than the limit"),
        pytest.param(np.where(T < 30.0, 180.0, np.nan), id="ground that ends"),
    ],
)
def test_ground_without_an_edge_explains_no_deviation(craft: AircraftRoles, here: Array) -> None:
    assert edges(flight_allowances(craft, beam(here))) == []


def test_the_edge_in_one_beam_explains_nothing_of_another(craft: AircraftRoles) -> None:
    allowances = flight_allowances(craft, beam(np.where(T < 30.0, 180.0, 199.0)))
    assert not [allowance for allowance in allowances if allowance.explains(ALTIMETER, "deviation")]
    assert not [a for a in allowances if a.explains(LASER, "stale") or a.explains(LASER, "not_nadir")]


def test_a_height_that_stands_still_is_due_as_soon_as_the_ground_changes(craft: AircraftRoles) -> None:
    climbing = replace(LEVEL, height_agl=200.0 + 2.0 * T)
    fault = Stuck(kind="stuck", devices=("altimeter",), from_s=10.0, to_s=50.0)
    (one,) = flags_of_fault(fault, craft, climbing)
    deviation, stuck = sorted(
        (expected_flag for expected_flag in one.expected_flags if expected_flag.place == ALTIMETER),
        key=lambda expected_flag: expected_flag.words,
    )
    assert deviation.words == ("deviation",)
    assert deviation.from_s == pytest.approx(25.0, abs=0.2)  # 30 m later
    assert stuck.words == ("stuck",)
    assert stuck.from_s == pytest.approx(37.0, abs=0.2)  # 10 m and a fifth of the 220 m later
    assert stuck.within_s == 3.0
    (level,) = flags_of_fault(fault, craft, LEVEL)
    assert level.expected_flags == ()
    assert level.unknown


def test_a_level_approach_explains_nothing_of_the_altimeter_and_of_integrity(craft: AircraftRoles) -> None:
    assert at(ALTIMETER, flight_allowances(craft, LEVEL)) + at(INTEGRITY, flight_allowances(craft, LEVEL)) == []


@pytest.mark.parametrize(
    ("name", "value", "altimeter"),
    [
        ("roll", np.deg2rad(-35.0), True),
        ("roll", np.deg2rad(12.0), False),
        ("offset", -160.0, False),
        ("climb", 4.0, False),
    ],
)
def test_what_is_beyond_a_limit_is_explained_for_as_long(
    craft: AircraftRoles, name: str, value: float, altimeter: bool
) -> None:
    changed: dict[str, Any] = {name: np.where(MIDDLE, value, 0.0)}
    allowances = flight_allowances(craft, replace(LEVEL, **changed))
    (integrity,) = at(INTEGRITY, allowances)
    assert integrity.from_s == pytest.approx(20.0)
    assert 40.0 < integrity.until_s < 70.0
    heights = at(ALTIMETER, allowances)
    assert bool(heights) == altimeter
    assert all(allowance.from_s == pytest.approx(20.0) and allowance.until_s < 41.0 for allowance in heights)


@pytest.mark.parametrize("height", [800.0, np.nan, 0.1])
def test_ground_that_cannot_be_measured_is_explained(craft: AircraftRoles, height: float) -> None:
    allowances = flight_allowances(craft, replace(LEVEL, height_agl=np.where(MIDDLE, height, 200.0)))
    (heights,), (device,) = at(ALTIMETER, allowances), at("/altimeter/", allowances)
    assert heights.from_s < 20.0 < 40.0 < heights.until_s < 43.0
    assert (device.from_s, device.until_s) == (heights.from_s, heights.until_s)
    assert at(INTEGRITY, allowances) == []


def test_an_obstacle_that_only_the_beam_has_reached_is_explained_and_not_due(craft: AircraftRoles) -> None:
    """The flight ends 45 m before the middle of it."""
    distance_m = LEVEL.before_threshold[-1] - 45.0
    (one,) = flags_of_fault(
        Obstacle(kind="obstacle", before_threshold_m=distance_m, height_m=60.0, length_m=40.0), craft, LEVEL
    )
    assert (one.expected_flags, one.unknown) == ((), "")
    allowance, *heights = one.allowances
    events = {"/fti/event/altimeter", "/fti/event/autopilot"}  # of what is refused by its memory
    assert {a.place for a in heights} == {ALTIMETER, "/nav/height_above_ground/autopilot", *events}
    assert allowance.explains(INTEGRITY, "obstacle")
    assert allowance.from_s > 50.0


def test_an_obstacle_that_nothing_reaches_explains_nothing(craft: AircraftRoles) -> None:
    far = Obstacle(kind="obstacle", before_threshold_m=-3000.0, height_m=60.0)
    (one,) = flags_of_fault(far, craft, LEVEL)
    assert (one.expected_flags, one.allowances) == ((), ())


def test_the_edge_of_the_known_terrain_explains_itself_and_ground_that_runs_out(craft: AircraftRoles) -> None:
    strip = AircraftRoles(
        with_scene("demo"), bind_devices(with_scene("demo")), scenarios.load(scenarios.find("nominal"))
    )
    away = replace(LEVEL, before_threshold=0 * T + 2500.0, offset=50.0 * T)  # 1350 m beside it the strip ends
    beyond = [a for a in flight_allowances(strip, away) if a.explains(ALTIMETER, "terrain_edge")]
    assert [allowance.from_s for allowance in beyond] == [pytest.approx(22.0, abs=1.0)]
    assert beyond[0].until_s >= T[-1]
    assert all(a.explains(ALTIMETER, "deviation") and not a.explains(ALTIMETER, "stale") for a in beyond)
    assert not [a for a in flight_allowances(craft, away) if a.explains(ALTIMETER, "terrain_edge")]  # country around it
    assert not [a for a in flight_allowances(strip, LEVEL) if a.explains(ALTIMETER, "terrain_edge")]


def with_scene(scene: str) -> Config:
    config = scenarios.load_config(scenarios.load(scenarios.find("nominal")))
    assert config.nav.terrain
    terrain = config.nav.terrain.model_copy(update={"scene": scene})
    return config.model_copy(update={"nav": config.nav.model_copy(update={"terrain": terrain})})
