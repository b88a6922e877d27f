"""Outputs of navigation and events: frozen, without numpy."""

from __future__ import annotations

from enum import StrEnum

from fti.messages.reasons import Reason
from fti.messages.tables import Message
from fti.messages.units import Count, Metres, MetresPerSecond, Nanoseconds, Radians, Ratio, Seconds


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


class HeightAboveGround(Message, kw_only=True):
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

    t_ns: Nanoseconds
    t_valid_ns: Nanoseconds | None
    sensor: str
    raw: Metres | None
    height_agl: Metres | None
    sd: Metres | None
    valid: bool
    reasons: tuple[Reason, ...]
    datum: Datum = Datum.AGL
    point: Point = Point.P
    compensation: Compensation | None = None
    nearest: Metres | None = None
    nearest_sd: Metres | None = None
    predicted: Metres | None = None
    predicted_sd: Metres | None = None
    wheels: Metres | None = None
    unchecked: tuple[Reason, ...] = ()

    @property
    def is_by_terrain(self) -> bool:
        """Is ``height_agl`` compensated by known terrain?"""
        return self.compensation in {Compensation.RANGE, Compensation.BEAM}


class HeightBelowAircraft(Message, kw_only=True):
    """Height of the aircraft above the ground at the nadir, from one of the valid altimeters.

    t_ns       : time of the output [ns]; t_valid_ns : time of validity of the height [ns]
    sensor     : the selected altimeter
    height_agl : height of ``point`` above the ground at the nadir [m]; sd : one sigma of its error [m]; None while no
                 altimeter is valid
    compensation : method, see HeightAboveGround
    """

    t_ns: Nanoseconds
    t_valid_ns: Nanoseconds | None
    sensor: str
    height_agl: Metres | None
    sd: Metres | None
    valid: bool
    reasons: tuple[Reason, ...]
    datum: Datum = Datum.AGL
    point: Point = Point.P
    compensation: Compensation | None = None


class ClearanceIntegrity(Message, kw_only=True):
    """Does the terrain below match that of the published approach?

    t1..t4_ratio  : test statistics over their limits (1 = limit); None where not tested
    shift, shift_sd         : along-track shift d^ with the best fit to the window [m]; None when unknown
    height_error, .._sd     : b(0), navigated height minus profile [m]
    observability           : O; s_begin, s_end : window along the track before the intercept point [m]
    alert_limit_v / _s      : alert limits, vertical and along the track [m]
    protection_level_v / _s : a larger error is missed with a probability below Pmd [m]; None if unbounded
    """

    t_ns: Nanoseconds
    t_valid_ns: Nanoseconds | None
    state: IntegrityState
    reasons: tuple[Reason, ...]
    valid: bool
    t1_ratio: Ratio | None = None
    t2_ratio: Ratio | None = None
    t3_ratio: Ratio | None = None
    t4_ratio: Ratio | None = None
    shift: Metres | None = None
    shift_sd: Metres | None = None
    height_error: Metres | None = None
    height_error_sd: Metres | None = None
    observability: Ratio | None = None
    s_begin: Metres | None = None
    s_end: Metres | None = None
    alert_limit_v: Metres | None = None
    alert_limit_s: Metres | None = None
    protection_level_v: Metres | None = None
    protection_level_s: Metres | None = None
    reference: str | None = None


class GlideSlope(Message, kw_only=True):
    """Deviation from the published glide path.

    s, y        : path length before the intercept point and offset right of the track [m]
    dh, dh_nav  : height above the path from the altimeter and from navigation [m]; dh_sd : one sigma of dh [m]
    deviation   : angle above (+) the path as seen from the intercept point [rad]; sd : one sigma [rad]
    dots        : deviation / 0.12 g, clamped to +-2; clamped : the clamp acted
    """

    t_ns: Nanoseconds
    t_valid_ns: Nanoseconds | None
    valid: bool
    reasons: tuple[Reason, ...]
    s: Metres | None = None
    y: Metres | None = None
    dh: Metres | None = None
    dh_sd: Metres | None = None
    dh_nav: Metres | None = None
    deviation: Radians | None = None
    sd: Radians | None = None
    dots: Ratio | None = None
    clamped: bool = False


class NavSolution(Message, kw_only=True):
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

    t_ns: Nanoseconds
    t_valid_ns: Nanoseconds | None
    valid: bool
    reasons: tuple[Reason, ...]
    position_source: str | None = None
    attitude_source: str | None = None
    lat: Radians | None = None
    lon: Radians | None = None
    alt: Metres | None = None
    horizontal_sd: Metres | None = None
    vertical_sd: Metres | None = None
    vel_north: MetresPerSecond | None = None
    vel_east: MetresPerSecond | None = None
    vel_down: MetresPerSecond | None = None
    roll: Radians | None = None
    pitch: Radians | None = None
    heading: Radians | None = None
    altitude_source: str | None = None
    hpl: Metres | None = None
    vpl: Metres | None = None
    unchecked: tuple[Reason, ...] = ()
    refused: tuple[str, ...] = ()
    tilt_pl: Radians | None = None
    heading_pl: Radians | None = None
    attitude_valid: bool = False
    attitude_reasons: tuple[Reason, ...] = ()
    attitude_unchecked: tuple[Reason, ...] = ()


class FilterSolution(Message, kw_only=True):
    """Solution of the error-state filter from inertial data and aiding measurements; point P.

    vel_sd, tilt_sd : the largest one sigma of the three velocities [m/s], of roll and pitch [rad]
    rejected        : names of aiding sources that are outside the gate at present
    excluded        : names of sources that are excluded at present because they contradict the others
    hpl, vpl        : protection levels of position and altitude [m], including a wrong source
    """

    t_ns: Nanoseconds
    t_valid_ns: Nanoseconds | None
    valid: bool
    reasons: tuple[Reason, ...]
    mode: FilterMode
    lat: Radians | None = None
    lon: Radians | None = None
    alt: Metres | None = None
    horizontal_sd: Metres | None = None
    vertical_sd: Metres | None = None
    vel_north: MetresPerSecond | None = None
    vel_east: MetresPerSecond | None = None
    vel_down: MetresPerSecond | None = None
    vel_sd: MetresPerSecond | None = None
    roll: Radians | None = None
    pitch: Radians | None = None
    heading: Radians | None = None
    tilt_sd: Radians | None = None
    heading_sd: Radians | None = None
    rejected: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()
    hpl: Metres | None = None
    vpl: Metres | None = None


class VerticalSolution(Message, kw_only=True):
    """Height and climb from inertial data and an altimeter over known terrain, without another altitude source.

    altimeter : source of its heights; rejected : the newest height was outside the confidence region
    """

    t_ns: Nanoseconds
    t_valid_ns: Nanoseconds | None
    valid: bool
    reasons: tuple[Reason, ...]
    alt: Metres | None = None
    vertical_sd: Metres | None = None
    vel_down: MetresPerSecond | None = None
    vel_down_sd: MetresPerSecond | None = None
    altimeter: str | None = None
    rejected: bool = False


class PositionFix(Message, kw_only=True):
    """Weighted position from satellites and DME; altitude from the source with the smaller predicted sigma.

    altitude_source : "gnss_dme", or the altimeter over known terrain
    """

    t_ns: Nanoseconds
    t_valid_ns: Nanoseconds | None
    valid: bool
    reasons: tuple[Reason, ...]
    lat: Radians | None = None
    lon: Radians | None = None
    alt: Metres | None = None
    horizontal_sd: Metres | None = None
    vertical_sd: Metres | None = None
    altitude_source: str | None = None


class TerrainFix(Message, kw_only=True):
    """Position from the comparison of an altimeter's profile with known terrain.

    t_valid_ns : time of the position, the middle of the profile [ns]; repeated twice a second until the next profile
    unchecked  : MAP_UNVERIFIED while no satellites could show that the map is displaced
    method     : "profile": heights below the track; "beams": ranges of all beams of a multi-beam altimeter
    is_search  : a search without a certain position; its fixes count after three that agree
    lat, lon   : of P at t_valid_ns; also of a fix that is refused, if the profile has a best place
    north_sd, east_sd, correlation : one sigma of each axis with respect to the map, and their correlation
    shift_north, shift_east : from the filter's position at t_valid_ns to the fix [m]
    map_sd     : one sigma of the horizontal position of the map, each axis; it is not part of north_sd, east_sd
    up         : true minus navigated height by the profile [m];  up_sd : one sigma of it
    ambiguity  : probability of the next best place over that of the best
    noise_ratio : RMS of the residuals over their stated sigma, at least 1; part of the sigmas
    reach      : largest shift that was searched, each way [m]
    samples, length : number of heights of the profile, or of frames of all beams, and its length over ground [m]
    """

    t_ns: Nanoseconds
    t_valid_ns: Nanoseconds | None
    valid: bool
    reasons: tuple[Reason, ...]
    unchecked: tuple[Reason, ...] = ()
    method: str = "profile"
    is_search: bool = True
    lat: Radians | None = None
    lon: Radians | None = None
    north_sd: Metres | None = None
    east_sd: Metres | None = None
    correlation: Ratio | None = None
    shift_north: Metres | None = None
    shift_east: Metres | None = None
    map_sd: Metres | None = None
    up: Metres | None = None
    up_sd: Metres | None = None
    ambiguity: Ratio | None = None
    noise_ratio: Ratio | None = None
    reach: Metres | None = None
    samples: Count | None = None
    length: Metres | None = None


class GroundDrift(Message, kw_only=True):
    """Drift of the inertial solution between two looks at the same ground; it aids the filter while it is valid.

    t_valid_ns : time of the later look [ns]; repeated twice a second until the next one
    valid      : the filter has accepted it, and it had agreed with satellites before
    interval   : from the first look to the second [s]
    directions : number of directions in which the ground determines the drift, 0 to 3
    north, east, down : computed minus true displacement of P from look to look [m]; None unless all are determined
    north_sd, east_sd, down_sd : one sigma of each
    overlap    : share of the points of both looks on common ground
    points     : points of the later look that are compared
    pairs, refused : pairs of looks since the start, and those of them that did not aid
    range_share, range_share_sd : estimated error of the sensor as a share of its ranges, and its sigma
    yaw, yaw_sd : estimated error of its mounting about the vertical axis of the aircraft, and its sigma [rad]
    clock, clock_sd : estimated time by which its scans are stamped too late, and its sigma [s]
    second_roll, second_pitch, second_yaw : estimated angles by which the mounting of the rear one of two scanners is
        turned too far against the front one, about the forward, right and downward axis of the aircraft [rad]
    second_clock : estimated time by which the rear one is stamped later than the front one [s]
    second_roll_sd, second_pitch_sd, second_yaw_sd, second_clock_sd : one sigma of each; None with one scanner
    """

    t_ns: Nanoseconds
    t_valid_ns: Nanoseconds | None
    valid: bool
    reasons: tuple[Reason, ...]
    interval: Seconds | None = None
    directions: Count | None = None
    north: Metres | None = None
    east: Metres | None = None
    down: Metres | None = None
    north_sd: Metres | None = None
    east_sd: Metres | None = None
    down_sd: Metres | None = None
    overlap: Ratio | None = None
    points: Count | None = None
    pairs: Count | None = None
    refused: Count | None = None
    range_share: Ratio | None = None
    range_share_sd: Ratio | None = None
    yaw: Radians | None = None
    yaw_sd: Radians | None = None
    clock: Seconds | None = None
    clock_sd: Seconds | None = None
    second_roll: Radians | None = None
    second_roll_sd: Radians | None = None
    second_pitch: Radians | None = None
    second_pitch_sd: Radians | None = None
    second_yaw: Radians | None = None
    second_yaw_sd: Radians | None = None
    second_clock: Seconds | None = None
    second_clock_sd: Seconds | None = None


class SourceValidity(Message, kw_only=True):
    """Result of the tests of a device that gives position, altitude or attitude.

    valid, reasons : of all its quantities
    unchecked  : why a valid source was not compared: no other source, or two that disagree
    position_valid, altitude_valid, attitude_valid, heading_valid : None until it has given the quantity
    onset_ns   : onset of the oldest contradiction that is not resolved [ns]
    readmission : condition for readmission; "" while it is valid
    """

    t_ns: Nanoseconds
    t_valid_ns: Nanoseconds | None
    source: str
    valid: bool
    reasons: tuple[Reason, ...]
    unchecked: tuple[Reason, ...] = ()
    position_valid: bool | None = None
    altitude_valid: bool | None = None
    attitude_valid: bool | None = None
    heading_valid: bool | None = None
    onset_ns: Nanoseconds | None = None
    readmission: str = ""


class ProvisionalSolution(Message, kw_only=True):
    """Solution of the filter if an unconfirmed source were right; for comparison only, navigation does not use it.

    source     : the device;  quantities : its quantities that aid this solution only: position, height, velocity
    valid, reasons : never valid, ``unconfirmed``
    lat, lon [rad], alt [m], vel_* [m/s] and their sigmas : of point P, as in FilterSolution
    distance, height_difference : from the filter: horizontal [m], >= 0; vertical [m], positive: above the filter
    hpl, vpl   : distance from the filter plus the protection level of the filter [m]
    readmission : condition for readmission of the source
    """

    t_ns: Nanoseconds
    t_valid_ns: Nanoseconds | None
    source: str
    valid: bool
    reasons: tuple[Reason, ...]
    quantities: tuple[str, ...] = ()
    lat: Radians | None = None
    lon: Radians | None = None
    alt: Metres | None = None
    horizontal_sd: Metres | None = None
    vertical_sd: Metres | None = None
    vel_north: MetresPerSecond | None = None
    vel_east: MetresPerSecond | None = None
    vel_down: MetresPerSecond | None = None
    vel_sd: MetresPerSecond | None = None
    distance: Metres | None = None
    height_difference: Metres | None = None
    hpl: Metres | None = None
    vpl: Metres | None = None
    readmission: str = ""


class Event(Message, kw_only=True):
    """A message for the operator: a source changed, a device recovered, a mark was set."""

    t_ns: Nanoseconds
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
    | TerrainFix
    | GroundDrift
    | SourceValidity
    | ProvisionalSolution
)
