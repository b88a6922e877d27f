"""Test ``repeated``: the digits of a field stay the same although the stated velocity would have moved it.

A run of equal values is nominal while the position moves within one step of the field.  It is a fault when the run has
at least 3 values and lasts MIN_RUN_S, and the stated velocity has moved the position by 3 steps and 5.5 sigma of the
difference of two fixes: a coarse field in a slow climb repeats by chance.  A minimum duration is needed because some
devices send a value of 1 Hz ten times a second.
"""

from __future__ import annotations

from math import sqrt

from fti.constants import SECOND_NS
from fti.nav.plausibility.budget import K_FALSE

SQRT_2 = sqrt(2.0)

MIN_VALUES = 3
STEPS = 3.0
#: Steps of the field beyond which digits should have changed: an equal fix is held back.
SUSPICIOUS_STEPS = 2.0
MIN_RUN_S = 1.2
#: Maximum error of a stated velocity [m/s].
VELOCITY_ERROR = 0.3
#: Resolution while it is unknown [m]: twice that of a latitude of 20 bits (ARINC 429, label 310: 19 m).
UNKNOWN_STEP_M = 38.2


class RepetitionTest:
    """One axis.

    is_suspicious : the newest value should have changed;  is_repeated : it is a fault;  since_ns : first of the run
    """

    def __init__(self) -> None:
        self.is_suspicious = False
        self.is_repeated = False
        self.since_ns = 0
        self.moved = 0.0
        self._value: float | None = None
        self._count = 0

    def update(self, t_ns: int, value: float, movement: float, step: float, noise: float) -> None:
        """Add a value as the device states it.

        movement : along the axis by the stated velocity since the last value [m];  step : resolution [m];
        noise : one sigma of the white noise of fixes [m]
        """
        if value != self._value:
            self._value, self._count, self.moved, self.since_ns = value, 1, 0.0, t_ns
            self.is_suspicious = self.is_repeated = False
            return
        self._count += 1
        self.moved += movement
        run_s = (t_ns - self.since_ns) / SECOND_NS
        known = abs(self.moved) - VELOCITY_ERROR * run_s
        self.is_suspicious = known > SUSPICIOUS_STEPS * step
        is_long = self._count >= MIN_VALUES and run_s >= MIN_RUN_S
        self.is_repeated = self.is_repeated or (is_long and known > STEPS * step + K_FALSE * SQRT_2 * noise)
