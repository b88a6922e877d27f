"""What faults have in common: whom they are of, and when."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator

from fti.config import Name, StrictModel
from fti.hil.tables.quantities import parse

NotNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(gt=0, le=1)]


class OnDevices(StrictModel):
    """A fault of devices in an interval of the flight; no device named means every one that it can be on."""

    devices: tuple[Name, ...] = ()
    from_s: NotNegative
    to_s: NotNegative

    def may_be_on(self, device: str) -> bool:
        """Is the device named, or none at all?"""
        return not self.devices or device in self.devices


class OnQuantity(OnDevices):
    """A fault of one field of one measurement, in SI and radians: ``quantity = "range.slant_range"``.

    Of a vector the component is named: ``quantity = "imu_sample.gyro_b_2"``.  What is not measured (None) stays so.
    name : of a Reading, a surface or a station: only this one
    """

    quantity: str
    name: str | None = None

    @field_validator("quantity")
    @classmethod
    def _is_there(cls, text: str) -> str:
        parse(text)
        return text


class OnMessages(OnDevices):
    """A fault of the bytes of this share of a device's messages, drawn from the scenario's seed."""

    share: Share = 1.0


class OnLinks(StrictModel):
    """A fault of CAN links in an interval of the flight; no link named means every one that it can be on."""

    links: tuple[Name, ...] = ()
    from_s: NotNegative
    to_s: NotNegative
