"""z and H of each aiding by small changes of the truth; Joseph's form against the printed one."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.rotations import mat_from_rpy
from fti.geodesy.wgs84 import geodetic_from_ecef
from fti.nav.filter import kernels
from fti.nav.filter.aiding import (
    Aiding,
    BaroAltitude,
    GnssHeight,
    GnssPosition,
    GnssVelocity,
    SlantRange,
    TerrainAltitude,
)
from fti.nav.filter.dead_reckoning import TrueAirspeed
from fti.nav.filter.error_states import Drift, Extra, FilterModel
from fti.nav.filter.estimate import Estimate, InitialState
from fti.nav.filter.measurement_update import apply_update

Array = NDArray[np.float64]

MODEL = FilterModel(extras={extra: Drift(1.0, period_s=100.0) for extra in Extra})
IMU = np.array([0.3, 0.1, -9.8, 0.05, -0.1, 0.2])
ARM = (1.0, -2.0, -3.0)
U, N = (0.3, 0.2, 0.9327379053), (0.1, -0.2, 0.9746794345)


def made() -> Estimate:
    start = InitialState(
        0.8, 0.2, 700.0, (50.0, 20.0, -2.0), 0.3, 0.1, 2.0, (3.0, 3.0, 5.0), (0.3,) * 3, (0.01, 0.01, 0.03)
    )
    return start.estimate(0, IMU, MODEL)


def other(here: Estimate, x: Array) -> Estimate:
    """The estimate if it were wrong by x: truth is where the estimate plus x is."""
    y = here.y.copy()
    kernels.correct(y, x, len(MODEL.extras))
    return dataclasses.replace(here, y=y)


AIDS: list[Aiding] = [
    GnssPosition(0.8, 0.2, 701.0, 2.0, 3.0, ARM),
    GnssPosition(0.8, 0.2, None, 2.0, 3.0, ARM),
    GnssPosition(0.8, 0.2, 701.0, 2.0, 3.0, ARM, drift_factors=(2.0, 3.0)),
    GnssHeight(GnssPosition(0.8, 0.2, 701.0, 2.0, 3.0, ARM)),
    GnssVelocity(50.1, 20.0, -2.2, 0.1, ARM),
    GnssVelocity(50.1, 20.0, None, 0.1, ARM),
    BaroAltitude(690.0, 1.0),
    TerrainAltitude(702.0, 1.0, 150.0, dem_factor=3.0),
    SlantRange(163.0, 0.5, 160.0, 0.8, 0.2, 700.0, U, N),
    TrueAirspeed(58.0, 1.0, 2.0),
]


@pytest.mark.parametrize("aiding", AIDS, ids=lambda aiding: type(aiding).__name__)
def test_h_is_what_an_error_does_to_the_innovation(aiding: Aiding) -> None:
    """z(estimate + x) = z(estimate) - H x for a small x of each state; a slant range's turn has a test of its own."""
    here = made()
    z, H, R = aiding.compute_matrices(here)
    assert np.linalg.eigvalsh(R).min() > 0.0
    sizes = np.concatenate((np.full(3, 0.1), np.full(3, 1e-2), np.full(3, 1e-5), np.full(6, 1e-5)))
    sizes = np.concatenate((sizes, np.full(len(MODEL.extras), 1e-2)))
    for k, size in enumerate(sizes):
        if isinstance(aiding, SlantRange) and 6 <= k < 9:
            continue
        x = np.zeros(MODEL.size)
        x[k] = size
        moved, _, _ = aiding.compute_matrices(other(here, x))
        np.testing.assert_allclose(z - moved, H @ x, atol=2e-3 * size + 1e-9)


def test_a_slant_range_is_that_to_a_plane() -> None:
    """Ray and plane by themselves: d = n.(x0 - P) / (n.u), with P and u moved."""
    here = made()
    aiding = SlantRange(163.0, 0.5, 160.0, 0.8, 0.2, 700.0, U, N)
    _, H, _ = aiding.compute_matrices(here)
    u, n = np.array(U), np.array(N)
    x0 = 160.0 * u

    def slant(moved_n: Array, turn_n: Array) -> float:
        ray = u + np.cross(turn_n, u)
        return float(n @ (x0 - moved_n) / (n @ ray))

    for axis in np.eye(3):
        by_pos = slant(0.1 * axis, np.zeros(3)) - 160.0
        assert H[0, :3] @ here.mat_en @ (0.1 * axis) == pytest.approx(by_pos, abs=1e-6)
        by_turn = slant(np.zeros(3), 1e-5 * axis) - 160.0
        assert H[0, 6:9] @ here.mat_en @ (1e-5 * axis) == pytest.approx(by_turn, abs=1e-6)


def test_level_ground_under_45_deg_of_bank_is_1_414_metres_of_range_a_metre() -> None:
    """Equation 3.44 as printed, which projects, has 0.71 (errata)."""
    here = made()
    ray = tuple((mat_from_rpy(np.pi / 4, 0.0, 2.0)[:, 2]).tolist())
    _, H, _ = SlantRange(300.0, 0.5, 300.0, 0.8, 0.2, 700.0, ray, (0.0, 0.0, 1.0)).compute_matrices(here)
    up_e = -here.mat_en[:, 2]
    assert H[0, :3] @ up_e == pytest.approx(np.sqrt(2.0), rel=1e-6)
    printed = -here.mat_en[:, 2] @ here.mat_en @ mat_from_rpy(np.pi / 4, 0.0, 2.0)[:, 2]
    assert abs(printed) < 0.72


def test_an_update_is_the_textbooks() -> None:
    """Sequential scalars, correlated noise whitened: the same as all at once with matrices."""
    here = made()
    z, H, _ = GnssPosition(0.8 + 1e-7, 0.2, 702.0, 2.0, 3.0).compute_matrices(here)
    R = np.array([[4.0, 1.0, 0.5], [1.0, 9.0, -2.0], [0.5, -2.0, 3.0]])
    after, nis = apply_update(here, here.P.copy(), z, H, R)
    assert nis == pytest.approx(z @ np.linalg.solve(H @ here.P @ H.T + R, z), rel=1e-9)
    K = here.P @ H.T @ np.linalg.inv(H @ here.P @ H.T + R)
    left = np.eye(MODEL.size) - K @ H
    np.testing.assert_allclose(after.P, left @ here.P @ left.T + K @ R @ K.T, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(after.y[:3] - here.y[:3], (K @ z)[:3], atol=1e-6)


def test_joseph_stays_positive_where_the_printed_form_does_not() -> None:
    """Equation 3.38 as printed, P - K H P, with a sharp measurement of what was hardly known (errata)."""
    rng = np.random.default_rng(3)
    P = np.diag([1e12, 1.0, 1e-6, 1.0])
    mixed = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    P = mixed @ P @ mixed.T
    printed, joseph = P.copy(), 0.5 * (P + P.T)
    for _ in range(12):
        h = rng.standard_normal(4)
        g = printed @ h
        printed = printed - np.outer(g / (h @ g + 1e-12), h @ printed)
        kernels.update(np.zeros(4), joseph, 0.0, h, 1e-12)
    assert np.abs(printed - printed.T).max() > 0.0
    np.testing.assert_array_equal(joseph, joseph.T)
    assert np.linalg.eigvalsh(printed).min() < np.linalg.eigvalsh(joseph).min()


def test_the_estimate_has_angles_and_their_sigma() -> None:
    """Sigma of roll, pitch, heading by drawing turns."""
    here = made()
    rng = np.random.default_rng(1)
    drawn = rng.multivariate_normal(np.zeros(3), here.P[6:9, 6:9], 1500)
    found = []
    for turn in drawn:
        x = np.zeros(MODEL.size)
        x[6:9] = turn
        found.append(other(here, x).rpy)
    np.testing.assert_allclose(np.std(found, axis=0), here.rpy_sd, rtol=0.05)
    lat, lon, alt = geodetic_from_ecef(here.y[:3])
    assert (float(lat), float(lon), float(alt)) == here.geodetic
