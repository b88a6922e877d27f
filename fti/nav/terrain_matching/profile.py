"""A height profile of the ground below the track."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fti.arrays import Array, Ints, Mask

MIN_SAMPLES = 8
SAMPLE_FIELDS = ("t", "east", "north", "ground", "sd")


@dataclass(frozen=True, eq=False)
class Profile:
    """Samples of the ground, shape (K,) each.

    t           : time of each sample [s], ascending
    east, north : navigated position [m]
    ground      : navigated height minus measured height above ground, ``up`` of the ground [m]
    sd          : one sigma of the independent error of ``ground``: altimeter and elevation [m]
    height_sd   : one sigma of the common error of ``ground``: navigated height and datum [m]
    Raises ValueError for less than ``MIN_SAMPLES`` samples, other shapes, values that are not finite, a sigma that is
    not positive.
    """

    t: Array
    east: Array
    north: Array
    ground: Array
    sd: Array
    height_sd: float

    def __post_init__(self) -> None:
        for name in SAMPLE_FIELDS:
            values = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            if values.shape != (len(self.t),) or len(values) < MIN_SAMPLES:
                raise ValueError(
                    f"{name} has the shape {values.shape}, must be ({len(self.t)},), {MIN_SAMPLES} or more"
                )
            if not np.isfinite(values).all():
                raise ValueError(f"{name}: {np.count_nonzero(~np.isfinite(values))} values are not finite")
            object.__setattr__(self, name, values)
        if not (self.sd.min() > 0.0 and self.height_sd > 0.0):
            raise ValueError(f"sd is {self.sd.min()} at least, height_sd {self.height_sd}: must be positive")

    def __len__(self) -> int:
        return len(self.t)

    @property
    def weight(self) -> Array:
        """1 / sd^2 of each sample [1/m^2]."""
        return np.asarray(1.0 / self.sd**2)

    @property
    def total_weight(self) -> float:
        """Sum of the weights and of the prior of the common error [1/m^2]."""
        return float(self.weight.sum() + 1.0 / self.height_sd**2)

    @property
    def middle(self) -> float:
        """Time between the first and the last sample [s]."""
        return float(0.5 * (self.t[0] + self.t[-1]))

    def select(self, samples: Ints | Mask) -> Profile:
        """The profile of some of its samples.  samples : indices or mask"""
        columns = {name: getattr(self, name)[samples] for name in SAMPLE_FIELDS}
        return replace(self, **columns)
