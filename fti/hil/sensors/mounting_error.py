"""A device that is mounted elsewhere than its configuration states."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from fti.devices import BoundDevice
from fti.hil.environment import Environment
from fti.hil.faults.applicability import applies_to
from fti.hil.sensors.model import Array, SensorModel, SensorModelType
from fti.hil.tables.fault_types import LeverArm
from fti.types import Measurement, Stamp


class MisplacedModel:
    """Two models of one device, equal in everything random: at its configured place, and at the true one.

    moved : at the true place, while ``is_moved``, shape (n,)
    """

    def __init__(self, configured: SensorModel, misplaced: SensorModel, is_moved: Sequence[bool]) -> None:
        self._configured, self._moved, self._is_moved = configured, misplaced, is_moved

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """See ``SensorModel``."""
        return (self._moved if self._is_moved[k] else self._configured).measure(k, stamp)


def make_model(
    kind: SensorModelType, bound: BoundDevice, world: Environment, t: Array, rng: np.random.Generator
) -> SensorModel:
    """The model of a device at the times t, shape (n,) [s], with the faults of its lever arm."""
    faults = [f for f in world.scenario.fault if isinstance(f, LeverArm) and applies_to(f, bound)]
    places = [(fault, _moved(bound, fault), copy.deepcopy(rng)) for fault in faults]
    model = kind(bound, world, t, rng)
    for fault, there, equal_rng in places:
        is_moved = (t >= fault.from_s) & (t < fault.to_s)
        if is_moved.any():
            model = MisplacedModel(model, kind(there, world, t, equal_rng), is_moved.tolist())
    return model


def _moved(bound: BoundDevice, fault: LeverArm) -> BoundDevice:
    """The device at its true place."""
    arm_b = _sum(bound.device.lever_arm_b, (fault.forward_m, fault.right_m, fault.down_m))
    return replace(bound, device=bound.device.model_copy(update={"lever_arm_b": arm_b}))


def _sum(one: Iterable[float], other: Iterable[float]) -> tuple[float, ...]:
    return tuple(a + b for a, b in zip(one, other, strict=True))
