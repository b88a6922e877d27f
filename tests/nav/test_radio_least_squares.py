"""Weighted least squares of ranges: closed forms, equivalences, and the printed forms that are wrong."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef
from fti.nav.least_squares import AltitudeObservation, PositionObservation, RangeObservation, covariance, solve
from fti.nav.radio.altitude_accuracy import (
    HG9550,
    UNIFORM,
    AltitudeSource,
    altimeter_sd,
    choose_altitude,
    fix_covariance,
)

LAT, LON, ALT = 0.84, 0.2, 2500.0
HERE_E = ecef_from_geodetic(LAT, LON, ALT)
AZIMUTH = np.radians([10.0, 80.0, 150.0, 220.0, 300.0])
ELEVATION = np.radians([70.0, 20.0, 40.0, 15.0, 35.0])
SATELLITE_SD, DME_SD = 3.0, 222.0


def towards(azimuth: np.ndarray, elevation: np.ndarray, distance: float) -> np.ndarray:
    """Points in those directions, e frame."""
    level = np.cos(elevation)
    line_n = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), -np.sin(elevation)], axis=-1)
    return np.asarray(HERE_E + distance * line_n @ mat_en(LAT, LON).T)


SATELLITES_E = towards(AZIMUTH, ELEVATION, 2.2e7)
STATIONS_E = ecef_from_geodetic(
    LAT + np.array([0.003, -0.006, 0.005, -0.002]),
    LON + np.array([0.004, 0.006, -0.01, -0.009]),
    np.array([50.0, 300.0, 700.0, 20.0]),
)


def slants(n: int = 5, m: int = 4, clock: float = 0.0, errors: np.ndarray | None = None) -> list[RangeObservation]:
    """Ranges to the first n satellites and m stations."""
    errors = np.zeros(n + m) if errors is None else errors
    far, near = (np.linalg.norm(p - HERE_E, axis=1) for p in (SATELLITES_E[:n], STATIONS_E[:m]))
    found = []
    if n:
        found.append(
            RangeObservation(SATELLITES_E[:n], far + clock + errors[..., :n], np.full(n, SATELLITE_SD), clock=True)
        )
    if m:
        found.append(RangeObservation(STATIONS_E[:m], near + errors[..., n:], np.full(m, DME_SD), clock=False))
    return found


@pytest.mark.parametrize(("n", "m"), [(5, 4), (5, 0), (4, 0), (3, 2), (2, 3), (0, 3), (1, 4)])
def test_exact_ranges_lead_to_the_place(n: int, m: int) -> None:
    solution = solve(slants(n, m, 1234.5), HERE_E + np.array([3000.0, -2000.0, 1000.0]))
    assert solution is not None
    assert np.linalg.norm(solution.x[:3] - HERE_E) < 2e-3
    assert solution.x[3] == pytest.approx(1234.5 if n else 0.0, abs=2e-3)
    assert solution.cov[3, 3] > 0.0 if n else solution.cov[3, 3] == 0.0


@pytest.mark.parametrize(("n", "m"), [(3, 0), (0, 2), (0, 1), (1, 2), (0, 0)])
def test_too_few_ranges_are_no_position(n: int, m: int) -> None:
    assert solve(slants(n, m), HERE_E) is None
    assert covariance(slants(n, m), HERE_E) is None


def test_a_height_takes_the_place_of_a_range() -> None:
    start = HERE_E + np.array([100.0, 100.0, 100.0])
    solution = solve([*slants(0, 2), AltitudeObservation(ALT, 5.0)], start)
    assert solution is not None
    assert np.linalg.norm(solution.x[:3] - HERE_E) < 1e-3
    lat, lon, alt = solution.geodetic()
    assert (float(lat), float(lon), float(alt)) == pytest.approx((LAT, LON, ALT), abs=1e-3)
    assert math.sqrt(solution.cov_n()[2, 2]) == pytest.approx(5.0, rel=1e-6)


def test_many_runs_are_solved_as_each_alone() -> None:
    errors = np.random.default_rng(1).normal(size=(20, 9)) * np.array([SATELLITE_SD] * 5 + [DME_SD] * 4)
    alts = ALT + np.linspace(-20.0, 20.0, 20)
    together = solve(
        [*slants(errors=errors), AltitudeObservation(alts, np.full(20, 8.0))], np.broadcast_to(HERE_E, (20, 3))
    )
    assert together is not None
    for i in range(20):
        alone = solve([*slants(errors=errors[i]), AltitudeObservation(alts[i], 8.0)], HERE_E)
        assert alone is not None
        assert np.allclose(together.x[i], alone.x, rtol=0.0, atol=1e-3)
        assert np.allclose(together.cov_n()[i], alone.cov_n(), rtol=1e-6, atol=1e-6)


def test_the_covariance_is_that_of_the_errors() -> None:
    runs = 4000
    sd = np.array([SATELLITE_SD] * 3 + [DME_SD] * 4)
    errors = np.random.default_rng(2).normal(size=(runs, 7)) * sd
    solution = solve(slants(3, 4, errors=errors), np.broadcast_to(HERE_E, (runs, 3)))
    P = covariance(slants(3, 4), HERE_E)
    assert solution is not None and P is not None
    error = solution.x[:, :3] - HERE_E
    predicted = np.linalg.cholesky(P[:3, :3])
    white = np.linalg.solve(predicted, error.T)
    assert np.allclose(white @ white.T / runs, np.eye(3), atol=0.1)
    assert np.nanmean(solution.tests**2) == pytest.approx(1.0, abs=0.05)


def test_a_fix_weighs_as_much_as_its_satellites() -> None:
    """Normal equations add: the receiver's fix with its covariance is what its pseudoranges were."""
    errors = np.random.default_rng(3).normal(size=9) * np.array([SATELLITE_SD] * 5 + [DME_SD] * 4)
    whole = solve(slants(errors=errors), HERE_E)
    fix = solve(slants(5, 0, errors=errors[:5]), HERE_E)
    cov_n = fix_covariance(AZIMUTH, ELEVATION, SATELLITE_SD)
    assert whole is not None and fix is not None and cov_n is not None
    assert np.allclose(fix.cov_n(), cov_n, rtol=1e-3)
    turn = mat_en(LAT, LON)
    joined = solve([PositionObservation(fix.x[:3], turn @ cov_n @ turn.T), *slants(0, 4, errors=errors[5:])], HERE_E)
    assert joined is not None
    assert np.linalg.norm(joined.x[:3] - whole.x[:3]) < 0.05
    assert np.allclose(joined.cov_n(), whole.cov_n(), rtol=1e-3)


def test_the_printed_weights_are_not_those_of_the_errors() -> None:
    """Koo, 22 and 24: diag(I, (sigma_G / sigma_D)^2 I) gives sigma_G^2 D_w = P; both printed forms do not."""
    P = covariance(slants(3, 4), HERE_E)
    assert P is not None
    down = mat_en(LAT, LON)[:, 2]
    right = math.sqrt(down @ P[:3, :3] @ down)
    H = np.concatenate([o.equations(np.append(HERE_E, 0.0))[1] * o.sd[:, None] for o in slants(3, 4)])

    def sigma(weights: list[float]) -> float:
        D = np.linalg.inv(H.T @ np.diag(weights) @ H)
        return SATELLITE_SD * math.sqrt(down @ D[:3, :3] @ down)

    ratio = (SATELLITE_SD / DME_SD) ** 2
    assert sigma([1.0] * 3 + [ratio] * 4) == pytest.approx(right, rel=1e-9)
    assert sigma([SATELLITE_SD**-2] * 3 + [DME_SD**-2] * 4) == pytest.approx(SATELLITE_SD * right, rel=1e-9)
    assert sigma([SATELLITE_SD**2] * 3 + [ratio] * 4) < 0.9999 * right
    few = covariance(slants(5, 4), HERE_E)
    assert few is not None
    H = np.concatenate([o.equations(np.append(HERE_E, 0.0))[1] * o.sd[:, None] for o in slants(5, 4)])
    literal = sigma([SATELLITE_SD**2] * 5 + [ratio] * 4) / math.sqrt(down @ few[:3, :3] @ down)
    assert literal == pytest.approx(1.0 / SATELLITE_SD, rel=1e-3)  # where satellites alone give the height


def test_tests_name_the_range_that_is_wrong() -> None:
    errors = np.zeros(9)
    errors[7] = 20.0 * DME_SD
    solution = solve(slants(errors=errors), HERE_E)
    assert solution is not None
    assert int(np.argmax(np.abs(solution.tests))) == 7
    exact = solve(slants(4, 0), HERE_E)
    assert exact is not None
    assert np.isnan(exact.tests).all()  # nothing checks four ranges for four unknowns


def test_the_data_sheet_of_the_altimeter() -> None:
    feet = np.array([-5000.0, 50.0, 100.0, 101.0, 2500.0, 5000.0, 7000.0, 10_000.0, 20_000.0])
    limits_ft = np.array([2.0, 2.0, 2.0, 2.02, 50.0, 100.0, 100.0, 100.0, 200.0])
    assert altimeter_sd(0.3048 * feet) == pytest.approx(0.3048 * limits_ft / math.sqrt(3.0), rel=1e-9)
    errors = np.random.default_rng(4).uniform(-1.0, 1.0, 100_000)
    assert errors.std() == pytest.approx(UNIFORM, rel=0.01)
    assert HG9550[0].up_to == pytest.approx(30.48)


def test_the_more_accurate_height_is_chosen() -> None:
    assert choose_altitude(5.0, 6.0) == (AltitudeSource.RANGES, 5.0)
    assert choose_altitude(7.0, 6.0) == (AltitudeSource.ALTIMETER, 6.0)
    assert choose_altitude(None, 6.0) == (AltitudeSource.ALTIMETER, 6.0)
    assert choose_altitude(5.0, math.nan) == (AltitudeSource.RANGES, 5.0)
    assert choose_altitude(None, None) is None


def test_poles_and_the_date_line() -> None:
    for lat, lon in ((math.pi / 2, 0.0), (-math.pi / 2, 1.0), (0.3, math.pi), (0.3, -math.pi)):
        here = ecef_from_geodetic(lat, lon, ALT)
        lines_n = np.array([[3e4, 0.0, 0.0], [-2e4, 3e4, 500.0], [0.0, -4e4, 1000.0], [1e4, 1e4, -2e4]])
        points_e = here + lines_n @ mat_en(lat, lon).T
        measured = np.linalg.norm(points_e - here, axis=1)
        solution = solve([RangeObservation(points_e, measured, np.full(4, DME_SD), clock=False)], here + 500.0)
        assert solution is not None
        assert np.linalg.norm(solution.x[:3] - here) < 1e-3
        assert geodetic_from_ecef(solution.x[:3])[2] == pytest.approx(ALT, abs=1e-3)
