"""Error of a measured range: bias, scale factor, and noise of both kinds.

    d d = d (s_d + n_s) + b_d + n_d

With n_s = 0 this is eq. 2.63, else eq. 2.64.  It describes a pencil beam; a wide beam adds
geometry and signal effects, which the beam model contains.  Source: Spiegel 2018, section 2.2.4.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array


@dataclass(frozen=True, slots=True)
class RangeError:
    """bias b_d [m], scale factor s_d [1]; noise_sd of n_d [m], scale_noise_sd of n_s [1].

    Raises ValueError for a figure that is not finite and for a negative standard deviation.
    """

    bias: float = 0.0
    scale: float = 0.0
    noise_sd: float = 0.0
    scale_noise_sd: float = 0.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not np.isfinite(value) or (field.name.endswith("_sd") and value < 0.0):
                raise ValueError(f"{field.name} is {value}, must be finite, and a standard deviation not negative")

    def apply(self, slant_range: ArrayLike, rng: np.random.Generator | None = None) -> Array:
        """The range with its error [m]; NaN stays NaN.  ``rng`` None: bias and scale factor only."""
        true = np.asarray(slant_range, dtype=np.float64)
        scale, bias = np.full_like(true, self.scale), np.full_like(true, self.bias)
        if rng is not None:
            scale += self.scale_noise_sd * rng.standard_normal(true.shape)
            bias += self.noise_sd * rng.standard_normal(true.shape)
        return np.asarray(true * (1.0 + scale) + bias)
