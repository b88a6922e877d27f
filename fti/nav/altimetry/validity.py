"""Validity of an altimeter sample: one table of rules, each with its reason.

Source: Spiegel 2018, ch. 3.1 (device flag, range limits, attitude limits); age as the design's section 2 asks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from fti.config import Altimeter
from fti.types import Reason


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """What is known about an altimeter at one moment.

    value       : range or height as the device said it [m]; None when it found no return
    flagged     : the device declares the value invalid
    heard       : the device has spoken at all
    age_ns      : time since the value was true; max_age_ns : limit
    roll, pitch : [rad] at that time; None when no attitude is known
    """

    value: float | None = None
    flagged: bool = False
    heard: bool = True
    age_ns: int = 0
    max_age_ns: int = 0
    roll: float | None = None
    pitch: float | None = None


Rule = Callable[[Sample, Altimeter], bool]


def _beyond(angle: float | None, limit_deg: float) -> bool:
    return angle is not None and abs(angle) > math.radians(limit_deg)


#: In the order in which a person wants to read them; a rule is True when the sample breaks it.
RULES: tuple[tuple[Reason, Rule], ...] = (
    (Reason.SILENT, lambda s, a: not s.heard),
    (Reason.STALE, lambda s, a: s.heard and s.age_ns > s.max_age_ns),
    (Reason.DEVICE_FLAG, lambda s, a: s.heard and s.flagged),
    (Reason.NO_RETURN, lambda s, a: s.heard and s.value is None),
    (Reason.BELOW_RANGE, lambda s, a: s.value is not None and s.value < max(0.0, a.range_m[0])),
    (Reason.ABOVE_RANGE, lambda s, a: s.value is not None and s.value > a.range_m[1]),
    (Reason.NO_ATTITUDE, lambda s, a: s.heard and (s.roll is None or s.pitch is None)),
    (Reason.ROLL, lambda s, a: _beyond(s.roll, a.max_roll_deg)),
    (Reason.PITCH, lambda s, a: _beyond(s.pitch, a.max_pitch_deg)),
)


def reasons_against(sample: Sample, limits: Altimeter) -> tuple[Reason, ...]:
    """Why the sample is not valid; empty when it is."""
    return tuple(reason for reason, broken in RULES if broken(sample, limits))
