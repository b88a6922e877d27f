"""What the fields of MAVLink messages have in common: stamps, unknown values, and what the readers must be told."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from fti.types import Measurement, Stamp, TimeScale

UNKNOWN_U16 = 0xFFFF
#: A time in us above this is UNIX time, below it time since boot (the field's own rule: tell by the magnitude).
UNIX_US = 10**15


class Settings(NamedTuple):
    """What the options say to the readers.

    height : what GLOBAL_POSITION_INT means by alt; raw_imu : what the numbers of RAW_IMU are
    sender : system and component that our commands come from; named : values of NAMED_VALUE_FLOAT that are taken
    """

    height: str
    raw_imu: str
    sender: tuple[int, int]
    named_values: frozenset[str] = frozenset()


#: Fields, t_rx_ns and settings to measurements.
Reader = Callable[[Any, int, Settings], list[Measurement]]


def stamp_from_boot_ms(t_rx_ns: int, milliseconds: int) -> Stamp:
    """A stamp of the time since the autopilot was switched on; 0 is what a sender fills in that tells no time."""
    return Stamp(t_rx_ns, milliseconds * 1_000_000, TimeScale.BOOT) if milliseconds else Stamp(t_rx_ns)


def stamp_from_us(t_rx_ns: int, microseconds: int) -> Stamp:
    """A stamp of a time that is UNIX or since boot."""
    return stamp_from_ns(t_rx_ns, microseconds * 1000)


def stamp_from_ns(t_rx_ns: int, nanoseconds: int) -> Stamp:
    """The same in ns."""
    if not nanoseconds:
        return Stamp(t_rx_ns)
    return Stamp(t_rx_ns, nanoseconds, TimeScale.UTC if nanoseconds > UNIX_US * 1000 else TimeScale.BOOT)


def known(value: int, unknown: int, factor: float) -> float | None:
    """A value in SI; None when it is the one that means unknown."""
    return None if value == unknown else value * factor


def all_finite(*values: float) -> bool:
    """Are all of them numbers?"""
    return all(map(math.isfinite, values))
