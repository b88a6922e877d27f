"""The central types: frozen, few, without numpy.  Units, frames and names as in ``fti``."""

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


#: In place of the name of a device, where the operator readmits all of them.
ALL_SOURCES = "*"
TICK_LINK = "fti_tick"
#: The recorder numbers a tick frame every 20 ms, so that silence has a time too.
TICK_PERIOD_NS = 20_000_000


class LinkState(StrEnum):
    """The one state of a link; each has a hint for the person at the connector."""

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
    """When a message arrived, what the device said, and when it was true.

    t_valid_ns is None until the navigation process has filled it in.
    """

    t_rx_ns: int
    t_dev_ns: int | None = None
    time_scale: TimeScale | None = None
    t_valid_ns: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Attitude:
    """Orientation of the body [rad]; a message may carry a part of it."""

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
                    system the larger one; what a device states as its horizontal accuracy is taken as it is
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
    """Velocity north, east, down [m/s]; or what a message carries of it: ground speed [m/s] and track [rad]."""

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
    """Slant range along the beam [m], as a laser measures it; ``lost`` when the device found no return."""

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
    """Calibrated (cas), indicated (ias) and true (tas) airspeed [m/s]; what the message carries."""

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
    """Deflection of a control surface [rad] and the raw count that it was made from."""

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
    """The table of a deflection pickup as it is from now on, piecewise linear between its points.

    points : ascending in raw, deflections strictly monotone; change : what changed, in words
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
    """What a receiver measured on one signal of one satellite.

    pseudorange, pseudorange_sd [m]; carrier_phase, carrier_phase_sd [cycles]; doppler [Hz], positive when it comes
    nearer; cn0_dbhz [dB-Hz]; lock_time [s]: so long the carrier has been followed without a slip; carrier_hz [Hz]:
    nominal frequency of the carrier, where the message says which it is
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
    """The raw observations of one epoch of a GNSS receiver; the time of the epoch is in the stamp."""

    stamp: Stamp
    observations: tuple[Pseudorange, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Ephemeris:
    """Orbit and clock of a GPS satellite as it broadcasts them: IS-GPS-200, tables 20-I and 20-III.

    week : in which it was sent, modulo 1024;  issue : IODE
    toc, toe : reference times of clock and orbit [s of the week];  af0 [s], af1 [s/s], af2 [s/s^2];  tgd [s]
    sqrt_a [m^0.5], e [1];  m0, omega0, i0, omega [rad];  delta_n, omega_dot, idot [rad/s]
    cuc, cus, cic, cis [rad];  crc, crs [m]
    accuracy : upper bound of the accuracy that it states [m]; None where it predicts none
    healthy  : neither its health nor its alert flag warns of it
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
    """A value that no other class carries, by the name that the configuration or the document gives it.

    value : in ``unit``, which is SI or the document's own ("" for a count or a discrete: 0 or 1)
    text  : the name that the document gives to this value, or the characters that are the value; "" for none
    """

    stamp: Stamp
    name: str
    value: float | None
    unit: str = ""
    valid: bool = True
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceStatus:
    """What a device says about itself; ``flags`` are the names of the conditions that it reports."""

    stamp: Stamp
    ok: bool
    flags: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceTime:
    """The device's own time, when a message carries nothing but the time; the time is in the stamp."""

    stamp: Stamp


@dataclass(frozen=True, slots=True, kw_only=True)
class Ack:
    """A device's answer to a command.

    command : its name in the driver's ``COMMANDS``; "" when the answer does not say which it answers (the oldest)
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
    """Why a value is not valid, or why a monitor does not judge."""

    DEVICE_FLAG = "device_flag"  # the device itself says so
    NO_RETURN = "no_return"  # the device has no measurement
    BELOW_RANGE = "below_range"
    ABOVE_RANGE = "above_range"
    ROLL = "roll"  # beyond the limit of the altimeter or the monitor
    PITCH = "pitch"
    STALE = "stale"  # older than max_age_ms
    SILENT = "silent"  # never heard
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
    NOT_INDEPENDENT = "not_independent"  # the altitude is held by the altimeter that would be judged with it
    PROTECTION_LEVEL = "protection_level"  # of position or altitude, above the alert limit
    ATTITUDE_LEVEL = "attitude_level"  # the protection level of the attitude, above the alert limit
    ASSUMPTION = "assumption"  # navigation or altimeter is worse than, or another one than, the limits assume
    POSITION_UNCERTAIN = "position_uncertain"  # by its own sigma, which the ground beside the track cannot make up for
    END = "end"  # past the glide path intercept
    GO_AROUND = "go_around"
    NOT_OBSERVABLE = "position_not_observable"
    ABSOLUTE_MATCH = "absolute_match"  # T1
    SHIFTED = "shifted"  # T2
    HEIGHT_ERROR = "height_error"  # T3
    OBSTACLE = "obstacle"  # T4
    INTEGRITY = "integrity"  # the integrity monitor does not vouch for the height
    BELOW_150_M = "below_150_m"  # too close for an angle; metres only
    FULL_SCALE = "full_scale"
    # what the terrain says against an altimeter, and why it cannot be asked
    DEVIATION = "deviation"  # measured minus predicted, beyond the gate
    NOT_NADIR = "not_nadir"  # measured minus navigated height, beyond the gate: it is not the height straight below
    DISPERSION = "dispersion"  # the rays of the predicted beam differ by too much
    INCIDENCE = "incidence"  # the beam grazes the ground
    # what the changes of an altimeter and another altimeter say against it
    STUCK = "stuck"  # its value repeats exactly while the predicted one changes
    CHANGE_MISMATCH = "change_mismatch"  # it changes otherwise than predicted: drift, scale
    ALTIMETERS_DISAGREE = "altimeters_disagree"  # with another one: the one that the ground does not confirm, else both
    NO_PREDICTION = "no_prediction"  # the predicted beam finds no ground in range
    NO_TERRAIN = "no_terrain"  # none is configured, or it could not be loaded
    TERRAIN_LOADING = "terrain_loading"
    TERRAIN_EDGE = "terrain_edge"  # beyond what the files cover
    TERRAIN_HOLE = "terrain_hole"  # the files do not know this ground
    GROUND_CONTRADICTED = "ground_contradicted"  # a radar and a laser agree against it: altitude or terrain is wrong
    UNCERTAIN = "uncertain"  # place, attitude or terrain are so uncertain that a deviation of twice its limit passes
    # of the filters
    NO_IMU = "no_imu"
    NO_GNSS = "no_gnss"
    NO_BARO = "no_baro"
    NO_HEADING = "no_heading"
    ALIGNING = "aligning"
    COASTING = "coasting"  # nothing bounds the position at present
    REJECTED = "rejected"  # what aids is outside the gate
    EXCLUDED = "excluded"  # a source does not aid the filter: it contradicts the others
    CONTRADICTION = "contradiction"  # sources contradict each other, and it is unknown which is wrong
    REACQUIRED = "reacquired"  # tests between sources have not yet run for as long as they look back
    NOTHING_TO_COMPARE = "nothing_to_compare"  # no other source says anything of it
    RESET = "reset"  # the filter began again
    DIVERGED = "diverged"
    NO_SATELLITES = "no_satellites"
    NO_DME = "no_dme"
    GEOMETRY = "geometry"  # satellites and stations do not fix a position
    # of the tests of one source
    REPEATED = "repeated"  # the same digits although its velocity moves it
    IMPOSSIBLE = "impossible"  # beyond what the aircraft can fly
    JUMP = "jump"  # a step that its velocity does not make
    DRIFT = "drift"  # position and integral of velocity part
    SCATTER = "scatter"  # it scatters more than its stated sigma
    UNDULATION = "undulation"  # the stated one is not that of EGM96
    RANGES_DISAGREE = "ranges_disagree"  # its pseudoranges with each other, and which of them is wrong is unknown
    RANGES_CONTRADICT = "ranges_contradict"  # its pseudoranges give another position than it states
    DEVICE_TIME = "device_time"  # its time steps, stands still or goes back
    ATTITUDES_DISAGREE = "attitudes_disagree"  # with the other attitude sources
    HEADING_TRACK = "heading_track"  # farther from the track than any wind makes it
    UNCONFIRMED = "unconfirmed"  # its tests pass again, and a contradiction that has not ended stands against it


class Compensation(StrEnum):
    """How an altimeter's range became a height above the ground at the nadir."""

    ATTITUDE = "attitude"  # turned into the vertical
    RANGE = "range"  # the slope between the footprint and the nadir taken from the terrain, along one ray
    BEAM = "beam"  # the same with the beam that the sensor has


class FilterMode(StrEnum):
    """State of a navigation filter."""

    WAITING = "waiting"  # inputs are missing
    ALIGNING = "aligning"
    AIDED = "aided"
    COASTING = "coasting"  # inertial alone
    INVALID = "invalid"


class Datum(StrEnum):
    """What a height is counted from."""

    ELLIPSOID = "ellipsoid"
    MSL = "msl"
    PRESSURE = "pressure"
    AGL = "agl"


class Point(StrEnum):
    """What a height is the height of."""

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

    t_ns       : time of the output [ns]; t_valid_ns : when the height was true [ns]
    raw        : what the device said, at its antenna and along its beam [m]
    height_agl : height of ``point`` above the ground straight below it [m]; sd : one sigma of its error [m]
    compensation : how it was made.  By the terrain between there and what the beam sees (range, beam) where the terrain
                 is known; else (attitude) it is ``nearest`` with the configured bias and scale taken off, and sd
                 includes an assumed relief
    nearest, nearest_sd : compensated for attitude, mounting and lever arm alone, at ``point``: above what the beam sees
                 [m]; sigma as such, without any relief [m]
    predicted  : what the device should have said above the known terrain [m]
    predicted_sd : one sigma of raw - predicted [m]
    wheels     : height of the wheels by ``height_agl``, as the aircraft lies [m]; None where nobody says where they are
    unchecked  : why the terrain could not be asked, or not nearly as closely as the limits ask; what it can tell
                 against a height is then not told.  NOT_INDEPENDENT: this altimeter holds the altitude that it is
                 compared with, and a slow drift of it is not detected
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
    """Height of the aircraft above the ground straight below it, from one of the valid altimeters.

    t_ns       : time of the output [ns]; t_valid_ns : when the height was true [ns]
    sensor     : the altimeter that is chosen
    height_agl : height of ``point`` above the ground straight below it [m]; sd : one sigma of its error [m]; None while
                 no altimeter is valid
    compensation : how it was made, see HeightAboveGround
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
    """Does the ground below match the approach that was published?

    t1..t4_ratio  : test statistics over their limits (1 = limit); None where not tested
    shift, shift_sd         : along-track shift d^ that explains the window best [m]; None when unknown
    height_error, .._sd     : b(0), navigated height minus profile [m]
    observability           : O; s_begin, s_end : window along the track before the intercept point [m]
    alert_limit_v / _s      : alert limits, vertical and along the track [m]
    protection_level_v / _s : an error as large is missed with Pmd at most [m]; None where it is without bound
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
    dots        : deviation / 0.12 g, clamped to +-2; clamped : it was
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
    """Position, velocity and attitude that the pipeline uses, and where each came from.

    position_source, attitude_source, altitude_source : a device, or a filter of navigation by its name
    hpl, vpl  : protection levels of position and altitude [m]: the error is larger with a probability below 1e-3 while
                a source is wrong, below 1e-5 while none is;  valid only below ``[nav.alert_limits]``
    unchecked : why hpl and vpl rest on what the source states of itself, or do not yet look back as far as they can
    refused   : devices of the role ``nav.position`` that are excluded because they contradict others
    tilt_pl, heading_pl : protection levels of roll and pitch together, and of the heading [rad]
    attitude_valid, attitude_reasons : of the attitude alone; the reasons are among ``reasons``, too
    attitude_unchecked  : the same as ``unchecked``, of tilt_pl
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
    """What the error-state filter makes of inertial data and what aids it; point P.

    vel_sd, tilt_sd : the largest one sigma of the three velocities [m/s], of roll and pitch [rad]
    rejected        : what aids and is outside the gate at present, by name
    excluded        : what does not aid at present, because it contradicts the other sources, by name
    hpl, vpl        : protection levels of position and altitude [m], against a wrong source as well
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
    """Height and climb from inertial data and an altimeter above known terrain, when nothing else gives an altitude.

    altimeter : whose heights carry it; rejected : its newest one was outside the confidence region
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
    """Position by satellites and DME stations, weighted; the altitude from the source with the smaller predicted sigma.

    altitude_source : "gnss_dme", or the altimeter above known terrain
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
    """What the tests of one source say of a device that gives position, altitude or attitude.

    valid, reasons : of all that it gives
    unchecked  : why a valid one rests on what it says of itself: nothing to compare with, or two that disagree
    position_valid, altitude_valid, attitude_valid, heading_valid : None while it has not given it
    onset_ns   : when the oldest contradiction began that still counts [ns]
    readmission : what would make it valid again; "" while it is
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
    """What the filter would give if an unconfirmed source were right; for comparison, navigation does not use it.

    source     : the device;  quantities : with which it aids here alone: position, height, velocity
    valid, reasons : never valid, ``unconfirmed``
    lat, lon [rad], alt [m], vel_* [m/s] and their sigmas : of point P, as in FilterSolution
    distance, height_difference : from the filter: horizontal [m], >= 0; vertical [m], positive: above the filter
    hpl, vpl   : distance from the filter, and what the filter itself may be wrong [m]
    readmission : what would readmit the source
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
    """Something that a person should know: a source changed, a device came back, a mark was set."""

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
