"""Altitudes of altimeters over sloping ground: where one is not sure of the place, one is not of the height."""

from __future__ import annotations

import numpy as np
import pytest

from fti.config import Altimeter, Device, Filter
from fti.nav.aided import AidedNavigation
from fti.nav.filter.aiding import TerrainAltitude
from fti.nav.filter.states import DEM_DRIFT
from fti.nav.ground import Ground
from fti.nav.navigation import NavState
from fti.nav.sources import PositionState
from fti.terrain.terrain import Terrain
from fti.types import HeightAboveGround

T0, LAT = 10**12, 0.8
LASER = Device(name="laser", link="l", driver="d", altimeter=Altimeter(kind="laser", range_m=(1.0, 700.0)))


@pytest.mark.parametrize(("place_sd", "ground_sd"), [(100.0, 20.0), (0.1, 1.0)])
def test_on_a_slope_the_ground_is_as_uncertain_as_the_place(
    monkeypatch: pytest.MonkeyPatch, place_sd: float, ground_sd: float
) -> None:
    """Coasting, 100 m of doubt over a slope of 0.2: the height of an altimeter is no altitude to 2 m."""
    posts = 100.0 + 0.2 * np.arange(0.0, 4001.0, 20.0)[:, None] + np.zeros((1, 201))
    terrain = Terrain.from_array(posts, 20.0, lat0=LAT, lon0=0.2, east0=-2000.0, north0=-2000.0)
    settings = Filter(imu="imu", altimeters=("laser",))
    aided = AidedNavigation(settings, {"laser": LASER})
    aided.give_ground(Ground(terrain, 1.0, "slope"))
    told: list[TerrainAltitude] = []
    monkeypatch.setattr(aided._navigator, "take", lambda t_ns, aiding: told.append(aiding))
    position = PositionState(LAT, 0.2, 700.0, place_sd, 1.0, 60.0, 0.0, 0.0, T0)
    height = HeightAboveGround(
        t_ns=T0, t_valid_ns=T0, sensor="laser", raw=200.0, height_agl=200.0, sd=0.5, valid=True, reasons=()
    )
    aided.take_height(height, NavState(T0, None, position, None, "filter"))
    assert told[0].alt == pytest.approx(700.0, abs=0.1)
    assert told[0].dem_factor * DEM_DRIFT.sd == pytest.approx(max(ground_sd, DEM_DRIFT.sd), rel=0.01)
