"""The magnetic field: NOAA's test values of the World Magnetic Model 2025."""

from __future__ import annotations

import numpy as np
import pytest

from fti.geodesy.magnetic import magnetic_field_n

#: WMM2025 test values (NOAA NCEI): year, height [km], latitude, longitude [deg], north, east, down [nT].
PUBLISHED = [
    (2025.0, 0, 80, 0, 6521.6, 145.9, 54791.5),
    (2025.0, 0, 0, 120, 39677.8, -109.6, -10580.2),
    (2025.0, 0, -80, -120, 6117.5, 15751.9, -52022.5),
    (2025.0, 100, 80, 0, 6216.0, 92.4, 52598.8),
    (2025.0, 100, 0, 120, 37688.6, -96.2, -10152.1),
    (2025.0, 100, -80, -120, 5907.6, 14780.3, -49540.7),
    (2027.5, 0, 80, 0, 6500.8, 294.5, 54869.4),
    (2027.5, 0, 0, 120, 39701.6, -167.4, -10381.8),
    (2027.5, 0, -80, -120, 6200.7, 15730.3, -51783.7),
    (2027.5, 100, 80, 0, 6196.7, 233.8, 52670.5),
    (2027.5, 100, 0, 120, 37711.5, -148.7, -9969.8),
    (2027.5, 100, -80, -120, 5984.0, 14760.1, -49317.7),
]


@pytest.mark.parametrize(("year", "height_km", "lat_deg", "lon_deg", "north", "east", "down"), PUBLISHED)
def test_the_field_is_the_published_one(
    year: float, height_km: float, lat_deg: float, lon_deg: float, north: float, east: float, down: float
) -> None:
    values = magnetic_field_n(np.deg2rad(lat_deg), np.deg2rad(lon_deg), 1e3 * height_km, year)
    np.testing.assert_allclose(1e9 * values, [[north, east, down]], atol=0.06)


def test_many_points_at_once_are_the_same_as_one_by_one() -> None:
    lat, lon = np.deg2rad([48.0, -33.0]), np.deg2rad([11.0, 151.0])
    both = magnetic_field_n(lat, lon, 500.0, 2026.0)
    assert both.shape == (2, 3)
    np.testing.assert_allclose(both[1], magnetic_field_n(lat[1], lon[1], 500.0, 2026.0)[0], rtol=1e-14)


@pytest.mark.parametrize("year", [2024.9, 2030.1])
def test_outside_its_years_the_model_is_refused(year: float) -> None:
    with pytest.raises(ValueError, match="must be 2025 to 2030"):
        magnetic_field_n(0.8, 0.2, 0.0, year)
