"""The central types: frozen, without numpy.  Units, frames and names as in ``fti``."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

# --------------------------------------------------------------------------------------------------------- bytes


@dataclass(frozen=True, slots=True)
class RawFrame:
    """Exactly one read of a serial line, one datagram or one CAN frame.

    link    : name of the link
    seq     : position in the session, one counter for all links in order of arrival
    t_rx_ns : FTI time of arrival [ns]
    data    : the bytes; CAN as a little-endian ``can_frame`` (16 B) or ``canfd_frame`` (72 B)
    """

    link: str
    seq: int
    t_rx_ns: int
    data: bytes


#: Used instead of a device name when the operator readmits all sources.
ALL_SOURCES = "*"
TICK_LINK = "fti_tick"
#: The recorder adds a tick frame every 20 ms, so that timeouts are reproducible.
TICK_PERIOD_NS = 20_000_000


class LinkState(StrEnum):
    """State of a link; each state has a hint for the engineer at the connector."""

    ABSENT = "absent"
    DENIED = "denied"
    BUSY = "busy"
    SILENT = "silent"
    NOISE = "noise"
    INVALID = "invalid"
    WRONG_RATE = "wrong rate"
    OVERFLOW = "overflow"
    GOOD = "good"


# -------------------------------------------------------------------------------------------------- measurements


class TimeScale(StrEnum):
    """Scale of a device's own time."""

    GPS = "gps"  # ns since 1980-01-06, no leap seconds
    UTC = "utc"  # ns since 1970-01-01
    BOOT = "boot"  # ns since the device was switched on


@dataclass(frozen=True, slots=True)
class Stamp:
    """Times of a message: arrival, device time and time of validity [ns].

    t_valid_ns is None until the navigation process sets it.
    """

    t_rx_ns: int
    t_dev_ns: int | None = None
    time_scale: TimeScale | None = None
    t_valid_ns: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Attitude:
    """Orientation of the body [rad]; a message may carry only a part of it."""

    stamp: Stamp
    roll: float | None = None
    pitch: float | None = None
    heading: float | None = None
    roll_sd: float | None = None
    pitch_sd: float | None = None
    heading_sd: float | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """Position: lat, lon [rad], alt above WGS84 [m], alt_msl [m] and the undulation [m] of the same message.

    horizontal_sd : one sigma of each horizontal axis [m].  Of two that differ the root mean square, of an inertial
                    system the larger one; a horizontal accuracy that the device states is used unchanged
    """

    stamp: Stamp
    lat: float | None = None
    lon: float | None = None
    alt: float | None = None
    alt_msl: float | None = None
    undulation: float | None = None
    horizontal_sd: float | None = None
    vertical_sd: float | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Velocity:
    """Velocity north, east, down [m/s], or ground speed [m/s] and track [rad]; a message may carry only a part."""

    stamp: Stamp
    north: float | None = None
    east: float | None = None
    down: float | None = None
    ground_speed: float | None = None
    track: float | None = None
    sd: float | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuSample:
    """Specific force accel_b [m/s^2] and angular rate gyro_b [rad/s], forward, right, down."""

    stamp: Stamp
    accel_b: tuple[float, float, float] | None = None
    gyro_b: tuple[float, float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Range:
    """Slant range along the beam [m] of a laser; None without a return."""

    stamp: Stamp
    slant_range: float | None
    sd: float | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioHeight:
    """Height above ground at the antenna [m], as a radar altimeter reports it (leading edge)."""

    stamp: Stamp
    height_agl: float | None
    sd: float | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticPressure:
    """Static pressure [Pa]."""

    stamp: Stamp
    p_static: float
    sd: float | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpactPressure:
    """Impact pressure q_c = total - static [Pa]."""

    stamp: Stamp
    q_c: float
    sd: float | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Airspeed:
    """Calibrated (cas), indicated (ias) and true (tas) airspeed [m/s]; a message may carry only a part."""

    stamp: Stamp
    cas: float | None = None
    ias: float | None = None
    tas: float | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Temperature:
    """Air temperature [K]."""

    stamp: Stamp
    static: float | None = None
    total: float | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class FlowAngles:
    """Angle of attack (aoa, positive nose above the flow) and of sideslip (aos, wind from the right) [rad]."""

    stamp: Stamp
    aoa: float | None = None
    aos: float | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureAltitude:
    """Altitude from static pressure [m]; ``setting_pa`` 101325 is the standard setting, None is unknown."""

    stamp: Stamp
    alt_press: float
    setting_pa: float | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class MagneticField:
    """Magnetic flux density in the body frame [T]."""

    stamp: Stamp
    field_b: tuple[float, float, float]
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceDeflection:
    """Deflection of a control surface [rad] and its raw count."""

    stamp: Stamp
    surface: str
    deflection: float | None
    raw: int | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationPoint:
    """One point of a calibration table: raw count and deflection [rad]."""

    raw: int
    deflection: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """The calibration table of a deflection pickup from now on, piecewise linear between its points.

    points : ascending in raw, deflections strictly monotone; change : description of the change
    """

    stamp: Stamp
    surface: str
    points: tuple[CalibrationPoint, ...]
    change: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DmeRange:
    """Slant range to a DME station [m]."""

    stamp: Stamp
    station: str
    slant_range: float | None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Satellite:
    """One satellite: azimuth and elevation [rad], carrier-to-noise density [dB-Hz]."""

    system: str
    number: int
    azimuth: float | None = None
    elevation: float | None = None
    cn0_dbhz: float | None = None
    used: bool | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Satellites:
    """The satellites of one epoch and the dilution of precision that the receiver states."""

    stamp: Stamp
    satellites: tuple[Satellite, ...] = ()
    used: int | None = None
    hdop: float | None = None
    vdop: float | None = None
    pdop: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Pseudorange:
    """Observations of one signal of one satellite.

    pseudorange, pseudorange_sd [m]; carrier_phase, carrier_phase_sd [cycles]; doppler [Hz], positive when approaching;
    cn0_dbhz [dB-Hz]; lock_time [s]: duration of carrier tracking without a cycle slip; carrier_hz [Hz]: nominal
    carrier frequency, if the message identifies it
    """

    system: str
    number: int
    signal: str
    pseudorange: float | None = None
    pseudorange_sd: float | None = None
    carrier_phase: float | None = None
    carrier_phase_sd: float | None = None
    doppler: float | None = None
    cn0_dbhz: float | None = None
    lock_time: float | None = None
    carrier_hz: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Pseudoranges:
    """Raw observations of one epoch of a GNSS receiver; the stamp holds the time of the epoch."""

    stamp: Stamp
    observations: tuple[Pseudorange, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Ephemeris:
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
    number: int
    week: int
    issue: int
    toc: float
    af0: float
    af1: float
    af2: float
    tgd: float
    toe: float
    sqrt_a: float
    e: float
    m0: float
    delta_n: float
    omega0: float
    omega_dot: float
    i0: float
    idot: float
    omega: float
    cuc: float
    cus: float
    cic: float
    cis: float
    crc: float
    crs: float
    accuracy: float | None
    healthy: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceiverClock:
    """Clock of a GNSS receiver: receiver time minus the time of the scale [s], its rate [s/s], and their sigma."""

    stamp: Stamp
    offset: float | None = None
    drift: float | None = None
    offset_sd: float | None = None
    drift_sd: float | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """Approach deviation as a receiver states it [DDM]: localizer (fly right positive), glide slope (fly down)."""

    stamp: Stamp
    localizer_ddm: float | None = None
    glide_slope_ddm: float | None = None
    valid: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """A value without a class of its own, named by the configuration or the document of the device.

    value : in ``unit``, which is SI or that of the document ("" for a count or a discrete: 0 or 1)
    text  : name of the value in the document, or a value of characters; "" for none
    """

    stamp: Stamp
    name: str
    value: float | None
    unit: str = ""
    valid: bool = True
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceStatus:
    """Status of a device; ``flags`` are the names of the conditions that it reports."""

    stamp: Stamp
    ok: bool
    flags: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceTime:
    """Device time of a message that carries only the time; the stamp holds it."""

    stamp: Stamp


@dataclass(frozen=True, slots=True, kw_only=True)
class Ack:
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

# ------------------------------------------------------------------------------------------------------- outputs


class Reason(StrEnum):
    """Why a value is not valid, or why a monitor gives no result."""

    DEVICE_FLAG = "device_flag"  # the device reports it
    NO_RETURN = "no_return"  # the device has no measurement
    BELOW_RANGE = "below_range"
    ABOVE_RANGE = "above_range"
    ROLL = "roll"  # beyond the limit of the altimeter or the monitor
    PITCH = "pitch"
    STALE = "stale"  # older than max_age_ms
    SILENT = "silent"  # never received
    NO_ATTITUDE = "no_attitude"
    NO_POSITION = "no_position"
    NO_ALTITUDE = "no_altitude"  # a mean-sea-level height without the undulation
    NO_VELOCITY = "no_velocity"
    NO_ALTIMETER = "no_altimeter"
    NO_HEIGHT = "no_height"  # no altimeter is valid
    NO_PROFILE = "no_profile"
    WRONG_SENSOR = "wrong_sensor"  # the reference was made for another altimeter
    OUTSIDE_PROFILE = "outside_profile"
    OFF_TRACK = "off_track"
    GAPS = "gaps"
    NOT_INDEPENDENT = "not_independent"  # the altitude depends on the altimeter that it would check
    PROTECTION_LEVEL = "protection_level"  # of position or altitude, above the alert limit
    ATTITUDE_LEVEL = "attitude_level"  # the protection level of the attitude, above the alert limit
    ASSUMPTION = "assumption"  # navigation or altimeter is worse than the limits assume, or another one
    POSITION_UNCERTAIN = "position_uncertain"  # its sigma is too large for the terrain near the track
    END = "end"  # past the glide path intercept
    GO_AROUND = "go_around"
    NOT_OBSERVABLE = "position_not_observable"
    ABSOLUTE_MATCH = "absolute_match"  # T1
    SHIFTED = "shifted"  # T2
    HEIGHT_ERROR = "height_error"  # T3
    OBSTACLE = "obstacle"  # T4
    INTEGRITY = "integrity"  # the integrity monitor does not confirm the height
    BELOW_150_M = "below_150_m"  # too close for an angle; metres only
    FULL_SCALE = "full_scale"
    # comparison of an altimeter with the terrain, and why it is not possible
    DEVIATION = "deviation"  # measured minus predicted, beyond the gate
    NOT_NADIR = "not_nadir"  # measured minus navigated height, beyond the gate: not the height at the nadir
    DISPERSION = "dispersion"  # the rays of the predicted beam differ by too much
    INCIDENCE = "incidence"  # the beam grazes the ground
    # comparison of an altimeter with predicted changes and with another altimeter
    STUCK = "stuck"  # its value repeats exactly while the predicted one changes
    CHANGE_MISMATCH = "change_mismatch"  # its changes differ from the predicted ones: drift, scale
    ALTIMETERS_DISAGREE = "altimeters_disagree"  # of the one that the terrain does not confirm, else of both
    NO_PREDICTION = "no_prediction"  # the predicted beam meets no ground in range
    NO_TERRAIN = "no_terrain"  # none is configured, or it could not be loaded
    TERRAIN_LOADING = "terrain_loading"
    TERRAIN_EDGE = "terrain_edge"  # outside the files
    TERRAIN_HOLE = "terrain_hole"  # a void in the files
    GROUND_CONTRADICTED = "ground_contradicted"  # a radar and a laser agree with each other but not with it
    UNCERTAIN = "uncertain"  # of position, attitude or terrain: a deviation of twice the limit would pass
    # of the filters
    NO_IMU = "no_imu"
    NO_GNSS = "no_gnss"
    NO_BARO = "no_baro"
    NO_HEADING = "no_heading"
    ALIGNING = "aligning"
    COASTING = "coasting"  # nothing bounds the position at present
    REJECTED = "rejected"  # an aiding measurement is outside the gate
    EXCLUDED = "excluded"  # a source does not aid the filter: it contradicts the others
    CONTRADICTION = "contradiction"  # sources contradict each other; the wrong one is unknown
    REACQUIRED = "reacquired"  # tests between sources have run for less than their window
    NOTHING_TO_COMPARE = "nothing_to_compare"  # no other source gives this quantity
    RESET = "reset"  # the filter was reset
    DIVERGED = "diverged"
    NO_SATELLITES = "no_satellites"
    NO_DME = "no_dme"
    GEOMETRY = "geometry"  # satellites and stations do not fix a position
    # of the tests of one source
    REPEATED = "repeated"  # identical values although its velocity is not zero
    IMPOSSIBLE = "impossible"  # beyond the aircraft's limits
    JUMP = "jump"  # a step that its velocity does not explain
    DRIFT = "drift"  # position and integral of velocity diverge
    SCATTER = "scatter"  # scatter above its stated sigma
    UNDULATION = "undulation"  # the stated one differs from EGM96
    RANGES_DISAGREE = "ranges_disagree"  # its pseudoranges with each other; the wrong one is unknown
    RANGES_CONTRADICT = "ranges_contradict"  # its pseudoranges do not match its stated position
    DEVICE_TIME = "device_time"  # its time steps, stops or goes back
    ATTITUDES_DISAGREE = "attitudes_disagree"  # with the other attitude sources
    HEADING_TRACK = "heading_track"  # angle to the track larger than the wind can cause
    UNCONFIRMED = "unconfirmed"  # its tests pass again, but an earlier contradiction is not resolved


class Compensation(StrEnum):
    """Method that converts an altimeter's range to a height above the ground at the nadir."""

    ATTITUDE = "attitude"  # turned into the vertical
    RANGE = "range"  # with the terrain between footprint and nadir, along one ray
    BEAM = "beam"  # the same with the beam of the sensor


class FilterMode(StrEnum):
    """State of a navigation filter."""

    WAITING = "waiting"  # inputs are missing
    ALIGNING = "aligning"
    AIDED = "aided"
    COASTING = "coasting"  # inertial alone
    INVALID = "invalid"


class Datum(StrEnum):
    """Reference surface of a height."""

    ELLIPSOID = "ellipsoid"
    MSL = "msl"
    PRESSURE = "pressure"
    AGL = "agl"


class Point(StrEnum):
    """Point of the aircraft that a height refers to."""

    ANTENNA = "antenna"
    P = "p"
    WHEELS = "wheels"


class IntegrityState(StrEnum):
    """State of the ground-clearance integrity monitor."""

    NO_PROFILE = "no_profile"
    ACQUIRE = "acquire"
    MONITOR = "monitor"
    OK = "ok"
    CAUTION = "caution"
    ALERT = "alert"
    UNAVAILABLE = "unavailable"


@dataclass(frozen=True, slots=True, kw_only=True)
class HeightAboveGround:
    """Height above ground from one altimeter.

    t_ns       : time of the output [ns]; t_valid_ns : time of validity of the height [ns]
    raw        : value of the device, at its antenna along its beam [m]
    height_agl : height of ``point`` above the ground at the nadir [m]; sd : one sigma of its error [m]
    compensation : method.  Over known terrain (range, beam) with the terrain between nadir and footprint; otherwise
                 (attitude) it is ``nearest`` corrected for the configured bias and scale, and sd includes an assumed
                 relief
    nearest, nearest_sd : compensated for attitude, mounting and lever arm only, at ``point``: above the footprint [m];
                 one sigma without relief [m]
    predicted  : predicted value of the device over known terrain [m]
    predicted_sd : one sigma of raw - predicted [m]
    wheels     : height of the wheels from ``height_agl`` and the attitude [m]; None if their position is not configured
    unchecked  : why the terrain comparison was not possible, or less precise than the limits require; terrain errors of
                 the height are then not detected.  NOT_INDEPENDENT: the altitude of the comparison depends on this
                 altimeter, and a slow drift of it is not detected
    """

    t_ns: int
    t_valid_ns: int | None
    sensor: str
    raw: float | None
    height_agl: float | None
    sd: float | None
    valid: bool
    reasons: tuple[Reason, ...]
    datum: Datum = Datum.AGL
    point: Point = Point.P
    compensation: Compensation | None = None
    nearest: float | None = None
    nearest_sd: float | None = None
    predicted: float | None = None
    predicted_sd: float | None = None
    wheels: float | None = None
    unchecked: tuple[Reason, ...] = ()

    @property
    def is_by_terrain(self) -> bool:
        """Is ``height_agl`` compensated by known terrain?"""
        return self.compensation in {Compensation.RANGE, Compensation.BEAM}


@dataclass(frozen=True, slots=True, kw_only=True)
class HeightBelowAircraft:
    """Height of the aircraft above the ground at the nadir, from one of the valid altimeters.

    t_ns       : time of the output [ns]; t_valid_ns : time of validity of the height [ns]
    sensor     : the selected altimeter
    height_agl : height of ``point`` above the ground at the nadir [m]; sd : one sigma of its error [m]; None while no
                 altimeter is valid
    compensation : method, see HeightAboveGround
    """

    t_ns: int
    t_valid_ns: int | None
    sensor: str
    height_agl: float | None
    sd: float | None
    valid: bool
    reasons: tuple[Reason, ...]
    datum: Datum = Datum.AGL
    point: Point = Point.P
    compensation: Compensation | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ClearanceIntegrity:
    """Does the terrain below match that of the published approach?

    t1..t4_ratio  : test statistics over their limits (1 = limit); None where not tested
    shift, shift_sd         : along-track shift d^ with the best fit to the window [m]; None when unknown
    height_error, .._sd     : b(0), navigated height minus profile [m]
    observability           : O; s_begin, s_end : window along the track before the intercept point [m]
    alert_limit_v / _s      : alert limits, vertical and along the track [m]
    protection_level_v / _s : a larger error is missed with a probability below Pmd [m]; None if unbounded
    """

    t_ns: int
    t_valid_ns: int | None
    state: IntegrityState
    reasons: tuple[Reason, ...]
    valid: bool
    t1_ratio: float | None = None
    t2_ratio: float | None = None
    t3_ratio: float | None = None
    t4_ratio: float | None = None
    shift: float | None = None
    shift_sd: float | None = None
    height_error: float | None = None
    height_error_sd: float | None = None
    observability: float | None = None
    s_begin: float | None = None
    s_end: float | None = None
    alert_limit_v: float | None = None
    alert_limit_s: float | None = None
    protection_level_v: float | None = None
    protection_level_s: float | None = None
    reference: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GlideSlope:
    """Deviation from the published glide path.

    s, y        : path length before the intercept point and offset right of the track [m]
    dh, dh_nav  : height above the path from the altimeter and from navigation [m]; dh_sd : one sigma of dh [m]
    deviation   : angle above (+) the path as seen from the intercept point [rad]; sd : one sigma [rad]
    dots        : deviation / 0.12 g, clamped to +-2; clamped : the clamp acted
    """

    t_ns: int
    t_valid_ns: int | None
    valid: bool
    reasons: tuple[Reason, ...]
    s: float | None = None
    y: float | None = None
    dh: float | None = None
    dh_sd: float | None = None
    dh_nav: float | None = None
    deviation: float | None = None
    sd: float | None = None
    dots: float | None = None
    clamped: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class NavSolution:
    """Position, velocity and attitude that the pipeline uses, with their sources.

    position_source, attitude_source, altitude_source : name of a device or of a filter of navigation
    hpl, vpl  : protection levels of position and altitude [m]: the error is larger with a probability below 1e-3 while
                a source is wrong, below 1e-5 while none is;  valid only below ``[nav.alert_limits]``
    unchecked : why hpl and vpl rely on sigmas that the source states, or on tests that have not run for their window
    refused   : devices of the role ``nav.position`` that are excluded because they contradict others
    tilt_pl, heading_pl : protection levels of roll and pitch together, and of the heading [rad]
    attitude_valid, attitude_reasons : of the attitude only; ``reasons`` contains them as well
    attitude_unchecked  : as ``unchecked``, for tilt_pl
    """

    t_ns: int
    t_valid_ns: int | None
    valid: bool
    reasons: tuple[Reason, ...]
    position_source: str | None = None
    attitude_source: str | None = None
    lat: float | None = None
    lon: float | None = None
    alt: float | None = None
    horizontal_sd: float | None = None
    vertical_sd: float | None = None
    vel_north: float | None = None
    vel_east: float | None = None
    vel_down: float | None = None
    roll: float | None = None
    pitch: float | None = None
    heading: float | None = None
    altitude_source: str | None = None
    hpl: float | None = None
    vpl: float | None = None
    unchecked: tuple[Reason, ...] = ()
    refused: tuple[str, ...] = ()
    tilt_pl: float | None = None
    heading_pl: float | None = None
    attitude_valid: bool = False
    attitude_reasons: tuple[Reason, ...] = ()
    attitude_unchecked: tuple[Reason, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterSolution:
    """Solution of the error-state filter from inertial data and aiding measurements; point P.

    vel_sd, tilt_sd : the largest one sigma of the three velocities [m/s], of roll and pitch [rad]
    rejected        : names of aiding sources that are outside the gate at present
    excluded        : names of sources that are excluded at present because they contradict the others
    hpl, vpl        : protection levels of position and altitude [m], including a wrong source
    """

    t_ns: int
    t_valid_ns: int | None
    valid: bool
    reasons: tuple[Reason, ...]
    mode: FilterMode
    lat: float | None = None
    lon: float | None = None
    alt: float | None = None
    horizontal_sd: float | None = None
    vertical_sd: float | None = None
    vel_north: float | None = None
    vel_east: float | None = None
    vel_down: float | None = None
    vel_sd: float | None = None
    roll: float | None = None
    pitch: float | None = None
    heading: float | None = None
    tilt_sd: float | None = None
    heading_sd: float | None = None
    rejected: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()
    hpl: float | None = None
    vpl: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class VerticalSolution:
    """Height and climb from inertial data and an altimeter over known terrain, without another altitude source.

    altimeter : source of its heights; rejected : the newest height was outside the confidence region
    """

    t_ns: int
    t_valid_ns: int | None
    valid: bool
    reasons: tuple[Reason, ...]
    alt: float | None = None
    vertical_sd: float | None = None
    vel_down: float | None = None
    vel_down_sd: float | None = None
    altimeter: str | None = None
    rejected: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionFix:
    """Weighted position from satellites and DME; altitude from the source with the smaller predicted sigma.

    altitude_source : "gnss_dme", or the altimeter over known terrain
    """

    t_ns: int
    t_valid_ns: int | None
    valid: bool
    reasons: tuple[Reason, ...]
    lat: float | None = None
    lon: float | None = None
    alt: float | None = None
    horizontal_sd: float | None = None
    vertical_sd: float | None = None
    altitude_source: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceValidity:
    """Result of the tests of a device that gives position, altitude or attitude.

    valid, reasons : of all its quantities
    unchecked  : why a valid source was not compared: no other source, or two that disagree
    position_valid, altitude_valid, attitude_valid, heading_valid : None until it has given the quantity
    onset_ns   : onset of the oldest contradiction that is not resolved [ns]
    readmission : condition for readmission; "" while it is valid
    """

    t_ns: int
    t_valid_ns: int | None
    source: str
    valid: bool
    reasons: tuple[Reason, ...]
    unchecked: tuple[Reason, ...] = ()
    position_valid: bool | None = None
    altitude_valid: bool | None = None
    attitude_valid: bool | None = None
    heading_valid: bool | None = None
    onset_ns: int | None = None
    readmission: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProvisionalSolution:
    """Solution of the filter if an unconfirmed source were right; for comparison only, navigation does not use it.

    source     : the device;  quantities : its quantities that aid this solution only: position, height, velocity
    valid, reasons : never valid, ``unconfirmed``
    lat, lon [rad], alt [m], vel_* [m/s] and their sigmas : of point P, as in FilterSolution
    distance, height_difference : from the filter: horizontal [m], >= 0; vertical [m], positive: above the filter
    hpl, vpl   : distance from the filter plus the protection level of the filter [m]
    readmission : condition for readmission of the source
    """

    t_ns: int
    t_valid_ns: int | None
    source: str
    valid: bool
    reasons: tuple[Reason, ...]
    quantities: tuple[str, ...] = ()
    lat: float | None = None
    lon: float | None = None
    alt: float | None = None
    horizontal_sd: float | None = None
    vertical_sd: float | None = None
    vel_north: float | None = None
    vel_east: float | None = None
    vel_down: float | None = None
    vel_sd: float | None = None
    distance: float | None = None
    height_difference: float | None = None
    hpl: float | None = None
    vpl: float | None = None
    readmission: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A message for the operator: a source changed, a device recovered, a mark was set."""

    t_ns: int
    level: str  # info | warning | error
    source: str
    text: str


Output = (
    HeightAboveGround
    | HeightBelowAircraft
    | ClearanceIntegrity
    | GlideSlope
    | NavSolution
    | FilterSolution
    | VerticalSolution
    | PositionFix
    | SourceValidity
    | ProvisionalSolution
)
