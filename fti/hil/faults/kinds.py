"""Every fault that a scenario can have: one enum, one table of the file each.

Where a fault acts is the order of this page: on the world, on what a device measures, on its clock, on its bytes, on
its line, on its power.  What the daemon must say of each is in ``fti.hil.faults.flags``.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

from fti.config import Name, Positive, StrictModel

NotNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(gt=0, le=1)]


class FaultKind(StrEnum):
    """What can go wrong; the value is ``kind`` in a scenario and in a profile."""

    OBSTACLE = "obstacle"
    OFF_TRACK = "off_track"
    CUT = "cut"
    FREEZE = "freeze"
    STUCK = "stuck"
    INVALID = "invalid"
    BIAS = "bias"
    RAMP = "ramp"
    NOISE = "noise"
    FOG = "fog"
    GNSS_OUTAGE = "gnss_outage"
    GNSS_DEGRADED = "gnss_degraded"
    GNSS_OFFSET = "gnss_offset"
    CLOCK_JUMP = "clock_jump"
    CLOCK_DRIFT = "clock_drift"
    BIT_ERRORS = "bit_errors"
    LOST_HEADER = "lost_header"
    TRUNCATED = "truncated"
    DUPLICATED = "duplicated"
    REORDERED = "reordered"
    WRONG_CHECKSUM = "wrong_checksum"
    WRONG_LABEL = "wrong_label"
    WRONG_UNIT = "wrong_unit"
    BURST = "burst"
    BABBLING = "babbling"
    BUS_OFF = "bus_off"
    CAN_STATUS = "can_status"
    BREAKER = "breaker"
    BROWN_OUT = "brown_out"


# ------------------------------------------------------------------------------------------------- of the world


class Obstacle(StrictModel):
    """A box on the ground that the reference does not know."""

    kind: Literal["obstacle"]
    before_threshold_m: float
    right_m: float = 0.0
    height_m: Positive
    length_m: Positive = 40.0
    width_m: Positive = 40.0


class OffTrack(StrictModel):
    """A side step: away by ``right_m`` (negative: left) until ``to_s``; from_s = 0 begins the flight there."""

    kind: Literal["off_track"]
    right_m: float
    from_s: NotNegative
    to_s: NotNegative
    turn_s: Positive = 20.0


# ------------------------------------------------------------------------------------- of what a device measures


class OnDevices(StrictModel):
    """A fault of devices in an interval of the flight; no device named means every device."""

    devices: tuple[Name, ...] = ()
    from_s: NotNegative
    to_s: NotNegative


class Cut(OnDevices):
    """Nothing comes: a broken cable, a device without power."""

    kind: Literal["cut"]


class Freeze(OnDevices):
    """The last messages before the interval are sent again and again, byte for byte, also their times and counters."""

    kind: Literal["freeze"]


class Stuck(OnDevices):
    """The values of the first message in the interval are repeated, with fresh times."""

    kind: Literal["stuck"]


class Invalid(OnDevices):
    """The device says that it does not measure; ``flags`` : conditions that it names, as the driver spells them."""

    kind: Literal["invalid"]
    flags: tuple[str, ...] = ()


class OnQuantity(OnDevices):
    """A fault of one field of one measurement, in SI and radians: ``quantity = "range.slant_range"``."""

    quantity: Annotated[str, Field(pattern=r"^[a-z_]+\.[a-z_0-9]+$")]


class Bias(OnQuantity):
    """A constant is added."""

    kind: Literal["bias"]
    value: float


class Ramp(OnQuantity):
    """What is added grows from zero by ``rate`` a second."""

    kind: Literal["ramp"]
    rate: float


class Noise(OnQuantity):
    """White noise of standard deviation ``sd`` is added."""

    kind: Literal["noise"]
    sd: Positive


class WrongUnit(OnQuantity):
    """The field is multiplied: 0.3048 is a device that says metres where feet are meant."""

    kind: Literal["wrong_unit"]
    factor: float


class Fog(OnDevices):
    """Fog or cloud below the aircraft: a laser sees no further than ``visibility_m``, and says that it has no return.

    echo_m : it takes the fog for the ground instead, and does not say so: from the first distance at the beginning of
             the interval to the second at its end.  A flight test found 75 m and 5 m (Spiegel 2018, section 7.5.1.3)
    """

    kind: Literal["fog"]
    visibility_m: Positive
    echo_m: tuple[Positive, Positive] | None = None


class GnssOutage(OnDevices):
    """No satellite is received: jamming, or a tunnel; the receiver says so."""

    kind: Literal["gnss_outage"]


class GnssDegraded(OnDevices):
    """The position has these standard deviations [m] and says so (Spiegel 2018, table 7.4)."""

    kind: Literal["gnss_degraded"]
    horizontal_m: Positive
    vertical_m: Positive


class GnssOffset(OnDevices):
    """The position is shifted, and does not say so: spoofing.  ``over_s`` : it is drawn away so slowly [s]."""

    kind: Literal["gnss_offset"]
    north_m: float = 0.0
    east_m: float = 0.0
    up_m: float = 0.0
    over_s: NotNegative = 0.0


# --------------------------------------------------------------------------------------------- of a device's clock


class ClockJump(OnDevices):
    """The clock of the device is off by ``by_s`` in the interval."""

    kind: Literal["clock_jump"]
    by_s: float


class ClockDrift(OnDevices):
    """The clock of the device runs fast by ``ppm`` in the interval; what it has gained stays."""

    kind: Literal["clock_drift"]
    ppm: float


# ------------------------------------------------------------------------------------------------ of its bytes


class OnMessages(OnDevices):
    """A fault of the bytes of this share of a device's messages, drawn from the scenario's seed."""

    share: Share = 1.0


class BitErrors(OnDevices):
    """Every bit is wrong with this probability."""

    kind: Literal["bit_errors"]
    rate: Share


class LostHeader(OnMessages):
    """The first ``count`` bytes are missing."""

    kind: Literal["lost_header"]
    count: Annotated[int, Field(ge=1)] = 1


class Truncated(OnMessages):
    """The last ``count`` bytes are missing."""

    kind: Literal["truncated"]
    count: Annotated[int, Field(ge=1)] = 1


class Duplicated(OnMessages):
    """The message is sent twice."""

    kind: Literal["duplicated"]


class Reordered(OnMessages):
    """The message leaves after the one behind it."""

    kind: Literal["reordered"]


class WrongChecksum(OnMessages):
    """The last byte that its driver calls a checksum is wrong; everything before it is right."""

    kind: Literal["wrong_checksum"]


class WrongLabel(OnMessages):
    """The identifier of the message (label, message number, talker, CAN identifier) is another one."""

    kind: Literal["wrong_label"]


class Burst(OnDevices):
    """Messages are held back for ``hold_s`` and then leave all at once, again and again."""

    kind: Literal["burst"]
    hold_s: Positive


# ------------------------------------------------------------------------------------------------ of its line


class OnLinks(StrictModel):
    """A fault of CAN links in an interval of the flight; no link named means every one that it can be on."""

    links: tuple[Name, ...] = ()
    from_s: NotNegative
    to_s: NotNegative


class Babbling(OnLinks):
    """A node sends frames of identifier ``can_id`` as fast as ``rate_hz``."""

    kind: Literal["babbling"]
    can_id: Annotated[int, Field(ge=0, lt=2**29)] = 0
    rate_hz: Positive = 2000.0


class BusOff(OnLinks):
    """The emulator's side of the bus is off: no frame of any of its devices comes."""

    kind: Literal["bus_off"]


StatusFlag = Literal[
    "rx_fifo_full",
    "tx_fifo_full",
    "error_warning",
    "data_overrun",
    "error_passive",
    "arbitration_lost",
    "bus_error",
]


class CanStatus(OnLinks):
    """The controllers of slcan adapters have trouble in an interval, and say so when asked; no link named: all."""

    kind: Literal["can_status"]
    flags: Annotated[tuple[StatusFlag, ...], Field(min_length=1)]


# ------------------------------------------------------------------------------------------------ of its power


class Breaker(OnDevices):
    """The breakers of devices trip, and are closed again at ``to_s``; the devices start anew after their boot time."""

    kind: Literal["breaker"]


class BrownOut(OnDevices):
    """The supply sags to ``supply_v``: devices that need more stop, and start anew when it is back (28 V)."""

    kind: Literal["brown_out"]
    supply_v: Annotated[float, Field(ge=0, lt=28)] = 12.0


OfWorld = Obstacle | OffTrack
OfValues = (
    Cut | Stuck | Invalid | Bias | Ramp | Noise | WrongUnit | Fog | GnssOutage | GnssDegraded | GnssOffset
)  # fmt: skip
OfClock = ClockJump | ClockDrift
OfBytes = Freeze | BitErrors | LostHeader | Truncated | Duplicated | Reordered | WrongChecksum | WrongLabel | Burst
OfLinks = Babbling | BusOff | CanStatus
OfPower = Breaker | BrownOut

Fault = Annotated[OfWorld | OfValues | OfClock | OfBytes | OfLinks | OfPower, Field(discriminator="kind")]
