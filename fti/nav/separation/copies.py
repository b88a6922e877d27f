"""A copy of the filter without one source, and the separation of the filter from it.

    d = x_0 - x_i,    Cov(d) = P_i - P_0     x_0 with all sources, x_i without one, both optimal from a common start

Source: Brenner 1996 (solution separation); Lee, O'Laughlin 2000 (delayed references).
Checked against: tests/nav/test_separation.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.nav.filter import kernels
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.innovation_gate import LIMITS, GateDecision, GateStates
from fti.nav.filter.measurement_update import compute_nis, update_estimate
from fti.nav.filter.segment import AidingEntry, Moment, Piece

#: The sigma of d is at least this share of that of the filter: P_i - P_0 of a new copy is rounding error.
MIN_SHARE = 0.1
#: A heading that is less certain is lost [rad]; the filter has found it if its sigma has decreased by this factor.
MIN_LOST_HEADING, HEADING_FOUND = math.radians(5.0), 1.5


@dataclass(slots=True)
class FilterCopy:
    """The filter as it was at ``began_ns``, continued without the sources ``removed_names`` (names of ``Aiding``).

    heading_sd : one sigma of the heading at ``began_ns`` [rad]; 0: as certain as that of the filter
    outside_ns, times : start and number of tested measurements outside its gate; None: inside
    """

    began_ns: int
    estimate: Estimate
    gate_states: GateStates
    removed_names: frozenset[str]
    heading_sd: float = 0.0
    outside_ns: int | None = None
    times: int = 0

    @classmethod
    def begin(cls, moment: Moment, removed_names: frozenset[str]) -> FilterCopy:
        """A copy of the filter at a moment."""
        estimate = moment.estimate
        return cls(estimate.t_ns, estimate, moment.gate_states, removed_names, heading_sd=estimate.rpy_sd[2])

    def advance(self, pieces: Iterable[Piece], tested_names: frozenset[str] = frozenset()) -> None:
        """Follow the filter through a segment.  tested_names : those of ``removed_names`` that are tested against it"""
        model = self.estimate.model
        for piece in pieces:
            y, P = self.estimate.y.copy(), self.estimate.P.copy()
            kernels.coast(
                y, P, piece.imu_start, piece.imu_end, piece.bends, model.unit.table, model.drifts, piece.seconds
            )
            self.estimate = Estimate(piece.end_ns, y, P, piece.imu_end[-1], model)
            for entry in piece.entries:
                if entry.aiding.name not in self.removed_names:
                    update = update_estimate(self.estimate, self.gate_states, entry.aiding, entry.t_ns)
                    self.estimate, self.gate_states = update.estimate, update.gate_states
                elif entry.aiding.name in tested_names and entry.decision is not GateDecision.EXCLUDED:
                    self._compare(entry)

    def shows_faults(self, filtered: Estimate) -> bool:
        """Whether a separation from the filter shows a fault of the sources.

        False if the filter has found an uncertain heading in a turn since: the effect on the copy is not linear.
        """
        return self.heading_sd < MIN_LOST_HEADING or self.heading_sd < HEADING_FOUND * filtered.rpy_sd[2]

    def _compare(self, entry: AidingEntry) -> None:
        matrices = entry.aiding.compute_matrices(self.estimate)
        if compute_nis(self.estimate, matrices) <= LIMITS[len(matrices[0])]:
            self.outside_ns, self.times = None, 0
            return
        self.outside_ns = entry.t_ns if self.outside_ns is None else self.outside_ns
        self.times += 1


class Separation(NamedTuple):
    """Separation of the filter from a copy, in north, east, down.

    d, d_sd : ndarray, shape (6,)   difference of position [m] and velocity [m/s], and its sigma
    copy_sd : ndarray, shape (6,)   sigma of the copy
    level_ratios : of position and velocity, the largest |d| over its sigma over all horizontal directions
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
    """Separation of the filter from a copy of the same time."""
    values, ratios, radial_sd = kernels.separate(filtered.y, filtered.P, copy.y, copy.P, filtered.mat_en, MIN_SHARE)
    return Separation(values[0], values[1], values[2], (float(ratios[0]), float(ratios[1])), radial_sd)


def largest_sd(cov: Array) -> float:
    """The largest sigma in any direction of a covariance, shape (2, 2)."""
    return kernels.largest_sd(cov[0, 0], cov[1, 1], cov[0, 1])
