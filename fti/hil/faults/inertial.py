"""Bias steps of inertial sensors, in the axes of their device."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fti.arrays import Array
from fti.constants import STANDARD_GRAVITY
from fti.hil.tables.fault_types import Fault, InertialBias

DEG_PER_HOUR = math.radians(1.0) / 3600.0


def bias_steps(device: str, faults: Sequence[Fault], t: Array) -> tuple[Array, Array]:
    """Biases added to specific force [m/s^2] and angular rate [rad/s] of a device, (n, 3), at t [s], shape (n,)."""
    force, rate = np.zeros((*t.shape, 3)), np.zeros((*t.shape, 3))
    for fault in faults:
        if isinstance(fault, InertialBias) and fault.includes_device(device):
            here = (t >= fault.from_s) & (t < fault.to_s)
            force[here] += 1e-3 * STANDARD_GRAVITY * np.array(fault.accel_mg)
            rate[here] += DEG_PER_HOUR * np.array(fault.gyro_degph)
    return force, rate
