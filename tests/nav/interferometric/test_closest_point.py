"""The measured point of an interferometric altimeter, against points that are constructed with vectors."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike

from fti.arrays import Array, Mask
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.interferometric.closest_point import (
    PointMethod,
    PointRefusal,
    closest_points,
    effective_look_angle,
)
from fti.ranging.interferometric import direction_from_angles
from fti.ranging.sensor import Poses

SPEED = 83.0
SIMPLE, CONVENTIONAL, PROPOSED = PointMethod.SIMPLE, PointMethod.CONVENTIONAL, PointMethod.PROPOSED


def poses(
    roll: ArrayLike = 0.0, pitch: ArrayLike = 0.0, crab: ArrayLike = 0.0, climb: ArrayLike = 0.0, track: ArrayLike = 0.0
) -> Poses:
    """All angles in degrees; crab is heading minus track."""
    given = (np.atleast_1d(np.radians(np.asarray(angle, float))) for angle in (roll, pitch, crab, climb, track))
    roll, pitch, crab, climb, track = np.broadcast_arrays(*given)
    mats = MAT_ENU_NED @ mat_from_rpy(roll, pitch, track + crab)
    level = np.stack((np.sin(track), np.cos(track), np.zeros_like(track)), axis=-1)
    vels = SPEED * (np.cos(climb)[:, None] * level + np.sin(climb)[:, None] * [0.0, 0.0, 1.0])
    return Poses(np.zeros((len(mats), 3)), mats, vels)


def attitudes(n: int, rng: np.random.Generator) -> Poses:
    """Of the stated envelope: roll 60, pitch 15, crab 20, climb 10 deg."""
    roll, pitch, crab, climb = np.array([60.0, 15.0, 20.0, 10.0])[:, None] * rng.uniform(-1.0, 1.0, (4, n))
    return poses(roll, pitch, crab, climb, rng.uniform(0.0, 360.0, n))


def points_in_plane(at: Poses, rng: np.random.Generator) -> tuple[Array, Array]:
    """Points at random angles in the plane perpendicular to the velocity (n, 3), and the angle that antennas measure.

    The sine of the look angle is the projection of the line of sight on the line of the antennas.
    """
    one = np.cross(at.vels_l, rng.standard_normal((len(at), 3)))
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    other = np.cross(one, at.vels_l) / SPEED
    turn = rng.uniform(0.0, 2.0 * np.pi, (len(at), 1))
    points = rng.uniform(100.0, 6000.0, (len(at), 1)) * (np.cos(turn) * one + np.sin(turn) * other)
    antennas = at.mats_ls @ np.array([0.0, 1.0, 0.0])
    return points, np.arcsin((points * antennas).sum(axis=1) / np.linalg.norm(points, axis=1))


def off_belly(at: Poses, points: Array) -> Array:
    """Angle of points off the body's downward axis [deg]."""
    cosine = (points * (at.mats_ls @ np.array([0.0, 0.0, 1.0]))).sum(axis=1) / np.linalg.norm(points, axis=1)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def in_domain(at: Poses, points: Array) -> Mask:
    return np.asarray((off_belly(at, points) < 75.0) & (points[:, 2] < 0.0))


# ------------------------------------------------------------------------------------------------------------ geometry


def test_points_of_the_plane_come_back_or_are_refused_with_the_reason() -> None:
    """10^5 attitudes and more: inside of the domain to 1e-9 m; outside, up to 90 deg, every point is refused."""
    rng = np.random.default_rng(11)
    at = attitudes(400_000, rng)
    points, look = points_in_plane(at, rng)
    inside = in_domain(at, points)
    assert inside.sum() > 100_000
    found = closest_points(np.linalg.norm(points, axis=1), look, at)
    assert found.is_known[inside].all()
    assert np.abs(found.relative - points)[inside].max() < 1e-9
    beside = ~inside & (off_belly(at, points) < 90.0)
    assert beside.sum() > 50_000
    assert not found.is_known[beside].any()
    assert np.isnan(found.relative[beside]).all()
    reasons = {PointRefusal(code) for code in found.refusal[beside]}
    assert reasons == {PointRefusal.OFF_BELLY, PointRefusal.ABOVE, PointRefusal.ALONG_BASELINE}


def test_the_form_without_intermediate_angles_agrees() -> None:
    rng = np.random.default_rng(12)
    at, look = attitudes(10_000, rng), np.radians(rng.uniform(-60.0, 60.0, 10_000))
    found = closest_points(1000.0, look, at)
    vel_s = np.einsum("nji,nj->ni", at.mats_ls, at.vels_l)
    same = 1000.0 * np.einsum("nij,nj->ni", at.mats_ls, direction_from_angles(np.zeros(len(at)), look, vel_s))
    assert found.is_known.mean() > 0.8
    assert np.abs(found.relative - same)[found.is_known].max() < 1e-9


def test_the_antenna_on_the_side_of_the_point_is_nearer() -> None:
    """Two antennas 0.5 m apart: the difference of their distances is the baseline times the sine of the look angle."""
    at, look = poses(5.0, 3.0, 10.0, track=40.0), np.radians([12.0])
    point = closest_points(5000.0, look, at).relative[0]
    right = 0.25 * at.mats_ls[0] @ np.array([0.0, 1.0, 0.0])
    difference = np.linalg.norm(point + right) - np.linalg.norm(point - right)
    assert difference == pytest.approx(0.5 * np.sin(look[0]), rel=1e-6)


# ---------------------------------------------------------------------------------------------------------- three forms


def test_without_wind_the_three_forms_agree_and_roll_is_subtracted() -> None:
    """Level flight to the north: the point is theta - roll to the right of straight below."""
    at, look = poses([0.0, 10.0, -20.0]), np.radians([15.0, 15.0, -5.0])
    expected = np.radians([15.0, 5.0, 15.0])
    points = np.stack((np.sin(expected), np.zeros(3), -np.cos(expected)), axis=-1)
    for method in PointMethod:
        assert closest_points(1.0, look, at, method).relative == pytest.approx(points, abs=1e-12)


def test_in_a_climb_without_crab_only_the_simple_form_needs_the_pitch_to_be_the_climb() -> None:
    at = poses(0.0, pitch=3.0, climb=5.0)
    forms = {method: closest_points(1000.0, 0.2, at, method).relative[0] for method in PointMethod}
    assert forms[CONVENTIONAL] == pytest.approx(forms[PROPOSED], abs=1e-9)
    apart = np.linalg.norm(forms[SIMPLE] - forms[PROPOSED])
    assert apart == pytest.approx(1000.0 * np.cos(0.2) * 2.0 * np.sin(np.radians(1.0)), rel=1e-9)


def test_shift_of_the_conventional_form_in_a_side_wind() -> None:
    """h (tan xi - tan theta): 24.8 m at 5.6 km, 15 deg, crab of 10 deg; along the track nothing."""
    at, look = poses(crab=[10.0, -10.0]), np.radians(15.0)
    angle, _ = effective_look_angle(np.full(2, look), at)
    assert np.sin(angle) == pytest.approx(np.sin(look) / np.cos(np.radians(10.0)), abs=1e-12)
    proposed = closest_points(5600.0 / np.cos(angle), look, at).relative
    conventional = closest_points(5600.0 / np.cos(look), look, at, CONVENTIONAL).relative
    shift = 5600.0 * (np.tan(angle[0]) - np.tan(look))
    assert shift == pytest.approx(24.8, abs=0.06)
    assert (proposed - conventional)[:, 0] == pytest.approx([shift, shift], abs=1e-9)
    assert (proposed - conventional)[:, 1:] == pytest.approx(np.zeros((2, 2)), abs=1e-9)


# ------------------------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(("slant_range", "look"), [(np.nan, 0.1), (1000.0, np.nan), (0.0, 0.1), (-5.0, 0.1)])
def test_without_a_measurement_there_is_no_point(slant_range: float, look: float) -> None:
    for method in PointMethod:
        found = closest_points(slant_range, look, poses(), method)
        assert found.refusal == [PointRefusal.NO_SAMPLE]
        assert np.isnan(found.relative).all()


def test_without_horizontal_velocity_there_is_no_plane() -> None:
    at = poses([0.0, 0.0])
    at.vels_l[:] = [[0.0, 0.0, 0.0], [0.0, 0.0, -5.0]]
    for method in (CONVENTIONAL, PROPOSED):
        assert closest_points(1000.0, 0.1, at, method).refusal.tolist() == 2 * [PointRefusal.NO_PLANE]
    assert closest_points(1000.0, 0.1, at, SIMPLE).is_known.all()  # it needs no plane


def test_each_side_of_the_domain_has_its_reason() -> None:
    at = poses(roll=[0.0, 0.0, -60.0, 0.0], crab=[20.0, 20.0, 0.0, 0.0])
    look = np.radians([80.0, 70.1, 50.0, 76.0])  # sin 70.1 / cos 20 = 1.0006; -60 deg: the right wing is up
    reasons = [PointRefusal.ALONG_BASELINE, PointRefusal.ALONG_BASELINE, PointRefusal.ABOVE, PointRefusal.OFF_BELLY]
    assert closest_points(1000.0, look, at).refusal.tolist() == reasons
