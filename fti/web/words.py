"""The words that a person reads for reasons and states; the page and the terminal say the same."""

from __future__ import annotations

from fti.types import IntegrityState, Reason

REASONS: dict[str, str] = {
    Reason.DEVICE_FLAG: "device says invalid",
    Reason.NO_RETURN: "no return",
    Reason.BELOW_RANGE: "below range",
    Reason.ABOVE_RANGE: "above range",
    Reason.ROLL: "roll limit",
    Reason.PITCH: "pitch limit",
    Reason.STALE: "stale",
    Reason.SILENT: "never heard",
    Reason.NO_ATTITUDE: "no attitude",
    Reason.NO_POSITION: "no position",
    Reason.NO_ALTITUDE: "no altitude",
    Reason.NO_HEIGHT: "no altimeter is valid",
    Reason.NO_VELOCITY: "no velocity",
    Reason.NO_ALTIMETER: "no altimeter",
    Reason.NO_PROFILE: "no approach profile",
    Reason.WRONG_SENSOR: "profile is of another altimeter",
    Reason.OUTSIDE_PROFILE: "outside the profile",
    Reason.OFF_TRACK: "off track",
    Reason.GAPS: "gaps in the window",
    Reason.NOT_INDEPENDENT: "altitude rests on this altimeter",
    Reason.PROTECTION_LEVEL: "protection level above alert limit",
    Reason.ATTITUDE_LEVEL: "attitude protection level above alert limit",
    Reason.ASSUMPTION: "navigation or altimeter beyond what the profile assumes",
    Reason.POSITION_UNCERTAIN: "position too uncertain",
    Reason.END: "past the glide path intercept",
    Reason.GO_AROUND: "go-around",
    Reason.NOT_OBSERVABLE: "position not observable",
    Reason.ABSOLUTE_MATCH: "ground does not match the profile",
    Reason.SHIFTED: "another position fits better",
    Reason.HEIGHT_ERROR: "height error",
    Reason.OBSTACLE: "obstacle",
    Reason.INTEGRITY: "not vouched for by integrity",
    Reason.BELOW_150_M: "closer than 150 m: metres only",
    Reason.FULL_SCALE: "beyond full scale",
    Reason.DEVIATION: "not what the terrain predicts",
    Reason.NOT_NADIR: "not the height straight below",
    Reason.DISPERSION: "ground in the beam is too uneven",
    Reason.INCIDENCE: "beam grazes the ground",
    Reason.STUCK: "value is stuck",
    Reason.CHANGE_MISMATCH: "does not change as predicted",
    Reason.ALTIMETERS_DISAGREE: "altimeters disagree",
    Reason.NO_PREDICTION: "terrain predicts no return",
    Reason.GROUND_CONTRADICTED: "altitude or terrain wrong",
    Reason.NO_TERRAIN: "no terrain",
    Reason.TERRAIN_LOADING: "terrain is being loaded",
    Reason.TERRAIN_EDGE: "beyond the terrain",
    Reason.TERRAIN_HOLE: "hole in the terrain",
    Reason.UNCERTAIN: "too uncertain to compare",
    Reason.NO_IMU: "no inertial data",
    Reason.NO_GNSS: "no GNSS",
    Reason.NO_BARO: "no pressure altitude",
    Reason.NO_HEADING: "no heading",
    Reason.ALIGNING: "aligning",
    Reason.COASTING: "inertial alone",
    Reason.REJECTED: "aiding outside the gate",
    Reason.EXCLUDED: "a source is excluded from aiding",
    Reason.CONTRADICTION: "sources contradict each other",
    Reason.REACQUIRED: "sources are compared for a short time only",
    Reason.NOTHING_TO_COMPARE: "nothing to compare with",
    Reason.RESET: "began again",
    Reason.DIVERGED: "diverged",
    Reason.NO_SATELLITES: "no satellites",
    Reason.NO_DME: "no DME ranges",
    Reason.GEOMETRY: "geometry gives no position",
    Reason.REPEATED: "same values in motion",
    Reason.IMPOSSIBLE: "motion beyond the aircraft's limits",
    Reason.JUMP: "position jumped",
    Reason.DRIFT: "position drifts from its velocity",
    Reason.SCATTER: "scatter above the stated sigma",
    Reason.UNDULATION: "geoid undulation wrong",
    Reason.RANGES_DISAGREE: "pseudoranges disagree with each other",
    Reason.RANGES_CONTRADICT: "pseudoranges give another position",
    Reason.DEVICE_TIME: "device time wrong",
    Reason.ATTITUDES_DISAGREE: "attitude sources disagree",
    Reason.HEADING_TRACK: "heading off the track",
    Reason.UNCONFIRMED: "not confirmed after a fault",
}

STATES: dict[str, str] = {
    IntegrityState.NO_PROFILE: "no approach profile loaded",
    IntegrityState.ACQUIRE: "collecting the first window",
    IntegrityState.MONITOR: "heights match; position not observable here",
    IntegrityState.OK: "ground matches the published approach",
    IntegrityState.CAUTION: "one test over its limit",
    IntegrityState.ALERT: "do not trust height or position",
    IntegrityState.UNAVAILABLE: "monitor does not judge",
}


#: State of the storage that is not ok: level and title of its alarm.
STORAGE: dict[str, tuple[str, str]] = {
    "full": ("amber", "STORAGE ALMOST FULL"),
    "overdue": ("amber", "NEXT FILE OVERDUE"),
    "slow": ("amber", "STORAGE SLOW"),
    "fallback": ("amber", "RECORDING TO THE FALLBACK"),
    "gone": ("red", "RECORDING TO A LOST FILE"),
    "error": ("red", "NOT RECORDING"),
}
#: How a session is recorded, when it is not all of it: banner and explanation.
MODES: dict[str, tuple[str, str]] = {"snapshot": ("SNAPSHOT", "only what is around a trigger is recorded")}
CONTINUOUS = "continuous"


def describe_storage(state: str) -> tuple[str, str]:
    """Level and title of the alarm of a storage state that is not ok; also of one that is not known here."""
    return STORAGE.get(state, ("amber", f"STORAGE {state.upper()}"))


def describe_mode(mode: str) -> tuple[str, str]:
    """Banner and explanation of a mode that is not continuous."""
    return MODES.get(mode, (mode.upper(), ""))


def describe_reasons(reasons: object) -> list[str]:
    """Words for the reasons of an output; an unknown one is shown as it is."""
    return [REASONS.get(str(r), str(r).replace("_", " ")) for r in reasons] if isinstance(reasons, list) else []
