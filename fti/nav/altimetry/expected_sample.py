"""Prediction of one altimeter sample over known ground (computed by ``fti.nav.altimetry.expected_range``)."""

from __future__ import annotations

import math

from msgspec import Struct

from fti.messages.outputs import Compensation
from fti.messages.reasons import Reason


class ExpectedSample(Struct, frozen=True, gc=False):
    """The prediction of one sample.

    slant_range, range_sd : range that the altimeter should measure [m], and one sigma of measured minus predicted [m]
    height, height_sd     : of P over the ground straight below, by navigation alone; sigma of the compensated one [m]
    ground_sd             : see ``nadir_height.ground_sd`` [m]
    dispersion, incidence : of the ranges across the beam [m], of the ray on the ground [rad]
    cosine                : of the angle between the ray and the plumb line
    compensation          : how a range becomes a height
    """

    slant_range: float
    range_sd: float
    height: float
    height_sd: float
    ground_sd: float
    dispersion: float
    incidence: float
    cosine: float
    compensation: Compensation

    def compensate(self, slant_range: float) -> tuple[float, float, Compensation] | None:
        """Height of P over the ground straight below it [m], one sigma, and how; None where that ground is unknown.

        h = h(P) - h(N) + (d_measured - d_predicted) cos(theta): eq. 3.33, corrected.
        """
        height = self.height + (slant_range - self.slant_range) * self.cosine
        return (height, self.height_sd, self.compensation) if math.isfinite(height + self.height_sd) else None


class NoGround(Struct, frozen=True, gc=False):
    """The predicted beam meets no ground.

    min_range, range_sd : the altimeter measures at least this, if anything [m]; one sigma of measured minus it [m]
    """

    min_range: float
    range_sd: float


#: The prediction, or the reason why there is none.
ExpectedSampleOrReason = ExpectedSample | NoGround | Reason
