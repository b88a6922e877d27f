"""From the axes of a case to those of the aircraft, for measurements that a driver can only give in the former."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable

from fti.config import Device
from fti.geodesy.rotations import mat_from_rpy
from fti.types import MagneticField, Measurement


class Mountings:
    """How the devices are mounted: ``rpy_bs_deg``.

        field_b = mat_bs field_s

    A range stays as it is: it has a direction of its own, see ``fti.nav.altimetry.compensation``.
    """

    def __init__(self, devices: Iterable[Device]) -> None:
        self._mats = {
            device.name: mat_from_rpy(*(math.radians(a) for a in device.rpy_bs_deg))
            for device in devices
            if any(device.rpy_bs_deg)
        }

    def turn(self, device: str, m: Measurement) -> Measurement:
        """The measurement in the body frame; the same one where the case is aligned with the aircraft."""
        if device not in self._mats or not isinstance(m, MagneticField):
            return m
        forward, right, down = (self._mats[device] @ m.field_b).tolist()
        return dataclasses.replace(m, field_b=(forward, right, down))
