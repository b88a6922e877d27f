"""The second receiver itself, against closed forms and against pyproj."""

from __future__ import annotations

import numpy as np
import pyproj
import pytest

from tests.second_receiver.flights import wander
from tests.second_receiver.geometry import LAT0, LON0, body_to_enu, to_geodetic
from tests.second_receiver.ground import POST_M, Surface, make_surface, random_field, survey
from tests.second_receiver.laser import Laser
from tests.second_receiver.radar import FOOT_M, Radar, step_m

SPEED = np.array([[0.0, 60.0, 0.0]])
POSTS = np.arange(512) * POST_M - 640.0


def plane(slope_deg: float) -> Surface:
    """Rising to the east, in the middle of a tile."""
    top = np.broadcast_to(np.tan(np.deg2rad(slope_deg)) * POSTS, (512, 512)).copy()
    return Surface(top, top, np.zeros_like(top), POSTS[0], POSTS[0])


def attitude(roll_deg: float = 0.0, pitch_deg: float = 0.0) -> np.ndarray:
    return body_to_enu([np.deg2rad(roll_deg)], [np.deg2rad(pitch_deg)], [0.0])


def test_places_are_those_of_pyproj() -> None:
    places = np.array([[0.0, 0.0, 0.0], [3000.0, -2000.0, 250.0], [-900.0, 4000.0, -30.0]])
    lat, lon, alt = to_geodetic(places)
    text = f"+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +lat_0={np.rad2deg(LAT0)} "
    to_local = pyproj.Transformer.from_pipeline(text + f"+lon_0={np.rad2deg(LON0)} +h_0=0 +ellps=WGS84")
    east, north, up = to_local.transform(lon, lat, alt, radians=True)
    assert np.stack((east, north, up), -1) == pytest.approx(places, abs=1e-5)


def test_the_aircraft_s_axes_are_right_handed_and_turn_the_right_way() -> None:
    forward, right, down = body_to_enu([0.3], [0.2], [1.0])[0].T
    assert np.cross(forward, right) == pytest.approx(down)
    assert forward[2] == pytest.approx(np.sin(0.2)), "nose up"
    assert right[2] < 0.0, "right wing down"
    assert np.arctan2(forward[0], forward[1]) == pytest.approx(1.0)


@pytest.mark.parametrize("height", [50.0, 150.0, 350.0])
def test_over_level_ground_a_radar_measures_the_height(height: float) -> None:
    rng = np.random.default_rng(1)
    places = np.tile([0.0, 0.0, height], (20, 1))
    values = Radar(steps=False).measure(
        plane(0.0), places, np.tile(attitude(8.0), (20, 1, 1)), np.tile(SPEED, (20, 1)), rng
    )
    assert values.mean() == pytest.approx(height, abs=0.5)
    assert values.std() < 0.6


def test_over_a_slope_inside_its_beam_a_radar_measures_the_shortest_way() -> None:
    rng = np.random.default_rng(1)
    places = np.tile([0.0, 0.0, 200.0], (20, 1))
    values = Radar(steps=False).measure(
        plane(10.0), places, np.tile(attitude(), (20, 1, 1)), np.tile(SPEED, (20, 1)), rng
    )
    assert values.mean() == pytest.approx(200.0 * np.cos(np.deg2rad(10.0)), abs=0.8)


@pytest.mark.parametrize("roll_deg", [-15.0, 0.0, 20.0])
def test_a_laser_over_a_slope_ends_on_it(roll_deg: float) -> None:
    """Heading north a bank to the right looks to the left, down the slope that rises to the east."""
    place = np.array([[3.0, 5.0, 120.0]])
    laser = Laser(divergence=1e-6, noise=0.0)
    values = laser.measure(plane(12.0), place, attitude(roll_deg), SPEED, np.random.default_rng(1))
    roll, rise = np.deg2rad(roll_deg), np.tan(np.deg2rad(12.0))
    clear = 120.0 - 3.0 * rise
    assert values[0] == pytest.approx(clear / (np.cos(roll) - rise * np.sin(roll)), abs=0.02)


def test_steps_are_those_of_the_instrument() -> None:
    assert step_m(np.array([30.0, 50.0, 100.0, 200.0, 400.0])) / FOOT_M == pytest.approx([1.0, 2.0, 5.0, 20.0, 50.0])


def test_a_survey_errs_by_what_it_states() -> None:
    """Over hills that 5 m posts resolve, the error is the survey's: 1.5 m with its bias."""
    errors = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        surface = make_surface("hills", rng, 1280.0, 30.0)
        model = survey(surface, 5.0, rng)
        east = model.east0 + np.arange(model.heights.shape[1]) * 5.0
        inside = np.abs(east) < 600.0
        truth = surface.height(*np.meshgrid(east[inside], east[inside]))
        errors.append(model.heights[np.ix_(inside, inside)] - truth)
        assert model.sd == pytest.approx(1.5, abs=0.1)
    assert np.std(errors) == pytest.approx(1.5, rel=0.15)


def test_grounds_are_as_rough_as_they_are_called() -> None:
    rng = np.random.default_rng(3)
    level, hills, woods = (make_surface(kind, rng) for kind in ("level", "hills", "woods"))
    assert level.relief < 0.2
    assert 4.0 < hills.relief < 82.0
    crowns = (woods.top - woods.bare)[woods.wooded > 0.5]
    assert 0.3 < woods.wooded.mean() < 0.7
    assert 6.99 <= crowns.min() <= crowns.max() <= 27.01


def test_processes_have_the_sigma_and_the_length_that_they_are_asked_for() -> None:
    rng = np.random.default_rng(4)
    values = wander(np.linspace(0.0, 19999.0, 20000), 2.0, 10.0, rng)
    assert values.std() == pytest.approx(2.0, rel=0.1)
    assert np.mean(values[10:] * values[:-10]) / values.var() == pytest.approx(np.exp(-1.0), abs=0.1)
    field = random_field(rng, 512, 40.0)
    shifted = np.roll(field, round(40.0 / POST_M), axis=1)
    assert np.mean(field * shifted) == pytest.approx(np.exp(-0.5), abs=0.1)
