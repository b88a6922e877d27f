"""Chi-square of every shift, against a plain sum over a surface from SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from fti.arrays import Array
from fti.nav.five_point_search import five_point_search
from fti.nav.terrain_matching.likelihood import Likelihood
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.search import Lattice, search_lattice
from fti.nav.terrain_matching.window import cut_window
from fti.terrain.layer import Layer
from fti.terrain.terrain import Terrain
from tests.nav.terrain_matching.grounds import CELL_M, fly, hills

#: Difference of a chi-square of order 1e4 from its oracle.
TOLERANCE = 1e-6


def plain_chi_square(ground: Terrain, profile: Profile, shift: Array) -> float:
    """Least of sum w (r - b)^2 + (b / s_b)^2 over b, by a least-squares solution."""
    layer = ground.finest
    surface = RegularGridInterpolator((layer.north, layer.east), layer.heights)
    places = np.column_stack((profile.north + shift[1], profile.east + shift[0]))
    residual = profile.ground - surface(places)
    rows = np.append(1.0 / profile.sd, 1.0 / profile.height_sd)
    values = np.append(residual / profile.sd, 0.0)
    offset, *_ = np.linalg.lstsq(rows[:, None], values, rcond=None)
    return float(((values - rows * offset[0]) ** 2).sum())


@pytest.mark.parametrize(("stride", "centre"), [(1, (0, 0)), (3, (4, -7))])
def test_every_shift_of_a_lattice_has_the_chi_square_of_the_plain_sum(stride: int, centre: tuple[int, int]) -> None:
    ground, lattice = hills(), Lattice(6, stride, centre)
    profile = fly(ground, (12.0, -9.0), height_error=3.0)
    found = search_lattice(cut_window(ground, profile, 150.0), profile, lattice)
    east, north = lattice.shifts(CELL_M)
    assert found.shape == (13, 13)
    assert east[0] == CELL_M * (centre[0] - 6 * stride) and north[-1] == CELL_M * (centre[1] + 6 * stride)
    for i, j in ((0, 0), (3, 9), (6, 6), (12, 12)):
        assert found[i, j] == pytest.approx(
            plain_chi_square(ground, profile, np.array([east[j], north[i]])), abs=TOLERANCE
        )


def test_derivatives_are_those_of_finite_differences() -> None:
    """Within a cell, where the surface is smooth: the step that is used is 1 mm."""
    ground = hills()
    profile = fly(ground, (3.3, 1.7), height_error=-2.0)
    likelihood = Likelihood(cut_window(ground, profile, 50.0), profile)
    shift, h = np.array([1.2, 0.9]), 1e-3
    at = likelihood.at(shift)
    assert at.chi_square == pytest.approx(plain_chi_square(ground, profile, shift), abs=TOLERANCE)
    for axis in range(2):
        step = h * np.eye(2)[axis]
        plus, minus = (plain_chi_square(ground, profile, shift + sign * step) for sign in (1.0, -1.0))
        assert at.half_gradient[axis] == pytest.approx(-0.25 * (plus - minus) / h, rel=1e-3)


def test_a_window_inside_a_layer_is_a_view_and_across_layers_is_the_surface() -> None:
    ground = hills()
    profile = fly(ground)
    assert cut_window(ground, profile, 100.0).heights.base is ground.finest.heights
    whole = ground.finest
    coarse = Layer(whole.heights[::2, ::2].copy(), 2.0 * CELL_M, 0.0, 0.0)
    fine = Layer(whole.heights[100:201, 100:201].copy(), CELL_M, 500.0, 500.0)
    edge = np.ones(fine.heights.shape, dtype=bool)
    edge[1:-1, 1:-1] = False
    alone = Terrain((coarse,), ground.frame)
    fine.heights[edge] = alone.up(*np.meshgrid(fine.east, fine.north))[edge]
    layers = Terrain((fine, coarse), ground.frame)
    window = cut_window(layers, profile, 100.0)
    rows, columns = window.heights.shape
    east = window.east0 + CELL_M * np.arange(columns)
    north = window.north0 + CELL_M * np.arange(rows)
    assert window.east0 <= profile.east.min() - 100.0 and east[-1] >= profile.east.max() + 100.0
    assert window.heights == pytest.approx(layers.up(*np.meshgrid(east, north)), abs=0.0)


def test_a_lattice_that_leaves_the_window_is_an_error() -> None:
    ground = hills()
    profile = fly(ground)
    with pytest.raises(ValueError, match=r"the window of \d+ x \d+ posts does not contain all shifts of 60 cells"):
        search_lattice(cut_window(ground, profile, 100.0), profile, Lattice(30))


def test_unknown_ground_below_a_sample_makes_a_shift_unknown() -> None:
    ground = hills()
    heights = ground.finest.heights.copy()
    profile = fly(ground)
    row, column = round(profile.north[40] / CELL_M), round(profile.east[40] / CELL_M) + 10
    heights[row - 3 : row + 4, column - 3 : column + 4] = np.nan
    found = search_lattice(cut_window(ground.with_finest(heights), profile, 100.0), profile, Lattice(12))
    assert np.isnan(found[12, 22]) and np.isfinite(found[12, 2])


@pytest.mark.parametrize(("resolution_m", "calls"), [(5.0, 21), (2.0, 25)])
def test_the_five_point_search_computes_the_printed_number_of_shifts(resolution_m: float, calls: int) -> None:
    """Eq. 4.30: N = log(resolution / size) / log(1/2) rounded up; 4 N + 1 shifts if the centre stays the best."""
    found, number = five_point_search(lambda shifts: np.hypot(*shifts.T), 100.0, resolution_m)
    assert number == calls and found == pytest.approx([0.0, 0.0])


def test_the_five_point_search_moves_beyond_its_first_square() -> None:
    place = np.array([170.0, -130.0])
    found, _ = five_point_search(lambda shifts: np.asarray(((shifts - place) ** 2).sum(axis=1)), 100.0, 1.0)
    assert np.abs(found - place).max() <= 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"t": np.arange(5.0)}, r"t has the shape \(5,\), must be \(5,\), 8 or more"),
        ({"ground": np.full(80, np.nan)}, "ground: 80 values are not finite"),
        ({"sd": np.zeros(80)}, "sd is 0.0 at least"),
        ({"height_sd": 0.0}, "height_sd 0.0: must be positive"),
        ({"east": np.zeros(79)}, r"east has the shape \(79,\), must be \(80,\)"),
    ],
)
def test_a_profile_that_cannot_be_used_is_an_error(change: dict[str, object], message: str) -> None:
    good = fly(hills())
    values = {name: getattr(good, name) for name in ("t", "east", "north", "ground", "sd", "height_sd")}
    with pytest.raises(ValueError, match=message):
        Profile(**{**values, **change})
