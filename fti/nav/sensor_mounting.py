"""Rotation from sensor axes to body axes, for measurements that a driver gives in sensor axes."""

from __future__ import annotations

import math
from collections.abc import Iterable

from msgspec.structs import replace

from fti.config import Device
from fti.geodesy.formulas import mat_nb, rotate
from fti.messages.measurements import ImuSample, MagneticField, Measurement


class Mountings:
    """Mounting angles of the devices: ``rpy_bs_deg``.

        v_b = mat_bs v_s,      a magnetic field, a specific force, a turn rate

    Ranges are not rotated: they have a direction of their own, see ``fti.nav.altimetry.compensation``.  Attitudes are
    not rotated, because devices that give one know their mounting.
    """

    def __init__(self, devices: Iterable[Device]) -> None:
        rotated = {device.name: device.rpy_bs_deg for device in devices if any(device.rpy_bs_deg)}
        self._mats = {name: mat_nb(*(math.radians(a) for a in angles)) for name, angles in rotated.items()}

    def turn(self, device: str, m: Measurement) -> Measurement:
        """The measurement in the body frame; the same one where the case is aligned with the aircraft."""
        mat = self._mats.get(device)
        if mat is None:
            return m
        if isinstance(m, MagneticField):
            return replace(m, field_b=rotate(mat, m.field_b))
        if isinstance(m, ImuSample):
            accel, gyro = (None if v is None else rotate(mat, v) for v in (m.accel_b, m.gyro_b))
            return replace(m, accel_b=accel, gyro_b=gyro)
        return m
