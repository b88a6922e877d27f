"""The geodesic dome: its counts, its evenness, and that its solid angles are a rule of integration."""

from __future__ import annotations

import numpy as np
import pytest

from fti.ranging.radar.dome import half_dome, icosahedron, random_turn, sphere, triangle_solid_angles


@pytest.mark.parametrize("order", [1, 2, 3, 7, 12, 20])
def test_counts_of_triangles_and_points(order: int) -> None:
    """Eq. 2.65 and 2.66."""
    whole = sphere(order)
    assert len(whole.triangles) == 20 * order**2
    assert len(whole.rays) == 10 * order**2 + 2 == 2 + len(whole.triangles) // 2
    assert len(np.unique(np.round(whole.rays, 9), axis=0)) == len(whole.rays)


@pytest.mark.parametrize(("order", "rays"), [(12, 751), (20, 2051), (40, 8101)])
def test_half_dome_with_its_equator(order: int, rays: int) -> None:
    dome = half_dome(order)
    assert len(dome) == rays
    assert np.count_nonzero(np.abs(dome.rays_s[:, 2]) < 1e-12) == 5 * order
    assert abs(dome.solid_angles.sum() - 2.0 * np.pi) < 1e-12
    np.testing.assert_array_equal(dome.rays_s[0], [0.0, 0.0, 1.0])
    assert (np.diff(dome.rays_s[:, 2]) <= 0.0).all()


def test_icosahedron_has_equal_edges_72_and_36_degrees_apart() -> None:
    corners, faces = icosahedron()
    edges = np.linalg.norm(corners[faces] - corners[np.roll(faces, 1, axis=1)], axis=-1)
    np.testing.assert_allclose(edges, edges[0, 0], rtol=1e-14)
    around = np.degrees(np.arctan2(corners[1:11, 1], corners[1:11, 0])) % 360.0
    np.testing.assert_allclose(around[:5], 72.0 * np.arange(5), atol=1e-9)
    np.testing.assert_allclose(around[5:], 72.0 * np.arange(5) + 36.0, atol=1e-9)


@pytest.mark.parametrize("order", [1, 2, 5, 12])
def test_triangles_cover_the_sphere_once(order: int) -> None:
    whole = sphere(order)
    areas = triangle_solid_angles(*(whole.rays[whole.triangles[:, k]] for k in range(3)))
    assert (areas > 0.0).all()
    assert abs(areas.sum() - 4.0 * np.pi) < 1e-12
    assert abs(whole.solid_angles.sum() - 4.0 * np.pi) < 1e-12
    np.testing.assert_allclose(np.linalg.norm(whole.rays, axis=-1), 1.0, rtol=0, atol=4e-16)


def test_solid_angle_of_an_octant() -> None:
    axes = np.eye(3)[:, None, :]
    np.testing.assert_allclose(triangle_solid_angles(axes[0], axes[1], axes[2]), np.pi / 2.0, rtol=1e-15)


def test_solid_angles_integrate_a_beam() -> None:
    """cos^10 over the half sphere is 2 pi / 11; the error falls with the square of the spacing.

    With equal weights, as in eq. 2.68, it stays: 3 % at 8101 rays, because the boresight lies where rays are dense.
    """
    errors, equal = [], []
    for order in (12, 20, 40):
        dome = half_dome(order)
        beam = dome.rays_s[:, 2] ** 10
        errors.append(abs(beam @ dome.solid_angles * 11.0 / (2.0 * np.pi) - 1.0))
        equal.append(abs(beam.mean() * 11.0 - 1.0))
    assert errors[0] < 0.02
    assert errors[2] < errors[0] * (12 / 40) ** 2 * 1.2
    assert equal[2] > 0.03 > equal[0]


@pytest.mark.parametrize("order", [3, 12])
def test_a_turned_dome_is_the_same_half_sphere_by_other_rays(order: int) -> None:
    turn = random_turn(np.random.default_rng(5))
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    dome = half_dome(order, turn)
    assert len(dome) == 5 * order**2 + 1
    assert (dome.rays_s[:, 2] > 0.0).all()
    assert abs(dome.solid_angles.sum() - 2.0 * np.pi) < 1e-12
    nearest = (dome.rays_s @ half_dome(order).rays_s.T).max(axis=1)
    assert np.degrees(np.arccos(nearest.min())) > 1.0


def test_a_turn_takes_each_ray_along() -> None:
    """What lay on the boresight lies where the turn takes it: 20 deg about +x, from +z towards -y."""
    tilt = np.radians(20.0)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(tilt), -np.sin(tilt)], [0.0, np.sin(tilt), np.cos(tilt)]])
    corner = np.array([0.0, -np.sin(tilt), np.cos(tilt)])
    at = np.argmax(half_dome(3, turn).rays_s @ corner)
    np.testing.assert_allclose(half_dome(3, turn).rays_s[at], corner, atol=1e-15)


def test_random_turns_favour_no_direction() -> None:
    """Mean of where the boresight goes: the standard deviation of each part is sqrt(1 / 3 N); 4.5 of it."""
    rng = np.random.default_rng(6)
    towards = np.array([random_turn(rng)[:, 2] for _ in range(2000)])
    assert np.abs(towards.mean(axis=0)).max() < 4.5 * np.sqrt(1.0 / 3.0 / 2000)


def test_rays_within_an_angle() -> None:
    dome = half_dome(20)
    cone = dome.within(np.radians(30.0))
    off = np.degrees(np.arccos(dome.rays_s[:, 2]))
    assert len(cone) == np.count_nonzero(off <= 30.0)
    np.testing.assert_allclose(cone.solid_angles.sum(), 2.0 * np.pi * (1.0 - np.cos(np.radians(30.0))), rtol=0.05)


def test_order_and_shared_arrays_are_guarded() -> None:
    for order in (0, 2.5):
        with pytest.raises(ValueError, match="order"):
            sphere(order)
    for turn in (2.0 * np.eye(3), np.eye(2), np.full((3, 3), np.nan), np.diag([1.0, 1.0, -1.0])):
        with pytest.raises(ValueError, match="rotation matrix"):
            half_dome(3, turn)
    with pytest.raises(ValueError, match="read-only"):
        half_dome(12).rays_s[0, 0] = 1.0
