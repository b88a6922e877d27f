"""Reasons of values that are not valid, and of monitors without a result."""

from __future__ import annotations

from enum import StrEnum


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
    # of the position from the ground
    GROUND_FLAT = "ground_flat"  # its slopes do not determine a position
    SEARCH_EDGE = "search_edge"  # the best position is at the edge of the search: the true one may be beyond
    PROFILE_MISFIT = "profile_misfit"  # the profile fits the terrain nowhere within its sigma
    AMBIGUOUS = "ambiguous"  # it fits at several places
    TOO_FEW_HEIGHTS = "too_few_heights"
    NOT_CONFIRMED = "not_confirmed"  # three fixes in succession must agree first
    MAP_UNVERIFIED = "map_unverified"  # without satellites a displaced map is not detected
    # of the drift between two looks at the ground
    FEW_POINTS = "few_points"  # the looks have too little ground in common, or too few returns
    LOOKS_MISFIT = "looks_misfit"  # the looks fit nowhere
    UNEXPECTED_DRIFT = "unexpected_drift"  # the drift contradicts the filter
    NOT_CALIBRATED = "not_calibrated"  # it has not agreed with satellites for long enough
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
