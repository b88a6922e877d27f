"""The posts and the lattice for a search within a distance, in bounded time and memory."""

from __future__ import annotations

import math

from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.search import Lattice
from fti.nav.terrain_matching.window import TerrainWindow, cut_window, resample_window
from fti.terrain.terrain import Terrain

#: Shifts on each side of the centre, and posts of a window: 40 ms and 8 MB.
MAX_STEPS, MAX_POSTS = 60, 1_000_000
#: Posts around the shifted samples, for the refinement and for a drift.
MARGIN_CELLS = 4


def lattice_within(reach_m: float, cell_m: float) -> Lattice:
    """The shifts up to ``reach_m`` to each side, with a stride where they are many."""
    cells = math.ceil(reach_m / cell_m)
    stride = math.ceil(cells / MAX_STEPS)
    return Lattice(math.ceil(cells / stride), stride)


def search_area(
    terrain: Terrain, profile: Profile, reach_m: float, *, margin_m: float = 0.0, min_cell_m: float = 0.0
) -> tuple[TerrainWindow, Lattice]:
    """The window around a profile, and the lattice of the shifts up to ``reach_m`` to each side.

    Far searches have a stride of several cells; each minimum is then refined on all cells.  Where the posts of the
    finest layer would be more than ``MAX_POSTS``, the window has larger cells.

    margin_m : additional ground at each side [m];  min_cell_m : distance between posts, at least [m]
    """
    extent = [float(axis.max() - axis.min()) + 2.0 * (reach_m + margin_m) for axis in (profile.east, profile.north)]
    coarse_m = max(math.sqrt(extent[0] * extent[1] / MAX_POSTS), min_cell_m)
    is_coarse = coarse_m > terrain.finest.cell_m
    cell_m = coarse_m if is_coarse else terrain.finest.cell_m
    lattice = lattice_within(reach_m, cell_m)
    around_m = (lattice.steps * lattice.stride + MARGIN_CELLS) * cell_m + margin_m
    window = (
        resample_window(terrain, profile, around_m, cell_m) if is_coarse else cut_window(terrain, profile, around_m)
    )
    return window, lattice


def corridor_m(window: TerrainWindow, lattice: Lattice) -> float:
    """Largest distance from a sample of the posts that its shifts use [m]; a lattice may reach beyond ``reach_m``."""
    return math.sqrt(2.0) * (lattice.steps * lattice.stride + MARGIN_CELLS) * window.cell_m
