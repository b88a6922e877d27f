"""Protection levels of the position that navigation uses, from any device.

    compared with the filter     HPL = |x - x_0| + HPL of the filter      x_0 : the filter at the same time
    nothing to compare with      HPL = 4.80 sigma, VPL = 4.42 sigma; marked in ``unchecked``

The filter's levels cover faults of its sources (``fti.nav.separation.protection``), so the first formula holds for any
stated sigma of the device.  A sigma that is not stated is that of ``[nav.unstated_sd]``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from fti.config import AlertLimits, Config
from fti.geodesy.formulas import metres_per_radian
from fti.messages.reasons import Reason
from fti.nav.source_interpolation import PositionState

K_RADIAL, K_AXIS = 4.80, 4.42


class Protection(NamedTuple):
    """Horizontal and vertical protection level [m], None without position or height.

    unchecked : why they depend on the sigma of the source only;  assumed : whether that sigma is not stated
    """

    horizontal: float | None
    vertical: float | None
    unchecked: tuple[Reason, ...] = ()
    assumed: bool = False


class FilterReference(NamedTuple):
    """A position of the filter and its protection levels [m].

    aided_by  : devices whose positions aid it;  refused : those of them that are excluded
    unchecked : why the levels do not fully hold yet
    """

    position: PositionState
    horizontal: float
    vertical: float
    aided_by: frozenset[str] = frozenset()
    refused: frozenset[str] = frozenset()
    unchecked: tuple[Reason, ...] = ()


def compare_with_filter(position: PositionState, reference: FilterReference) -> Protection:
    """Protection of a position by comparison with the filter at the same time."""
    horizontal, vertical_difference = differences(position, reference.position)
    vertical = None if vertical_difference is None else vertical_difference + reference.vertical
    return Protection(horizontal + reference.horizontal, vertical, reference.unchecked)


def stated_levels(position: PositionState, assumed: tuple[float, float]) -> Protection:
    """Protection of a position by its sigma.  assumed : horizontal and vertical sigma if it states none [m]"""
    horizontal_sd, vertical_sd = _valid_sd(position.horizontal_sd), _valid_sd(position.vertical_sd)
    is_assumed = horizontal_sd is None or (position.alt is not None and vertical_sd is None)
    horizontal = K_RADIAL * (assumed[0] if horizontal_sd is None else horizontal_sd)
    vertical = None if position.alt is None else K_AXIS * (assumed[1] if vertical_sd is None else vertical_sd)
    return Protection(horizontal, vertical, (Reason.NOTHING_TO_COMPARE,), is_assumed)


def extrapolate_levels(levels: Protection, last: PositionState, current: PositionState, seconds: float) -> Protection:
    """Levels some seconds after the comparison, enlarged by position changes that the velocity does not explain.

    A fix that repeats the previous one is wrong by 0.2 s of flight: its error grows by that at once.
    """
    if Reason.NOTHING_TO_COMPARE in levels.unchecked or last.north is None or last.east is None:
        return levels
    north, east = _level_difference(current, last)
    north, east = north - last.north * seconds, east - last.east * seconds
    up = 0.0 if current.alt is None or last.alt is None else current.alt - last.alt + (last.down or 0.0) * seconds
    horizontal = None if levels.horizontal is None else levels.horizontal + math.hypot(north, east)
    vertical = None if levels.vertical is None else levels.vertical + abs(up)
    return levels._replace(horizontal=horizontal, vertical=vertical)


def is_beyond(levels: Protection, limits: AlertLimits) -> bool:
    """Whether a level is above its alert limit; never for an assumed sigma, which is not that of the source."""
    if levels.assumed:
        return False
    horizontal, vertical = levels.horizontal or 0.0, levels.vertical or 0.0
    return horizontal > limits.position_m or vertical > limits.altitude_m


def unstated_sigmas(config: Config) -> Mapping[str, tuple[float, float]]:
    """Horizontal and vertical sigma [m] if a source states none, by the name of the source."""
    kinds, inertial = config.nav.unstated_sd, frozenset(config.nav.attitude)
    return {name: kinds.inertial if name in inertial else kinds.satellites for name in config.nav.position}


def differences(one: PositionState, other: PositionState) -> tuple[float, float | None]:
    """Horizontal and vertical difference [m], not negative; approximate beyond some hundred kilometres."""
    vertical = None if one.alt is None or other.alt is None else abs(one.alt - other.alt)
    return math.hypot(*_level_difference(one, other)), vertical


def _level_difference(one: PositionState, other: PositionState) -> tuple[float, float]:
    """North and east of one from the other [m]."""
    per_lat, per_lon = metres_per_radian(other.lat, 0.0)
    return (one.lat - other.lat) * per_lat, math.remainder(one.lon - other.lon, math.tau) * per_lon


def _valid_sd(sd: float | None) -> float | None:
    return sd if sd is not None and 0.0 < sd < math.inf else None
