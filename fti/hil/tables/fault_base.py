"""Common base of the fault tables: subjects and interval."""

from __future__ import annotations

from typing import Annotated, ClassVar, Self

from pydantic import Field, field_validator, model_validator

from fti.config import Name, StrictModel
from fti.config.keys import NO_UNIT, ONE, key
from fti.hil.tables.quantity_names import parse

NotNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(gt=0, le=1)]

#: The unit of a number that is added to a quantity: the quantity's own, SI and radians.
UNIT_OF_QUANTITY = "of the quantity"


class EffectiveFault(StrictModel):
    """A fault that has an effect.  one_not_zero : keys that must not all be zero"""

    one_not_zero: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="after")
    def _check_not_zero(self) -> Self:
        values = [getattr(self, name) for name in self.one_not_zero]
        if values and not any(any(value) if isinstance(value, tuple) else value for value in values):
            raise ValueError(f"one of {', '.join(self.one_not_zero)} must not be 0")
        return self


FromS = Annotated[NotNegative, key("start of the fault, time of the flight", "s", 30.0)]
ToS = Annotated[NotNegative, key("end of the fault, time of the flight", "s", 36.0)]


class DeviceFault(EffectiveFault):
    """A fault of devices in an interval of the flight."""

    devices: Annotated[
        tuple[Name, ...], key("names of devices; none: every device that can have the fault", NO_UNIT, ["altimeter"])
    ] = ()
    from_s: FromS
    to_s: ToS

    def includes_device(self, device: str) -> bool:
        """Is the device named, or no device at all?"""
        return not self.devices or device in self.devices


class QuantityFault(DeviceFault):
    """A fault of one field of one measurement; a value that is not measured stays None."""

    quantity: Annotated[
        str,
        key(
            'measurement and field, SI and radians; of a vector with the component: "imu_sample.gyro_b_2"',
            NO_UNIT,
            "radio_height.height_agl",
        ),
    ]
    name: Annotated[
        str | None, key("only the reading, surface or station of this name; none: all of them", NO_UNIT)
    ] = None

    @field_validator("quantity")
    @classmethod
    def _check_quantity(cls, text: str) -> str:
        parse(text)
        return text


class MessageFault(DeviceFault):
    """A fault of the bytes of a part of a device's messages."""

    share: Annotated[Share, key("part of the messages, drawn from the seed of the scenario", ONE)] = 1.0


class LinkFault(StrictModel):
    """A fault of CAN links in an interval of the flight."""

    links: Annotated[
        tuple[Name, ...], key("names of CAN links; none: every link that can have the fault", NO_UNIT, ["air_can"])
    ] = ()
    from_s: FromS
    to_s: ToS
