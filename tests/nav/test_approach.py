"""Geometry of the approach: closed forms and an outside authority (PROJ's geodesic)."""

import math
from typing import Any

import numpy as np
import pytest
from pyproj import Geod

from fti.errors import ConfigError
from fti.nav.integrity.approach import Airfield, ApproachPath, load_airfield

TEXT = """
name = "x"
threshold_lat_deg = 48.0
threshold_lon_deg = 11.0
threshold_alt_m = 200.0
course_deg = 250.0
glide_deg = 3.0
tch_m = 15.24
runway_length_m = 1500.0
survey_date = "2024-01-01"
"""


def with_changes(airfield: Airfield, **changes: Any) -> ApproachPath:
    return ApproachPath(airfield.model_copy(update=changes))


def test_intercept_point_of_3_degrees_and_50_feet_is_291_m_beyond(path: ApproachPath) -> None:
    assert path.x_gpi == pytest.approx(290.8, abs=0.05)
    assert path.alt_gpi == 200.0


def test_uphill_runway_brings_the_intercept_point_nearer_and_higher(airfield: Airfield) -> None:
    uphill = with_changes(airfield, runway_slope=0.01)
    assert uphill.x_gpi == pytest.approx(15.24 / (math.tan(math.radians(3)) + 0.01))
    assert uphill.alt_gpi == pytest.approx(200.0 + 0.01 * uphill.x_gpi)


@pytest.mark.parametrize(("s", "drop"), [(3000.0, 0.7), (5000.0, 2.0), (10000.0, 7.9)])
def test_the_earth_falls_away_under_a_straight_path(path: ApproachPath, s: float, drop: float) -> None:
    straight = path.alt_gpi + s * math.tan(math.radians(3))
    assert float(path.alt_path(s)) - straight == pytest.approx(drop, abs=0.06)


def test_path_crosses_the_threshold_at_the_crossing_height(path: ApproachPath) -> None:
    assert float(path.alt_path(path.x_gpi)) == pytest.approx(215.24, abs=0.01)


def test_along_is_the_geodesic_to_the_intercept_point(path: ApproachPath) -> None:
    geod = Geod(ellps="WGS84")
    lon_g, lat_g, _ = geod.fwd(11.0, 48.0, 250.0, path.x_gpi)
    for s in (0.0, 500.0, 3000.0, 9000.0):
        lon, lat, _ = geod.fwd(lon_g, lat_g, 70.0, s)
        found, y = path.to_path(math.radians(lat), math.radians(lon))
        assert float(found) == pytest.approx(s, abs=0.03 + s * 4e-5)  # at 200 m the plane is 3e-5 longer
        assert abs(float(y)) < 0.03 + s * 1e-5


def test_one_place_is_along_as_many_are(path: ApproachPath) -> None:
    for lat, lon in ((0.83, 0.19), (0.84, 0.2), (-0.3, 3.1)):
        assert path.to_path_one(lat, lon) == tuple(map(float, path.to_path(lat, lon)))


def test_right_of_track_is_positive(path: ApproachPath) -> None:
    lon, lat, _ = Geod(ellps="WGS84").fwd(11.0, 48.0, 250.0 + 90.0, 100.0)
    assert float(path.to_path(math.radians(lat), math.radians(lon))[1]) == pytest.approx(100.0, abs=0.02)


def test_geodetic_is_the_inverse_of_along(path: ApproachPath) -> None:
    s, y = np.meshgrid([-200.0, 0.0, 4000.0, 10000.0], [-300.0, 0.0, 150.0])
    found_s, found_y = path.to_path(*path.to_geodetic(s, y))
    np.testing.assert_allclose(found_s, s, atol=2e-3)
    np.testing.assert_allclose(found_y, y, atol=1e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("course_deg = 250.0", "course_deg = 400.0"), "course_deg = 400.0"),
        (("name =", "nmae ="), "nmae"),
        (("tch_m = 15.24", "tch_m = "), "not valid TOML"),
        (('"2024-01-01"', '"soon"'), "survey_date"),
    ],
)
def test_mistakes_in_the_airfield_file_are_named(change: tuple[str, str], message: str) -> None:
    with pytest.raises(ConfigError, match=message) as caught:
        load_airfield(TEXT.replace(*change), "field.toml")
    assert str(caught.value).startswith("field.toml: ")


def test_airfield_file_loads() -> None:
    assert load_airfield(TEXT, "field.toml").course_deg == 250.0
