"""Validity of an altimeter sample: one table of rules, each with its reason.

    device     its flag, no return, silence, age, range limits
    attitude   roll and pitch against the beam
    terrain    measured minus predicted range; measured minus navigated height; dispersion of the ranges across the
               predicted beam over the height; incidence where the predicted ray meets ground

Two sets of limits (``pencil_limits``, ``wide_beam_limits``) for beams of these kinds, from the source:

                             narrow beam, laser          wide beam, radar
    roll, pitch              10 deg, 10 deg              half power angle across, along
    measured - predicted     5 m                         10 m
    measured - navigated     -                           10 m less one sigma of h(N)
    dispersion               -                           0.3 of the height; level ground gives 0.1, and 0.25 in a bank
                                                         of the half power angle
    incidence                75 deg                      60 deg: a quarter of the power is returned there (cos, cos^2)

Measured minus predicted range checks the sensor.  In a bank over the edge of a wood a correct range may still differ by
20 m from the height straight below.  Therefore a height that is used without compensation by the terrain is compared
with the navigated height h(P) - h(N) if ``max_nadir_deviation_m`` is set.  N is known as well as the position: over
uneven ground the gate is narrower by the uncertainty of h(N) (``fti.nav.altimetry.nadir_height.ground_sd``).

A value must be within its limit; NaN never is.  Where the sigma of the prediction widens the gate, a sample is valid
with more than the table allows.  Where the gate accepts even twice the limit, the height has the reason UNCERTAIN in
``unchecked`` (``is_conclusive``); a lower threshold would set it on every height.
Source: Spiegel 2018, section 3.1, tables 3.2, 7.16 and 7.20; age from the design's section 2; the source gives no
limits of incidence and of dispersion ("~ h"), these are chosen.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from msgspec import Struct

from fti.config import Altimeter
from fti.messages.reasons import Reason

#: Limits of a laser, of a radar and of a laser with several beams [m], [deg]: table 3.2; a quarter of the power.
DEVIATION_M = {"laser": 5.0, "radar": 10.0, "multibeam": 5.0}
INCIDENCE_DEG = {"laser": 75.0, "radar": 60.0, "multibeam": 75.0}
#: A deviation within so many sigmas of position, attitude, terrain and device is valid.
SIGMAS = 3.0
#: A comparison is conclusive while a deviation of this multiple of the limit is refused.
MAX_GATE_RATIO = 2.0
ATTITUDE_DEG, NADIR_M = 10.0, 10.0


class Sample(Struct, frozen=True, gc=False, kw_only=True):
    """The inputs of the rules for an altimeter at one time.

    value       : range or height as the device states it [m]; None without a return
    flagged     : the device declares the value invalid
    has_samples : whether the device has sent any sample
    age_ns      : time since the validity time; max_age_ns : limit
    roll, pitch : [rad] at that time; None without an attitude

    and from the terrain, each None where it is not compared or unknown (NaN is refused):

    predicted    : range that the device should measure [m]; predicted_sd : one sigma of value - predicted [m]
    min_range    : instead of both where the predicted beam meets no ground: at least this [m], same sigma
    dispersion   : standard deviation of the ranges across the predicted beam [m]
    incidence    : angle between the predicted ray and the normal of the ground [rad]
    navigated    : h(P) - h(N) [m]; ground_sd : one sigma of h(N) by the position error [m]
    height       : of P above the point that the beam measures, uncompensated [m]
    """

    value: float | None = None
    flagged: bool = False
    has_samples: bool = True
    age_ns: int = 0
    max_age_ns: int = 0
    roll: float | None = None
    pitch: float | None = None
    predicted: float | None = None
    predicted_sd: float = 0.0
    min_range: float | None = None
    dispersion: float | None = None
    incidence: float | None = None
    navigated: float | None = None
    ground_sd: float = 0.0
    height: float | None = None


Rule = Callable[[Sample, Altimeter], bool]


def _exceeds(value: float | None, limit: float) -> bool:
    """Whether a known value is not within +- limit; NaN is not."""
    return value is not None and not abs(value) <= limit


def _deviates(s: Sample, a: Altimeter) -> bool:
    limit = deviation_gate(s.predicted_sd, a)
    if s.value is None:
        return False
    if s.predicted is None:
        return s.min_range is not None and not s.value >= s.min_range - limit
    return _exceeds(s.value - s.predicted, limit)


def deviation_gate(predicted_sd: float, limits: Altimeter) -> float:
    """Maximum measured minus predicted range that is not refused [m].  predicted_sd : one sigma of it [m]"""
    return max(_deviation_limit(limits), SIGMAS * predicted_sd)


def _deviation_limit(a: Altimeter) -> float:
    return DEVIATION_M[a.kind] if a.max_deviation_m is None else a.max_deviation_m


def is_conclusive(predicted_sd: float, limits: Altimeter) -> bool:
    """Whether a deviation of twice its limit is refused.  predicted_sd : one sigma of measured - predicted [m]

    Otherwise the prediction is so uncertain that the ground does not check the sample.
    """
    return SIGMAS * predicted_sd <= MAX_GATE_RATIO * _deviation_limit(limits)


def is_within_limit(deviation: float, limits: Altimeter) -> bool:
    """Whether a deviation [m] is within its limit, which no uncertainty of the prediction widens."""
    return abs(deviation) <= _deviation_limit(limits)


def _is_off_nadir(s: Sample, a: Altimeter) -> bool:
    if s.height is None or s.navigated is None or a.max_nadir_deviation_m is None:
        return False
    return _exceeds(s.height - s.navigated, a.max_nadir_deviation_m - s.ground_sd)


def _is_dispersed(s: Sample, a: Altimeter) -> bool:
    return (
        s.dispersion is not None and s.navigated is not None and _exceeds(s.dispersion, a.max_dispersion * s.navigated)
    )


def _grazes(s: Sample, a: Altimeter) -> bool:
    return _exceeds(s.incidence, math.radians(a.max_incidence_deg or INCIDENCE_DEG[a.kind]))


#: In the order in which reasons are shown; a rule is True when the sample violates it.
RULES: tuple[tuple[Reason, Rule], ...] = (
    (Reason.SILENT, lambda s, a: not s.has_samples),
    (Reason.STALE, lambda s, a: s.has_samples and s.age_ns > s.max_age_ns),
    (Reason.DEVICE_FLAG, lambda s, a: s.has_samples and s.flagged),
    (Reason.NO_RETURN, lambda s, a: s.has_samples and (s.value is None or math.isnan(s.value))),
    (Reason.BELOW_RANGE, lambda s, a: s.value is not None and s.value < max(0.0, a.range_m[0])),
    (Reason.ABOVE_RANGE, lambda s, a: s.value is not None and s.value > a.range_m[1]),
    (Reason.NO_ATTITUDE, lambda s, a: s.has_samples and (s.roll is None or s.pitch is None)),
    (Reason.ROLL, lambda s, a: _exceeds(s.roll, math.radians(a.max_roll_deg))),
    (Reason.PITCH, lambda s, a: _exceeds(s.pitch, math.radians(a.max_pitch_deg))),
    (Reason.DEVIATION, _deviates),
    (Reason.NOT_NADIR, _is_off_nadir),
    (Reason.DISPERSION, _is_dispersed),
    (Reason.INCIDENCE, _grazes),
)


def reasons_against(sample: Sample, limits: Altimeter) -> tuple[Reason, ...]:
    """Why the sample is not valid; empty when it is."""
    return tuple(reason for reason, broken in RULES if broken(sample, limits))


def pencil_limits(range_m: tuple[float, float]) -> Altimeter:
    """Limits of a pencil beam: table 7.16."""
    return Altimeter(kind="laser", range_m=range_m, max_roll_deg=ATTITUDE_DEG, max_pitch_deg=ATTITUDE_DEG)


def wide_beam_limits(range_m: tuple[float, float], across_deg: float, along_deg: float) -> Altimeter:
    """Limits of a wide beam that is used without compensation: table 7.20.

    across_deg, along_deg : half power of the antenna, off the boresight, across and along the aircraft
    """
    return Altimeter(
        kind="radar",
        range_m=range_m,
        max_roll_deg=across_deg,
        max_pitch_deg=along_deg,
        max_nadir_deviation_m=NADIR_M,
    )
