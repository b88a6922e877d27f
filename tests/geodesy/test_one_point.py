"""One point in plain numbers: what the arrays say, to the last bit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.geodesy import one_point, wgs84
from fti.geodesy.local import LocalFrame

_RNG = np.random.default_rng(5)
POINTS = [
    *zip(_RNG.uniform(-1.57, 1.57, 300), _RNG.uniform(-3.14, 3.14, 300), _RNG.uniform(-1e3, 2e4, 300), strict=True),
    (math.pi / 2, 0.0, 0.0),
    (-math.pi / 2, math.pi, 1e5),
    (0.0, -math.pi, -100.0),
]


def test_a_point_alone_is_where_the_arrays_have_it() -> None:
    frame = LocalFrame(0.8, 0.2, 300.0)
    for point in POINTS:
        lat, lon, alt = map(float, point)
        assert one_point.radii(lat) == tuple(map(float, wgs84.radii(lat)))
        assert one_point.ecef_from_geodetic(lat, lon, alt) == tuple(wgs84.ecef_from_geodetic(lat, lon, alt).tolist())
        assert one_point.to_local(frame, lat, lon, alt) == tuple(frame.to_local(lat, lon, alt).tolist())


@pytest.mark.filterwarnings("ignore:invalid value")
def test_a_latitude_that_is_no_number_has_no_radii() -> None:
    for lat in (math.nan, math.inf):
        assert all(map(math.isnan, one_point.radii(lat)))
