"""Rotation from sensor axes to body axes, for measurements that a driver gives in sensor axes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from fti.config import Device
from fti.geodesy.rotations import mat_from_rpy
from fti.messages.measurements import ImuSample, MagneticField, Measurement

Vector = tuple[float, float, float]


class Mountings:
    """Mounting angles of the devices: ``rpy_bs_deg``.

        v_b = mat_bs v_s,      a magnetic field, a specific force, a turn rate

    Ranges are not rotated: they have a direction of their own, see ``fti.nav.altimetry.compensation``.  Attitudes are
    not rotated, because devices that give one know their mounting.
    """

    def __init__(self, devices: Iterable[Device]) -> None:
        self._mats = {
            device.name: mat_from_rpy(*(math.radians(a) for a in device.rpy_bs_deg))
            for device in devices
            if any(device.rpy_bs_deg)
        }

    def turn(self, device: str, m: Measurement) -> Measurement:
        """The measurement in the body frame; the same one where the case is aligned with the aircraft."""
        mat = self._mats.get(device)
        if mat is None:
            return m
        if isinstance(m, MagneticField):
            return dataclasses.replace(m, field_b=_rotate(mat, m.field_b))
        if isinstance(m, ImuSample):
            accel, gyro = (None if v is None else _rotate(mat, v) for v in (m.accel_b, m.gyro_b))
            return dataclasses.replace(m, accel_b=accel, gyro_b=gyro)
        return m


def _rotate(mat_bs: NDArray[np.float64], v_s: Vector) -> Vector:
    forward, right, down = (mat_bs @ v_s).tolist()
    return forward, right, down
