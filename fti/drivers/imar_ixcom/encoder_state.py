"""Newest measurements of the emulated device, whose messages combine measurements of one stamp."""

from __future__ import annotations

from typing import Any, TypeVar

from fti.drivers.imar_ixcom.generic_values import nan_if_none
from fti.drivers.imar_ixcom.status import HEALTHY
from fti.messages.measurements import DeviceStatus, Measurement, Reading, Stamp

M = TypeVar("M", bound=Measurement)


class EncoderState:
    """The newest measurement of each class, the newest value of each Reading, the flags of the newest status.

    magnetometer_unit : unit of MAGDATA
    """

    def __init__(self, magnetometer_unit: str) -> None:
        self.magnetometer_unit = magnetometer_unit
        self.flags = HEALTHY
        self.readings: dict[str, float | None] = {}
        self._newest: dict[type, Measurement] = {}

    def update(self, measurement: Measurement) -> None:
        """Store a measurement."""
        if type(measurement) is DeviceStatus:
            self.flags = measurement.flags
        elif type(measurement) is Reading:
            self.readings[measurement.name] = measurement.value if measurement.valid else None
        else:
            self._newest[type(measurement)] = measurement

    def value(self, kind: type[Measurement], name: str, stamp: Stamp) -> float:
        """A field of the newest one of a class, if it has this stamp; otherwise NaN."""
        return nan_if_none(getattr(self.get(kind, stamp), name, None))

    def get(self, kind: type[M], stamp: Stamp) -> M | None:
        """The newest one of a class, if it has this stamp."""
        newest: Any = self._newest.get(kind)
        return newest if newest is not None and (newest.stamp is stamp or newest.stamp == stamp) else None
