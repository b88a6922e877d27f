"""Every fault that a scenario can have: one enum, one table of the file each.

Where a fault acts is the order of this page: on the world, on what a device measures, on its clock, on its bytes, on
its line, on its power.  What the daemon must say of each is in ``fti.hil.expected.flags``.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

from fti.config import Positive, StrictModel
from fti.hil.tables.bases import NotNegative, OnDevices, OnLinks, OnMessages, OnQuantity, Share


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
    FORCED = "forced"
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
    right_m: Annotated[float, Field(ge=-20_000, le=20_000)]
    from_s: NotNegative
    to_s: NotNegative
    turn_s: Positive = 20.0


# ------------------------------------------------------------------------------------- of what a device measures


class Cut(OnDevices):
    """Nothing comes: a broken cable.  The device does not know, and goes on counting."""

    kind: Literal["cut"]


class Freeze(OnDevices):
    """The last messages before the interval are sent again and again, byte for byte, also their times and counters.

    Where nothing was sent before, the first messages in the interval are.
    """

    kind: Literal["freeze"]


class Stuck(OnDevices):
    """The values of the first message in the interval are repeated, with fresh times."""

    kind: Literal["stuck"]


class Invalid(OnDevices):
    """The device says that it does not measure; ``flags`` : conditions that it names, as the driver spells them."""

    kind: Literal["invalid"]
    flags: tuple[str, ...] = ()


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


class Forced(OnQuantity):
    """The field says ``value``, whatever is measured: the set point of a profile."""

    kind: Literal["forced"]
    value: float


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
    """The clock of the device is off by ``by_s`` in the interval.  Where no time is sent: ``fti.hil.faults.places``."""

    kind: Literal["clock_jump"]
    by_s: Annotated[float, Field(ge=-1e8, le=1e8)]


class ClockDrift(OnDevices):
    """The clock of the device runs fast by ``ppm`` in the interval; what it has gained stays."""

    kind: Literal["clock_drift"]
    ppm: Annotated[float, Field(ge=-1e6, le=1e6)]


# ------------------------------------------------------------------------------------------------ of its bytes


class BitErrors(OnDevices):
    """Every bit is wrong with this probability.  On CAN the data alone: a controller refuses what its CRC refuses, so
    the fault is of a node that sends wrong data with a good CRC."""

    kind: Literal["bit_errors"]
    rate: Share


class LostHeader(OnMessages):
    """The first ``count`` bytes are missing.  Not on CAN, where a frame has its header or is none."""

    kind: Literal["lost_header"]
    count: Annotated[int, Field(ge=1)] = 1


class Truncated(OnMessages):
    """The last ``count`` bytes are missing; of a CAN frame those of its data."""

    kind: Literal["truncated"]
    count: Annotated[int, Field(ge=1)] = 1


class Duplicated(OnMessages):
    """The message is sent twice."""

    kind: Literal["duplicated"]


class Reordered(OnMessages):
    """The message leaves after the one behind it, which is not held itself; at ``to_s`` at the latest."""

    kind: Literal["reordered"]


class WrongChecksum(OnMessages):
    """The checksum is wrong, everything else right.  Which drivers have one: ``fti.hil.faults.places``."""

    kind: Literal["wrong_checksum"]


class WrongLabel(OnMessages):
    """The identifier (label, number, formatter, CAN identifier) is one that nobody knows; the checksum holds."""

    kind: Literal["wrong_label"]


class Burst(OnDevices):
    """Messages are held back for ``hold_s`` and then leave all at once, again and again; the last at ``to_s``."""

    kind: Literal["burst"]
    hold_s: Positive


# ------------------------------------------------------------------------------------------------ of its line


class Babbling(OnLinks):
    """A node sends frames of identifier ``can_id`` as fast as ``rate_hz``."""

    kind: Literal["babbling"]
    can_id: Annotated[int, Field(ge=0, lt=2**29)] = 0
    rate_hz: Positive = 2000.0


class BusOff(OnLinks):
    """The bus is off: no frame of any device on it comes, and slcan adapters say when asked that it is in trouble."""

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
    Stuck | Invalid | Bias | Ramp | Noise | WrongUnit | Forced | Fog | GnssOutage | GnssDegraded | GnssOffset
)  # fmt: skip
OfClock = ClockJump | ClockDrift
OfBytes = (
    Cut | Freeze | BitErrors | LostHeader | Truncated | Duplicated | Reordered | WrongChecksum | WrongLabel | Burst
)  # fmt: skip
OfLinks = Babbling | BusOff | CanStatus
OfPower = Breaker | BrownOut

Fault = Annotated[OfWorld | OfValues | OfClock | OfBytes | OfLinks | OfPower, Field(discriminator="kind")]
