"""Protection levels of the position that navigation uses, whatever device gives it.

    compared with the filter     HPL = |x - x_0| + HPL of the filter      x_0 : the filter at the same time
    nothing to compare with      HPL = 4.80 sigma, VPL = 4.42 sigma; ``unchecked`` says so

The filter's own levels hold for what its sources may do wrong (``fti.nav.separation.protection``), so the first holds
whatever sigma the device states.  A sigma that is not stated is that of ``[nav.unstated_sd]``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from fti.config import AlertLimits, Config
from fti.geodesy.one_point import radii
from fti.nav.source_interpolation import PositionState
from fti.types import Reason

K_RADIAL, K_AXIS = 4.80, 4.42


class Protection(NamedTuple):
    """Horizontal and vertical protection level [m], None where there is no position or height.

    unchecked : why they rest on what the source states of itself alone;  assumed : its sigma is not even stated
    """

    horizontal: float | None
    vertical: float | None
    unchecked: tuple[Reason, ...] = ()
    assumed: bool = False


class FilterReference(NamedTuple):
    """A position of the filter and its protection levels [m].

    aided_by  : devices whose positions aid it;  refused : those of them that are excluded
    unchecked : why the levels do not yet hold as they will
    """

    position: PositionState
    horizontal: float
    vertical: float
    aided_by: frozenset[str] = frozenset()
    refused: frozenset[str] = frozenset()
    unchecked: tuple[Reason, ...] = ()


def compare_with_filter(here: PositionState, compared: FilterReference) -> Protection:
    """Of a position that the filter was compared with at the same time."""
    level, high = differences(here, compared.position)
    vertical = None if high is None else high + compared.vertical
    return Protection(level + compared.horizontal, vertical, compared.unchecked)


def unchecked(here: PositionState, assumed: tuple[float, float]) -> Protection:
    """Of a position that nothing is compared with.  assumed : sigmas where it states none, horizontal, vertical [m]"""
    level, high = _valid_sd(here.horizontal_sd), _valid_sd(here.vertical_sd)
    is_assumed = level is None or (here.alt is not None and high is None)
    horizontal = K_RADIAL * (assumed[0] if level is None else level)
    vertical = None if here.alt is None else K_AXIS * (assumed[1] if high is None else high)
    return Protection(horizontal, vertical, (Reason.NOTHING_TO_COMPARE,), is_assumed)


def extrapolate_levels(found: Protection, then: PositionState, now: PositionState, seconds: float) -> Protection:
    """Levels of a position that was compared with the filter so long ago, and has gone on by more than its velocity.

    A fix that repeats the one before steps back by 0.2 s of flight: its error grows by that at once.
    """
    if Reason.NOTHING_TO_COMPARE in found.unchecked or then.north is None or then.east is None:
        return found
    meridian, normal = radii(then.lat)
    north = (now.lat - then.lat) * meridian - then.north * seconds
    east = math.remainder(now.lon - then.lon, 2.0 * math.pi) * normal * math.cos(then.lat) - then.east * seconds
    up = 0.0 if now.alt is None or then.alt is None else now.alt - then.alt + (then.down or 0.0) * seconds
    horizontal = None if found.horizontal is None else found.horizontal + math.hypot(north, east)
    return found._replace(horizontal=horizontal, vertical=None if found.vertical is None else found.vertical + abs(up))


def is_beyond(found: Protection, limits: AlertLimits) -> bool:
    """Whether a level is above its alert limit; those of an assumed sigma are of a kind and not of this source."""
    if found.assumed:
        return False
    horizontal, vertical = found.horizontal or 0.0, found.vertical or 0.0
    return horizontal > limits.position_m or vertical > limits.altitude_m


def unstated_sigmas(config: Config) -> Mapping[str, tuple[float, float]]:
    """Horizontal and vertical sigma [m] that count where a source states none, by the name of the source."""
    kinds, inertial = config.nav.unstated_sd, frozenset(config.nav.attitude)
    return {name: kinds.inertial if name in inertial else kinds.satellites for name in config.nav.position}


def differences(one: PositionState, other: PositionState) -> tuple[float, float | None]:
    """Horizontal and vertical difference [m], not negative; a sphere beyond some hundred kilometres is no matter."""
    meridian, normal = radii(other.lat)
    north = (one.lat - other.lat) * meridian
    east = math.remainder(one.lon - other.lon, 2.0 * math.pi) * normal * math.cos(other.lat)
    high = None if one.alt is None or other.alt is None else abs(one.alt - other.alt)
    return math.hypot(north, east), high


def _valid_sd(sd: float | None) -> float | None:
    return sd if sd is not None and 0.0 < sd < math.inf else None
