"""Search for the shift with the smallest chi-square: every shift of a lattice."""

# ruff: noqa: PLR0917 - compiled kernels take their arrays by position

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.kernel import kernel
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.window import TerrainWindow


@dataclass(frozen=True)
class Lattice:
    """Shifts in whole cells: the weights of the four posts around a sample are then the same for all shifts.

    steps  : number of shifts on each side of ``centre``, both ways
    stride : cells between two shifts
    centre : of the shifts, east and north [cells]
    """

    steps: int
    stride: int = 1
    centre: tuple[int, int] = (0, 0)

    def shifts(self, cell_m: float) -> tuple[Array, Array]:
        """East of the columns and north of the rows [m]."""
        offsets = self.stride * np.arange(-self.steps, self.steps + 1)
        return np.asarray(cell_m * (self.centre[0] + offsets)), np.asarray(cell_m * (self.centre[1] + offsets))


def _add_row(west: Array, east: Array, u: float, ground: float, weight: float, sums: Array, squares: Array) -> None:
    """Adds a sample to a row of shifts.  west, east : heights of the row on both sides of the sample"""
    for j in range(len(sums)):
        residual = ground - (west[j] + u * (east[j] - west[j]))
        sums[j] += weight * residual
        squares[j] += weight * residual * residual


@kernel
def _lattice_sums(
    heights: Array, column: Array, row: Array, ground: Array, weight: Array, stride: int, sums: Array, squares: Array
) -> None:
    """Adds w r and w r^2 of each sample to every shift.

    heights   : (rows, columns) [m];  column, row : of the samples at the first shift, within the heights
    sums, squares : (shifts north, shifts east)
    """
    north_shifts, east_shifts = sums.shape
    between = np.empty(east_shifts * stride + 1)  # heights between the two rows of posts around a sample
    for i in range(north_shifts):
        for k in range(len(ground)):
            first_row, first_column = int(row[k]) + i * stride, int(column[k])
            u, v = column[k] - first_column, row[k] - int(row[k])
            south = heights[first_row, first_column : first_column + len(between)]
            north = heights[first_row + 1, first_column : first_column + len(between)]
            for x in range(len(between)):
                between[x] = south[x] + v * (north[x] - south[x])
            if stride == 1:  # apart, so that the compiler takes several shifts at once
                _add_row(between[:-1], between[1:], u, ground[k], weight[k], sums[i], squares[i])
            else:
                west, east = between[:-1:stride], between[1::stride]
                _add_row(west, east, u, ground[k], weight[k], sums[i], squares[i])


def search_lattice(window: TerrainWindow, profile: Profile, lattice: Lattice) -> Array:
    """Chi-square of each shift of a lattice, shape (shifts north, shifts east).

    NaN where a sample is over unknown ground.  Raises ValueError if the window does not contain all shifted samples.
    """
    column, row = window.places(profile.east, profile.north)
    first = np.asarray(lattice.centre) - lattice.steps * lattice.stride
    column, row = column + first[0], row + first[1]
    span = 2 * lattice.steps * lattice.stride
    rows, columns = window.heights.shape
    if column.min() < 0 or row.min() < 0 or column.max() + span >= columns - 1 or row.max() + span >= rows - 1:
        raise ValueError(f"the window of {rows} x {columns} posts does not contain all shifts of {span} cells")
    sums, squares = np.zeros((2, 2 * lattice.steps + 1, 2 * lattice.steps + 1))
    _lattice_sums(window.heights, column, row, profile.ground, profile.weight, lattice.stride, sums, squares)
    return np.asarray(squares - sums**2 / profile.total_weight)
