"""A device mounted at another position than its configuration states."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fti.arrays import Array
from fti.devices import BoundDevice
from fti.hil.environment import Environment
from fti.hil.faults.applicability import applies_to
from fti.hil.sensors.model import SensorModel, SensorModelType
from fti.hil.tables.fault_types import LeverArm
from fti.messages.measurements import Measurement, Stamp


class MisplacedModel:
    """Two models of one device with the same random errors: at its configured position, and at the true one.

    misplaced : at the true position, for samples with ``is_misplaced``, shape (n,)
    """

    def __init__(self, configured: SensorModel, misplaced: SensorModel, is_misplaced: Sequence[bool]) -> None:
        self._configured, self._misplaced, self._is_misplaced = configured, misplaced, is_misplaced

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """See ``SensorModel``."""
        return (self._misplaced if self._is_misplaced[k] else self._configured).measure(k, stamp)


def make_model(
    kind: SensorModelType, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator
) -> SensorModel:
    """The model of a device at the times t, shape (n,) [s], with the faults of its lever arm."""
    faults = [f for f in world.scenario.fault if isinstance(f, LeverArm) and applies_to(f, bound)]
    equal_rngs = [copy.deepcopy(rng) for _ in faults]
    model = kind(bound, world, t, rng)
    for fault, equal_rng in zip(faults, equal_rngs, strict=True):
        is_misplaced = (t >= fault.from_s) & (t < fault.to_s)
        if is_misplaced.any():
            offset = (fault.forward_m, fault.right_m, fault.down_m)
            arm_b = tuple(a + b for a, b in zip(bound.device.lever_arm_b, offset, strict=True))
            device = replace(bound, device=bound.device.model_copy(update={"lever_arm_b": arm_b}))
            model = MisplacedModel(model, kind(device, world, t, equal_rng), is_misplaced.tolist())
    return model
