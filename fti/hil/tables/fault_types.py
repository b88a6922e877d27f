"""Every fault of a scenario: the enum of kinds, and one table class per kind.

Order: faults of the world, of measured values, of the device's clock, of its bytes, of its line, of its power.
The flags that each must raise are in ``fti.hil.oracle``.  ``fti hil --faults`` and
docs/faults.md print these classes: the docstring says what the fault is, every key has a description and a unit.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

from fti.config import Positive, StrictModel
from fti.config.keys import NO_UNIT, ONE, key
from fti.hil.tables.fault_base import (
    UNIT_OF_QUANTITY,
    DeviceFault,
    EffectiveFault,
    FromS,
    LinkFault,
    MessageFault,
    NotNegative,
    QuantityFault,
    Share,
    ToS,
)

ShiftM = Annotated[float, Field(ge=-1000, le=1000)]
ArmM = Annotated[float, Field(ge=-100, le=100)]
RampMps = Annotated[float, Field(ge=-1000, le=1000)]
TurnDeg = Annotated[float, Field(ge=-180, le=180)]
TiltDeg = Annotated[float, Field(ge=-45, le=45)]
AxisValue = Annotated[float, Field(ge=-1e6, le=1e6)]
Axes = tuple[AxisValue, AxisValue, AxisValue]


class FaultKind(StrEnum):
    """Kinds of faults; the value is ``kind`` in a scenario and in a profile."""

    OBSTACLE = "obstacle"
    OFF_TRACK = "off_track"
    TERRAIN_SHIFT = "terrain_shift"
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
    GNSS_RAMP = "gnss_ramp"
    SWAPPED_COORDINATES = "swapped_coordinates"
    UNDULATION = "undulation"
    LEVER_ARM = "lever_arm"
    MOUNTING = "mounting"
    ATTITUDE_OFFSET = "attitude_offset"
    INERTIAL_BIAS = "inertial_bias"
    LATENCY = "latency"
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
    SCALE = "scale"
    FORCED = "forced"
    BURST = "burst"
    BABBLING = "babbling"
    BUS_OFF = "bus_off"
    CAN_STATUS = "can_status"
    BREAKER = "breaker"
    BROWN_OUT = "brown_out"


# ------------------------------------------------------------------------------------------------- of the world


class Obstacle(StrictModel):
    """A box on the ground that the reference does not know, there for the whole flight."""

    kind: Literal["obstacle"]
    before_threshold_m: Annotated[float, key("distance of its centre before the runway threshold", "m", 1500.0)]
    right_m: Annotated[float, key("distance of its centre right of the track, negative: left", "m")] = 0.0
    height_m: Annotated[Positive, key("height above the ground", "m", 60.0)]
    length_m: Annotated[Positive, key("length along the track", "m")] = 40.0
    width_m: Annotated[Positive, key("width across the track", "m")] = 40.0


class OffTrack(StrictModel):
    """The aircraft flies beside the track of the approach; with from_s = 0 the flight begins there."""

    kind: Literal["off_track"]
    right_m: Annotated[
        float, Field(ge=-20_000, le=20_000), key("distance right of the track, negative: left", "m", 150.0)
    ]
    from_s: FromS
    to_s: ToS
    turn_s: Annotated[Positive, key("time in which it leaves the track, and in which it returns", "s")] = 20.0


class TerrainShift(EffectiveFault):
    """The elevation model of the unit under test is displaced or in another datum, for the whole flight.

    The ground below the aircraft is the elevation model, moved the other way. An approach reference that was made from
    the same elevation model is wrong with it.
    """

    kind: Literal["terrain_shift"]
    north_m: Annotated[ShiftM, key("displacement of the elevation model to the north", "m")] = 0.0
    east_m: Annotated[ShiftM, key("displacement of the elevation model to the east", "m")] = 0.0
    up_m: Annotated[ShiftM, key("displacement of the elevation model upwards", "m", 20.0)] = 0.0
    one_not_zero = ("north_m", "east_m", "up_m")


# ------------------------------------------------------------------------------------- of what a device measures


class Cut(DeviceFault):
    """No message arrives, as with a broken cable; the device continues to count."""

    kind: Literal["cut"]


class Freeze(DeviceFault):
    """The last messages before the interval are repeated byte for byte, with their old times and counters.

    Where nothing was sent before, the first messages in the interval are repeated.  See also `stuck`: the same values
    with new times.
    """

    kind: Literal["freeze"]


class Stuck(DeviceFault):
    """The values of the first message in the interval are repeated, with new times.

    Navigation refuses a receiver whose position repeats although its stated velocity is not zero (reason `repeated`,
    alarm SOURCE ... REFUSED).  See also `freeze`: the same bytes with their old times.
    """

    kind: Literal["stuck"]


class Invalid(DeviceFault):
    """The device declares its measurements invalid."""

    kind: Literal["invalid"]
    flags: Annotated[
        tuple[str, ...],
        key(
            "conditions in the device status, by the driver's names; an unknown one is not sent", NO_UNIT, ["unlocked"]
        ),
    ] = ()


class Bias(QuantityFault):
    """A constant is added to a quantity."""

    kind: Literal["bias"]
    value: Annotated[float, key("added to the quantity", UNIT_OF_QUANTITY, 50.0)]


class Ramp(QuantityFault):
    """A growing error is added to a quantity, from zero at the start of the interval."""

    kind: Literal["ramp"]
    rate: Annotated[float, key("growth of the error", f"{UNIT_OF_QUANTITY}, per s", 20.0)]


class Noise(QuantityFault):
    """White noise is added to a quantity."""

    kind: Literal["noise"]
    sd: Annotated[Positive, key("standard deviation of the noise", UNIT_OF_QUANTITY, 40.0)]


class WrongUnit(QuantityFault):
    """A quantity is multiplied, as by a device that sends metres in a field for feet (0.3048)."""

    kind: Literal["wrong_unit"]
    factor: Annotated[float, key("multiplies the quantity", ONE, 0.3048)]


class Scale(QuantityFault):
    """The scale factor of a quantity is wrong: of the range of an altimeter, or of any other number."""

    kind: Literal["scale"]
    percent: Annotated[
        float, Field(ge=-50, le=100), key("error of the scale factor, positive: values are too large", "%", 20.0)
    ]


class Forced(QuantityFault):
    """A quantity has a constant value in place of the measured one: the set point of a profile."""

    kind: Literal["forced"]
    value: Annotated[float, key("value of the quantity", UNIT_OF_QUANTITY, 75.0)]


class Fog(DeviceFault):
    """Fog or cloud below the aircraft: a laser altimeter reports no return from beyond the visibility.

    With echo_m it takes the fog for the ground and declares the range valid.  A flight test found 75 m and 5 m
    (Spiegel 2018, section 7.5.1.3).
    """

    kind: Literal["fog"]
    visibility_m: Annotated[Positive, key("distance up to which the laser sees", "m", 40.0)]
    echo_m: Annotated[
        tuple[Positive, Positive] | None,
        key("false range at the start and at the end of the interval; none: no return", "m"),
    ] = None


class GnssOutage(DeviceFault):
    """No satellite is received, as with jamming or in a tunnel; the receiver declares its position invalid."""

    kind: Literal["gnss_outage"]


class GnssDegraded(DeviceFault):
    """The position is less accurate, and the receiver states the standard deviations (Spiegel 2018, table 7.4)."""

    kind: Literal["gnss_degraded"]
    horizontal_m: Annotated[Positive, key("standard deviation of the horizontal position", "m", 6.0)]
    vertical_m: Annotated[Positive, key("standard deviation of the height", "m", 8.0)]


class GnssOffset(DeviceFault):
    """The position is shifted and declared valid, as with spoofing."""

    kind: Literal["gnss_offset"]
    north_m: Annotated[float, key("shift to the north", "m")] = 0.0
    east_m: Annotated[float, key("shift to the east", "m")] = 0.0
    up_m: Annotated[float, key("shift upwards", "m", 60.0)] = 0.0
    over_s: Annotated[NotNegative, key("time in which the shift grows to its full size; 0: a jump", "s")] = 0.0


class GnssRamp(DeviceFault):
    """The position moves away from the true one at a constant rate and is declared valid.

    With the velocity it is a slow spoofing, consistent with itself; without, the velocity remains true. At to_s the
    position is the true one again.
    """

    kind: Literal["gnss_ramp"]
    north_mps: Annotated[RampMps, key("rate to the north", "m/s", 1.0)] = 0.0
    east_mps: Annotated[RampMps, key("rate to the east", "m/s")] = 0.0
    up_mps: Annotated[RampMps, key("rate upwards", "m/s")] = 0.0
    onset_mps2: Annotated[
        NotNegative, key("acceleration from rest to the rate; 0: the full rate at once", "m/s^2", 0.1)
    ] = 0.0
    with_velocity: Annotated[bool, key("the stated velocity contains the rate", NO_UNIT)] = True
    one_not_zero = ("north_mps", "east_mps", "up_mps")


class SwappedCoordinates(DeviceFault):
    """The position has latitude and longitude exchanged and is declared valid."""

    kind: Literal["swapped_coordinates"]


class Undulation(DeviceFault):
    """The height of the geoid is missing in the heights of a position, which is declared valid.

    "zero": the height above mean sea level is right, the stated undulation is 0, and the height above the ellipsoid is
    the sum of both. "msl_as_ellipsoid": the height above mean sea level is in the field of the height above the
    ellipsoid, everything else is right.
    """

    kind: Literal["undulation"]
    stated: Annotated[Literal["zero", "msl_as_ellipsoid"], key("0, or MSL height as ellipsoid height", NO_UNIT)] = (
        "zero"
    )


class LeverArm(DeviceFault):
    """The device is mounted elsewhere than the configuration states, and measures everything at its true place."""

    kind: Literal["lever_arm"]
    forward_m: Annotated[ArmM, key("true place ahead of the configured one", "m", 5.0)] = 0.0
    right_m: Annotated[ArmM, key("true place right of the configured one", "m")] = 0.0
    down_m: Annotated[ArmM, key("true place below the configured one", "m")] = 0.0
    one_not_zero = ("forward_m", "right_m", "down_m")


class Mounting(DeviceFault):
    """The device is turned against the mounting that the configuration states, and measures in its true directions.

    The true attitude of the device in the aircraft is the configured one (`rpy_bs_deg`), turned about the axes of the
    aircraft: first by roll, then by pitch, then by yaw.
    """

    kind: Literal["mounting"]
    roll_deg: Annotated[TurnDeg, key("turn about the forward axis, positive: right side down", "deg")] = 0.0
    pitch_deg: Annotated[TiltDeg, key("turn about the axis to the right, positive: front up", "deg")] = 0.0
    yaw_deg: Annotated[TurnDeg, key("turn about the downward axis, positive: front to the right", "deg", 1.0)] = 0.0
    one_not_zero = ("roll_deg", "pitch_deg", "yaw_deg")


class AttitudeOffset(DeviceFault):
    """Angles of the attitude are wrong by constants; a magnetic heading is wrong with the heading."""

    kind: Literal["attitude_offset"]
    roll_deg: Annotated[TurnDeg, key("added to the roll angle, positive: right wing down", "deg")] = 0.0
    pitch_deg: Annotated[TiltDeg, key("added to the pitch angle, positive: nose up", "deg")] = 0.0
    heading_deg: Annotated[TurnDeg, key("added to the heading, positive: clockwise", "deg", 10.0)] = 0.0
    one_not_zero = ("roll_deg", "pitch_deg", "heading_deg")


class InertialBias(DeviceFault):
    """The biases of gyros and accelerometers step, in the axes of the device.

    What an inertial navigation system computes on its own drifts with them; while satellites aid it, its position,
    velocity and attitude remain as they are.
    """

    kind: Literal["inertial_bias"]
    gyro_degph: Annotated[Axes, key("step of the gyro biases x, y, z", "deg/h", [0.0, 0.0, 50.0])] = (0.0, 0.0, 0.0)
    accel_mg: Annotated[
        Axes, key("step of the accelerometer biases x, y, z; 1 mg is 0.00980665 m/s^2", "mg", [0.0, 0.0, 5.0])
    ] = (0.0, 0.0, 0.0)
    one_not_zero = ("gyro_degph", "accel_mg")


class Latency(DeviceFault):
    """The values are those of an earlier moment, with new times.

    Of each kind of measurement the newest one is sent that is at least so old; before there is one, the oldest. A scan
    is measured exactly that much earlier than its times state.
    """

    kind: Literal["latency"]
    by_s: Annotated[float, Field(gt=0, le=60), key("age of the values", "s", 1.0)]


# --------------------------------------------------------------------------------------------- of a device's clock


class ClockJump(DeviceFault):
    """The clock of the device is wrong by a constant in the interval."""

    kind: Literal["clock_jump"]
    by_s: Annotated[float, Field(ge=-1e8, le=1e8), key("error of the clock, positive: fast", "s", 3.0)]


class ClockDrift(DeviceFault):
    """The clock of the device runs fast or slow in the interval; the error at the end remains."""

    kind: Literal["clock_drift"]
    ppm: Annotated[float, Field(ge=-1e6, le=1e6), key("rate error of the clock, positive: fast", "ppm", 200.0)]


# ------------------------------------------------------------------------------------------------ of its bytes


class BitErrors(DeviceFault):
    """Every bit is wrong with the same probability.

    On CAN only bits of the data are: a controller rejects a frame with a wrong CRC, so the fault is that of a node
    which sends wrong data with a correct CRC.
    """

    kind: Literal["bit_errors"]
    rate: Annotated[Share, key("probability of a bit to be wrong", ONE, 0.005)]


class LostHeader(MessageFault):
    """The first bytes of a message are missing."""

    kind: Literal["lost_header"]
    count: Annotated[int, Field(ge=1), key("number of missing bytes", ONE)] = 1


class Truncated(MessageFault):
    """The last bytes of a message are missing; of a CAN frame those of its data."""

    kind: Literal["truncated"]
    count: Annotated[int, Field(ge=1), key("number of missing bytes", ONE)] = 1


class Duplicated(MessageFault):
    """A message is sent twice."""

    kind: Literal["duplicated"]


class Reordered(MessageFault):
    """A message is sent after the one that follows it; at to_s at the latest."""

    kind: Literal["reordered"]


class WrongChecksum(MessageFault):
    """The checksum of a message is wrong, everything else is right."""

    kind: Literal["wrong_checksum"]


class WrongLabel(MessageFault):
    """The identifier of a message (label, number, formatter, CAN identifier) is unknown; the checksum is right."""

    kind: Literal["wrong_label"]


class Burst(DeviceFault):
    """Messages are held back and then sent all at once, again and again; the last ones at to_s."""

    kind: Literal["burst"]
    hold_s: Annotated[Positive, key("time for which messages are held back", "s", 1.5)]


# ------------------------------------------------------------------------------------------------ of its line


class Babbling(LinkFault):
    """An additional node sends frames on the bus."""

    kind: Literal["babbling"]
    can_id: Annotated[int, Field(ge=0, lt=2**29), key("CAN identifier of the frames", NO_UNIT)] = 0
    rate_hz: Annotated[Positive, key("frames per second", "Hz")] = 2000.0


class BusOff(LinkFault):
    """The bus is off: no frame of any device on it arrives, and slcan adapters report it when asked."""

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


class CanStatus(LinkFault):
    """The controllers of slcan adapters have errors, which the adapters report when asked."""

    kind: Literal["can_status"]
    flags: Annotated[
        tuple[StatusFlag, ...], Field(min_length=1), key("errors of the controller", NO_UNIT, ["bus_error"])
    ]


# ------------------------------------------------------------------------------------------------ of its power


class Breaker(DeviceFault):
    """The breakers of devices trip and are closed again at to_s; the devices then start again after their boot_s."""

    kind: Literal["breaker"]


class BrownOut(DeviceFault):
    """The supply voltage drops from 28 V: devices that need more stop, and start again when it is back."""

    kind: Literal["brown_out"]
    supply_v: Annotated[float, Field(ge=0, lt=28), key("supply voltage in the interval", "V", 12.0)] = 12.0


WorldFault = Obstacle | OffTrack | TerrainShift
#: Faults of the world that last for the whole flight.
WholeFlightFault = Obstacle | TerrainShift
ValueFault = (
    Stuck | Invalid | Bias | Ramp | Noise | WrongUnit | Scale | Forced | Fog | GnssOutage | GnssDegraded | GnssOffset
    | GnssRamp | SwappedCoordinates | Undulation | LeverArm | Mounting | AttitudeOffset | InertialBias | Latency
)  # fmt: skip
ClockFault = ClockJump | ClockDrift
ByteFault = (
    Cut | Freeze | BitErrors | LostHeader | Truncated | Duplicated | Reordered | WrongChecksum | WrongLabel | Burst
)  # fmt: skip
AnyLinkFault = Babbling | BusOff | CanStatus
PowerFault = Breaker | BrownOut

Fault = Annotated[
    WorldFault | ValueFault | ClockFault | ByteFault | AnyLinkFault | PowerFault, Field(discriminator="kind")
]
