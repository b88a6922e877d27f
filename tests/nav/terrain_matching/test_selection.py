"""Selection of samples: against random selections, and on ground where the best samples are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RectBivariateSpline

from fti.arrays import Array, Ints
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.selection import select_samples
from fti.nav.terrain_matching.window import cut_window
from fti.terrain.terrain import Terrain
from tests.nav.terrain_matching.grounds import CELL_M, fly, hills

POSITION_SD_M = 5.0


def selected(ground: Terrain, profile: Profile, count: int, position_sd: float = POSITION_SD_M) -> Ints:
    return select_samples(cut_window(ground, profile, 50.0), profile, count, position_sd)


def sigma_of(ground: Terrain, profile: Profile, samples: Ints) -> float:
    """Of the shift [m], both axes together, from slopes by a spline; height error with its prior."""
    layer = ground.finest
    surface = RectBivariateSpline(layer.north, layer.east, layer.heights, kx=1, ky=1)
    north, east = profile.north[samples], profile.east[samples]
    columns: Array = np.column_stack(
        [
            np.ones(len(samples)),
            surface.ev(north, east + 2.5) - surface.ev(north, east - 2.5),
            surface.ev(north + 2.5, east) - surface.ev(north - 2.5, east),
        ]
    )
    columns[:, 1:] /= 5.0
    weighted = columns / profile.sd[samples, None]
    information = weighted.T @ weighted + np.diag([profile.height_sd**-2, 0.0, 0.0])
    return float(np.sqrt(np.trace(np.linalg.inv(information)[1:, 1:])))


@pytest.mark.parametrize("count", [10, 25])
def test_the_selection_is_better_than_every_one_of_300_random_selections(count: int) -> None:
    ground, rng = hills(), np.random.default_rng(3)
    profile = fly(ground)
    found = selected(ground, profile, count)
    assert len(np.unique(found)) == count and (np.diff(found) > 0).all()
    others = [sigma_of(ground, profile, rng.choice(80, count, replace=False)) for _ in range(300)]
    assert sigma_of(ground, profile, found) < min(others)


def test_both_axes_get_samples_though_one_has_all_the_steepest_ground() -> None:
    """A steep slope to the east under the first half of the track, a gentle one to the north under the second."""
    axis = CELL_M * np.arange(400)
    east = np.where(axis < 950.0, 20.0 * np.sin(axis / 25.0), 0.0)
    north = np.where(axis > 1000.0, 4.0 * np.sin(axis / 25.0), 0.0)
    ground = Terrain.from_array(east + north[:, None], CELL_M)
    profile = fly(ground)
    found = selected(ground, profile, 12)
    assert np.count_nonzero(profile.east[found] < 950.0) >= 3 and np.count_nonzero(profile.north[found] > 1000.0) >= 6


def test_a_narrow_slope_is_selected_only_by_a_good_position() -> None:
    """A bank of 20 m width and slope 0.6, in hills of slope 0.4; a position of 5 m, and of 100 m."""
    axis = CELL_M * np.arange(400)
    up = 40.0 * np.sin(axis / 100.0) + 40.0 * np.sin(axis[:, None] / 100.0)
    ground = Terrain.from_array(up + 0.6 * np.clip(axis - 960.0, 0.0, 20.0), CELL_M)
    profile = fly(ground)
    on_bank = (profile.east > 961.0) & (profile.east < 979.0)
    near, far = (np.count_nonzero(on_bank[selected(ground, profile, 10, sd)]) for sd in (5.0, 100.0))
    assert near == 3 and far == 0


def test_no_more_samples_than_there_are_and_none_over_unknown_ground() -> None:
    ground = hills()
    profile = fly(ground)
    assert (selected(ground, profile, 200) == np.arange(80)).all()
    heights = ground.finest.heights.copy()
    heights[:, 150:200] = np.nan
    found = selected(ground.with_finest(heights), profile, 20)
    inside = (profile.east > CELL_M * 150 + 10.0) & (profile.east < CELL_M * 200 - 10.0)
    assert np.count_nonzero(inside) > 10 and not inside[found].any()
