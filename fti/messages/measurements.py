"""Decoded measurements of devices: frozen, without numpy."""

from __future__ import annotations

from enum import StrEnum

from fti.messages.tables import Arrays, Message
from fti.messages.units import (
    Count,
    Cycles,
    Ddm,
    DecibelHertz,
    Hertz,
    InStatedUnit,
    Kelvins,
    Metres,
    MetresPerSecond,
    MetresPerSecond2,
    Nanoseconds,
    Pascals,
    Radians,
    RadiansPerSecond,
    Ratio,
    RootMetres,
    Seconds,
    SecondsPerSecond,
    SecondsPerSecond2,
    Teslas,
)


class TimeScale(StrEnum):
    """Scale of a device's own time."""

    GPS = "gps"  # ns since 1980-01-06, no leap seconds
    UTC = "utc"  # ns since 1970-01-01
    BOOT = "boot"  # ns since the device was switched on


class Stamp(Message):
    """Times of a message: arrival, device time and time of validity [ns].

    t_valid_ns is None until the navigation process sets it.
    """

    t_rx_ns: Nanoseconds
    t_dev_ns: Nanoseconds | None = None
    time_scale: TimeScale | None = None
    t_valid_ns: Nanoseconds | None = None


class Attitude(Message, kw_only=True):
    """Orientation of the body [rad]; a message may carry only a part of it."""

    stamp: Stamp
    roll: Radians | None = None
    pitch: Radians | None = None
    heading: Radians | None = None
    roll_sd: Radians | None = None
    pitch_sd: Radians | None = None
    heading_sd: Radians | None = None
    valid: bool = True


class Position(Message, kw_only=True):
    """Position: lat, lon [rad], alt above WGS84 [m], alt_msl [m] and the undulation [m] of the same message.

    horizontal_sd : one sigma of each horizontal axis [m].  Of two that differ the root mean square, of an inertial
                    system the larger one; a horizontal accuracy that the device states is used unchanged
    """

    stamp: Stamp
    lat: Radians | None = None
    lon: Radians | None = None
    alt: Metres | None = None
    alt_msl: Metres | None = None
    undulation: Metres | None = None
    horizontal_sd: Metres | None = None
    vertical_sd: Metres | None = None
    valid: bool = True


class Velocity(Message, kw_only=True):
    """Velocity north, east, down [m/s], or ground speed [m/s] and track [rad]; a message may carry only a part."""

    stamp: Stamp
    north: MetresPerSecond | None = None
    east: MetresPerSecond | None = None
    down: MetresPerSecond | None = None
    ground_speed: MetresPerSecond | None = None
    track: Radians | None = None
    sd: MetresPerSecond | None = None
    valid: bool = True


class ImuSample(Message, kw_only=True):
    """Specific force accel_b [m/s^2] and angular rate gyro_b [rad/s], forward, right, down."""

    stamp: Stamp
    accel_b: tuple[MetresPerSecond2, MetresPerSecond2, MetresPerSecond2] | None = None
    gyro_b: tuple[RadiansPerSecond, RadiansPerSecond, RadiansPerSecond] | None = None


class Range(Message, kw_only=True):
    """Slant range along the beam [m] of a laser; None without a return."""

    stamp: Stamp
    slant_range: Metres | None
    sd: Metres | None = None
    valid: bool = True


class BeamRange(Message, kw_only=True):
    """Slant range along one beam of a multi-beam altimeter [m]; None without a return.

    beam          : name of the beam; all beams that are measured together have the same stamp
    along, across : angles of the beam [rad] along the sensor (forward positive) and across it (right positive): it
                    looks along (tan along, tan across, 1)
    """

    stamp: Stamp
    beam: str
    along: Radians
    across: Radians
    slant_range: Metres | None
    valid: bool = True


class PointArrays(Arrays, kw_only=True):
    """The n points of a scan, little-endian; ``fti.ranging.scan_points`` makes arrays of them.

    ranges      : float32 (n,)    slant range [m]; NaN without a return
    directions  : float32 (n, 3)  unit vectors from the sensor, in its frame
    offsets     : float32 (n,)    time of a point after that of the message [s]
    intensities : uint8 (n,)      strength of the return as the device states it; empty if it states none
    """

    ranges: bytes = b""
    directions: bytes = b""
    offsets: bytes = b""
    intensities: bytes = b""

    def __repr__(self) -> str:
        """The number of points: in a message of an error their bytes would hide everything else."""
        return f"PointArrays({len(self.offsets) // 4} points)"


class RangeScan(Message, kw_only=True):
    """Ranges along many directions, measured one after the other or at once: a line, an image, or a part of a turn.

    points, returns : number of directions, and of those with a range
    nearest, median : smallest range, and the median of the ranges [m]; None without a return
    arrays          : the points; they are not recorded, because the raw file has their bytes
    """

    stamp: Stamp
    points: Count
    returns: Count
    nearest: Metres | None
    median: Metres | None
    valid: bool = True
    arrays: PointArrays = PointArrays()


class RadioHeight(Message, kw_only=True):
    """Height above ground at the antenna [m], as a radar altimeter reports it (leading edge)."""

    stamp: Stamp
    height_agl: Metres | None
    sd: Metres | None = None
    valid: bool = True


class StaticPressure(Message, kw_only=True):
    """Static pressure [Pa]."""

    stamp: Stamp
    p_static: Pascals
    sd: Pascals | None = None
    valid: bool = True


class ImpactPressure(Message, kw_only=True):
    """Impact pressure q_c = total - static [Pa]."""

    stamp: Stamp
    q_c: Pascals
    sd: Pascals | None = None
    valid: bool = True


class Airspeed(Message, kw_only=True):
    """Calibrated (cas), indicated (ias) and true (tas) airspeed [m/s]; a message may carry only a part."""

    stamp: Stamp
    cas: MetresPerSecond | None = None
    ias: MetresPerSecond | None = None
    tas: MetresPerSecond | None = None
    valid: bool = True


class Temperature(Message, kw_only=True):
    """Air temperature [K]."""

    stamp: Stamp
    static: Kelvins | None = None
    total: Kelvins | None = None
    valid: bool = True


class FlowAngles(Message, kw_only=True):
    """Angle of attack (aoa, positive nose above the flow) and of sideslip (aos, wind from the right) [rad]."""

    stamp: Stamp
    aoa: Radians | None = None
    aos: Radians | None = None
    valid: bool = True


class PressureAltitude(Message, kw_only=True):
    """Altitude from static pressure [m]; ``setting_pa`` 101325 is the standard setting, None is unknown."""

    stamp: Stamp
    alt_press: Metres
    setting_pa: Pascals | None = None
    valid: bool = True


class MagneticField(Message, kw_only=True):
    """Magnetic flux density in the body frame [T]."""

    stamp: Stamp
    field_b: tuple[Teslas, Teslas, Teslas]
    valid: bool = True


class SurfaceDeflection(Message, kw_only=True):
    """Deflection of a control surface [rad] and its raw count."""

    stamp: Stamp
    surface: str
    deflection: Radians | None
    raw: Count | None = None
    valid: bool = True


class CalibrationPoint(Message, kw_only=True):
    """One point of a calibration table: raw count and deflection [rad]."""

    raw: Count
    deflection: Radians


class Calibration(Message, kw_only=True):
    """The calibration table of a deflection pickup from now on, piecewise linear between its points.

    points : ascending in raw, deflections strictly monotone; change : description of the change
    """

    stamp: Stamp
    surface: str
    points: tuple[CalibrationPoint, ...]
    change: str


class DmeRange(Message, kw_only=True):
    """Slant range to a DME station [m]."""

    stamp: Stamp
    station: str
    slant_range: Metres | None
    valid: bool = True


class Satellite(Message, kw_only=True):
    """One satellite: azimuth and elevation [rad], carrier-to-noise density [dB-Hz]."""

    system: str
    number: Count
    azimuth: Radians | None = None
    elevation: Radians | None = None
    cn0_dbhz: DecibelHertz | None = None
    used: bool | None = None


class Satellites(Message, kw_only=True):
    """The satellites of one epoch and the dilution of precision that the receiver states."""

    stamp: Stamp
    satellites: tuple[Satellite, ...] = ()
    used: Count | None = None
    hdop: Ratio | None = None
    vdop: Ratio | None = None
    pdop: Ratio | None = None


class Pseudorange(Message, kw_only=True):
    """Observations of one signal of one satellite.

    pseudorange, pseudorange_sd [m]; carrier_phase, carrier_phase_sd [cycles]; doppler [Hz], positive when approaching;
    cn0_dbhz [dB-Hz]; lock_time [s]: duration of carrier tracking without a cycle slip; carrier_hz [Hz]: nominal
    carrier frequency, if the message identifies it
    """

    system: str
    number: Count
    signal: str
    pseudorange: Metres | None = None
    pseudorange_sd: Metres | None = None
    carrier_phase: Cycles | None = None
    carrier_phase_sd: Cycles | None = None
    doppler: Hertz | None = None
    cn0_dbhz: DecibelHertz | None = None
    lock_time: Seconds | None = None
    carrier_hz: Hertz | None = None


class Pseudoranges(Message, kw_only=True):
    """Raw observations of one epoch of a GNSS receiver; the stamp holds the time of the epoch."""

    stamp: Stamp
    observations: tuple[Pseudorange, ...] = ()


class Ephemeris(Message, kw_only=True):
    """Broadcast orbit and clock of a GPS satellite: IS-GPS-200, tables 20-I and 20-III.

    week : week of transmission, modulo 1024;  issue : IODE
    toc, toe : reference times of clock and orbit [s of the week];  af0 [s], af1 [s/s], af2 [s/s^2];  tgd [s]
    sqrt_a [m^0.5], e [1];  m0, omega0, i0, omega [rad];  delta_n, omega_dot, idot [rad/s]
    cuc, cus, cic, cis [rad];  crc, crs [m]
    accuracy : upper bound of the stated accuracy [m]; None if it predicts none
    healthy  : neither its health nor its alert flag is set
    """

    stamp: Stamp
    system: str
    number: Count
    week: Count
    issue: Count
    toc: Seconds
    af0: Seconds
    af1: SecondsPerSecond
    af2: SecondsPerSecond2
    tgd: Seconds
    toe: Seconds
    sqrt_a: RootMetres
    e: Ratio
    m0: Radians
    delta_n: RadiansPerSecond
    omega0: Radians
    omega_dot: RadiansPerSecond
    i0: Radians
    idot: RadiansPerSecond
    omega: Radians
    cuc: Radians
    cus: Radians
    cic: Radians
    cis: Radians
    crc: Metres
    crs: Metres
    accuracy: Metres | None
    healthy: bool


class ReceiverClock(Message, kw_only=True):
    """Clock of a GNSS receiver: receiver time minus the time of the scale [s], its rate [s/s], and their sigma."""

    stamp: Stamp
    offset: Seconds | None = None
    drift: SecondsPerSecond | None = None
    offset_sd: Seconds | None = None
    drift_sd: SecondsPerSecond | None = None
    valid: bool = True


class Deviation(Message, kw_only=True):
    """Approach deviation as a receiver states it [DDM]: localizer (fly right positive), glide slope (fly down)."""

    stamp: Stamp
    localizer_ddm: Ddm | None = None
    glide_slope_ddm: Ddm | None = None
    valid: bool = True


class Reading(Message, kw_only=True):
    """A value without a class of its own, named by the configuration or the document of the device.

    value : in ``unit``, which is SI or that of the document ("" for a count or a discrete: 0 or 1)
    text  : name of the value in the document, or a value of characters; "" for none
    """

    stamp: Stamp
    name: str
    value: InStatedUnit | None
    unit: str = ""
    valid: bool = True
    text: str = ""


class DeviceStatus(Message, kw_only=True):
    """Status of a device; ``flags`` are the names of the conditions that it reports."""

    stamp: Stamp
    ok: bool
    flags: tuple[str, ...] = ()


class DeviceTime(Message, kw_only=True):
    """Device time of a message that carries only the time; the stamp holds it."""

    stamp: Stamp


class Ack(Message, kw_only=True):
    """A device's answer to a command.

    command : its name in the driver's ``COMMANDS``; "" if the answer does not identify it (then the oldest one)
    """

    stamp: Stamp
    command: str
    accepted: bool
    detail: str = ""


Measurement = (
    Attitude
    | Position
    | Velocity
    | ImuSample
    | Range
    | BeamRange
    | RangeScan
    | RadioHeight
    | StaticPressure
    | ImpactPressure
    | Airspeed
    | Temperature
    | FlowAngles
    | PressureAltitude
    | MagneticField
    | SurfaceDeflection
    | Calibration
    | DmeRange
    | Satellites
    | Pseudoranges
    | Ephemeris
    | ReceiverClock
    | Deviation
    | Reading
    | DeviceStatus
    | DeviceTime
    | Ack
)
