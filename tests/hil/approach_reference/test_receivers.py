"""Receivers against geometry: level ground, and a wall beside the track."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from fti.hil.approach_reference.receivers import ReceiverVariant, draw_receivers, measure, stated_receiver
from fti.nav.integrity.reference import ReferenceSensor
from fti.terrain.terrain import Terrain
from tests.planes import looking_down

RADAR, LASER = ReferenceSensor(kind="radar", beam_deg=40.0), ReferenceSensor(kind="laser", beam_deg=0.1)
LEVEL = np.zeros((1, 2))
HEIGHT_M = 300.0


def ground_of(heights: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Terrain:
    """Posts 5 m apart, 1500 m to each side."""
    axis = np.arange(-1500.0, 1500.1, 5.0)
    return Terrain.from_array(
        heights(*np.meshgrid(axis, axis)), 5.0, lat0=0.64, lon0=-1.47, east0=-1500.0, north0=-1500.0
    )


@pytest.fixture(scope="module")
def level() -> Terrain:
    return ground_of(lambda east, north: 0.0 * east)


@pytest.fixture(scope="module")
def wall() -> Terrain:
    """100 m high from 113 m to the east on: from 3 m east its edge is 28.8 deg off the vertical, 228 m away."""
    return ground_of(lambda east, north: np.where(east >= 112.5, 100.0, 0.0))


def test_level_ground_is_as_far_as_it_is_for_every_receiver(level: Terrain) -> None:
    """Within 0.5 m: rays lie 2 degrees apart; biases have their sigma."""
    drawn = draw_receivers(RADAR, 40, 0.0, "drawn", np.random.default_rng(1))
    np.testing.assert_allclose(measure(drawn, level, looking_down(HEIGHT_M), LEVEL), HEIGHT_M, atol=0.5)
    biased = draw_receivers(RADAR, 400, 0.3, "drawn", np.random.default_rng(2))
    assert np.std([receiver.bias for receiver in biased]) == pytest.approx(0.3, rel=0.1)


def test_a_wall_is_seen_by_whom_its_gain_reaches(wall: Terrain) -> None:
    """Two-way Gaussian gain at 28.8 deg of a beam of 40 deg: -12.5 dB.  A cone of 18 deg meets level ground alone."""
    off = math.degrees(math.atan2(110.0, 200.0))
    assert 10.0 * math.log10(0.5) * 2.0 * (off / 20.0) ** 2 == pytest.approx(-12.5, abs=0.1)
    narrow_cone, wide_cone = (ReceiverVariant("nearest", math.radians(width), 0.0) for width in (36.0, 64.0))
    deaf, keen = (ReceiverVariant("gaussian", math.radians(40.0), 10.0 ** (db / 10.0)) for db in (-3.0, -25.0))
    found = measure((narrow_cone, wide_cone, deaf, keen), wall, looking_down(HEIGHT_M), LEVEL)[0, 0]
    edge = math.hypot(110.0, 200.0)
    np.testing.assert_allclose(found, [HEIGHT_M, edge, HEIGHT_M, edge], atol=6.0)


def test_the_tilt_turns_the_boresight_as_the_attitude_does(wall: Terrain) -> None:
    """Right wing down looks to the left: 10 deg more and 10 deg less from the wall; as poses with that roll see it."""
    cone, roll = (ReceiverVariant("nearest", math.radians(50.0), 0.0),), math.radians(10.0)
    tilts = np.array([[-roll, 0.0], [roll, 0.0]])
    tilted = measure(cone, wall, looking_down(HEIGHT_M), tilts)[0, :, 0]
    rolled = [measure(cone, wall, looking_down(HEIGHT_M, float(tilt)), LEVEL)[0, 0, 0] for tilt, _ in tilts]
    np.testing.assert_allclose(tilted, rolled, atol=2.0)
    assert min(tilted) < 240.0 < max(tilted)


def test_drawn_receivers_differ_as_they_say() -> None:
    drawn = draw_receivers(RADAR, 500, 0.3, "drawn", np.random.default_rng(3))
    edges = [receiver for receiver in drawn if receiver.pattern != "nearest"]
    assert 0.1 < 1.0 - len(edges) / len(drawn) < 0.3
    levels = 10.0 * np.log10([receiver.threshold for receiver in edges])
    assert -13.0 <= levels.min() < -12.5
    assert -3.5 < levels.max() <= -3.0
    beams = np.degrees([receiver.beam for receiver in drawn])
    assert np.std(beams) == pytest.approx(4.0, rel=0.15)
    assert not [r for r in draw_receivers(RADAR, 50, 0.3, "edge", np.random.default_rng(4)) if r.pattern == "nearest"]
    assert {r.pattern for r in draw_receivers(RADAR, 9, 0.3, "nearest", np.random.default_rng(5))} == {"nearest"}


def test_lasers_differ_by_pointing_and_echo(level: Terrain) -> None:
    """Over level ground a beam that points off by a is h / cos(a) long."""
    drawn = draw_receivers(LASER, 20, 0.0, "drawn", np.random.default_rng(6))
    assert {receiver.last for receiver in drawn} == {False, True}
    found = measure(drawn, level, looking_down(HEIGHT_M), LEVEL)[0, 0]
    off = [math.hypot(receiver.roll, receiver.pitch) for receiver in drawn]
    np.testing.assert_allclose(found, HEIGHT_M / np.cos(off), atol=0.02)
    assert stated_receiver(LASER).beam == 0.0
