"""A copy of the filter that goes on without one source, and how far the filter has come away from it.

    d = x_0 - x_i,    Cov(d) = P_i - P_0     x_0 with all sources, x_i without one, both optimal from a common past

Source: Brenner 1996 (solution separation); Lee, O'Laughlin 2000 (delayed references).
Checked against: tests/nav/test_separation.py.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.nav.filter import kernels
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.innovation_gate import LIMITS, GateDecision, GateStates
from fti.nav.filter.measurement_update import compute_nis, update_estimate
from fti.nav.filter.segment import AidingEntry, Moment, Piece

Array = NDArray[np.float64]

#: sigma of d is at least this share of that of the filter: of a copy that has just begun P_i - P_0 is rounding.
MIN_SHARE = 0.1


@dataclass(slots=True)
class FilterCopy:
    """The filter as it was at ``began_ns``, moved on without the sources ``removed_names`` (names of ``Aiding``).

    outside_ns, times : since when, and in how many, those that are tested have been outside its gate; None: inside
    """

    began_ns: int
    estimate: Estimate
    gate_states: GateStates
    removed_names: frozenset[str]
    outside_ns: int | None = None
    times: int = 0

    @classmethod
    def begin(cls, moment: Moment, removed_names: frozenset[str]) -> FilterCopy:
        """What the filter holds now."""
        return cls(moment.estimate.t_ns, moment.estimate, moment.gate_states, removed_names)

    def advance(self, pieces: Iterable[Piece], tested: frozenset[str] = frozenset()) -> None:
        """Follow the filter through a segment.  tested : names of ``removed_names`` that are compared with it"""
        model = self.estimate.model
        for piece in pieces:
            y, P = self.estimate.y.copy(), self.estimate.P.copy()
            kernels.coast(
                y, P, piece.imu_start, piece.imu_end, piece.bends, model.unit.table, model.drifts, piece.seconds
            )
            self.estimate = Estimate(piece.end_ns, y, P, piece.imu_end[-1], model)
            for entry in piece.entries:
                if entry.aiding.name not in self.removed_names:
                    found = update_estimate(self.estimate, self.gate_states, entry.aiding, entry.t_ns)
                    self.estimate, self.gate_states = found.estimate, found.gate_states
                elif entry.aiding.name in tested and entry.decision is not GateDecision.EXCLUDED:
                    self._compare(entry)

    def _compare(self, entry: AidingEntry) -> None:
        matrices = entry.aiding.compute_matrices(self.estimate)
        if compute_nis(self.estimate, matrices) <= LIMITS[len(matrices[0])]:
            self.outside_ns, self.times = None, 0
            return
        self.outside_ns = entry.t_ns if self.outside_ns is None else self.outside_ns
        self.times += 1


class Separation(NamedTuple):
    """Of the filter from a copy, in north, east, down.

    d, d_sd : ndarray, shape (6,)   difference of position [m] and velocity [m/s], and its sigma
    copy_sd : ndarray, shape (6,)   sigma of the copy
    level_ratios : of position and velocity, |d| over its sigma in the horizontal direction in which that is largest
    radial_sd : the largest sigma of the copy's horizontal position in any direction [m]
    """

    d: Array
    d_sd: Array
    copy_sd: Array
    level_ratios: tuple[float, float]
    radial_sd: float

    @property
    def ratios(self) -> Array:
        """|d| over its sigma, shape (6,)."""
        return np.asarray(np.abs(self.d) / self.d_sd)


def separate(filtered: Estimate, copy: Estimate) -> Separation:
    """How far the filter is from a copy of the same time."""
    found, level, radial_sd = kernels.separate(filtered.y, filtered.P, copy.y, copy.P, filtered.mat_en, MIN_SHARE)
    return Separation(found[0], found[1], found[2], (float(level[0]), float(level[1])), radial_sd)


def largest_sd(cov: Array) -> float:
    """The largest sigma in any direction of a covariance, shape (2, 2)."""
    return kernels.largest_sd(cov[0, 0], cov[1, 1], cov[0, 1])
