"""The drift between two looks as aiding without the attitude, as the source prints it: reference rows of the study.

    velocity   the mean velocity error over the pair, as the present one (eq. 5.8, 5.9):  ds / dt = -d_v
    increment  the position increment through the transition of the filter (eq. 5.13):    ds = -(1 - Phi^-1) d, rows of
               the position;  Phi from the first look to the second

d : truth minus estimate.  Both assume that the drift was zero but for the present errors, since the filter that placed
the looks is the filter that is aided.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from fti.nav.filter.aiding import NO_AXES, Aiding, NoOwnStates
from fti.nav.filter.antenna import Matrices
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.look_mark import LookDrift
from fti.nav.inertial.ins_error_model import BIASED, POS, TURN, VEL, rates, transition


@dataclass(frozen=True, eq=False)
class _PrintedForm(NoOwnStates):
    """A form.  measured : the drift;  interval : from look to look [s]"""

    measured: LookDrift
    interval: float
    name: str = "printed.form"
    bounds = NO_AXES

    @property
    def is_conceivable(self) -> bool:
        """That of the drift."""
        return self.measured.is_conceivable


class MeanVelocity(_PrintedForm):
    """Equation 5.9."""

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """z = drift / interval = -d_v along the measured directions."""
        drift = self.measured
        H = np.zeros((len(drift.drift), estimate.model.size))
        H[:, VEL:TURN] = -drift.axes_e
        return drift.drift / self.interval, H, drift.cov / self.interval**2


class PositionIncrement(_PrintedForm):
    """Equation 5.13."""

    def compute_matrices(self, estimate: Estimate) -> Matrices:
        """z = drift = -(d_k - d_k-1), with d_k-1 = Phi^-1 d_k."""
        drift = self.measured
        force_e = estimate.mat_eb @ estimate.imu[:3]
        down_e = -estimate.y[:3] / np.linalg.norm(estimate.y[:3])
        phi = np.eye(BIASED)
        phi[:9] = transition(rates(estimate.mat_eb, force_e, down_e, True), self.interval)
        H = np.zeros((len(drift.drift), estimate.model.size))
        H[:, :BIASED] = -drift.axes_e @ (np.eye(BIASED) - np.linalg.inv(phi))[POS:VEL]
        return drift.drift, H, drift.cov


#: Forms by name.
FORMS: Mapping[str, Callable[[LookDrift, float], Aiding]] = MappingProxyType(
    {"velocity": MeanVelocity, "increment": PositionIncrement}
)
