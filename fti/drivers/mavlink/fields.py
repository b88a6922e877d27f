"""Common parts of MAVLink decoding: stamps, unknown values, settings."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from fti.messages.measurements import Measurement, Stamp, TimeScale

UNKNOWN_U16 = 0xFFFF
#: A time above this [us] is UNIX time, below it time since boot (MAVLink rule).
UNIX_US = 10**15


class Settings(NamedTuple):
    """Settings of the readers.

    height : datum of alt in GLOBAL_POSITION_INT; raw_imu : scale of RAW_IMU
    sender : system and component of our commands; named_values : accepted names of NAMED_VALUE_FLOAT
    """

    height: str
    raw_imu: str
    sender: tuple[int, int]
    named_values: frozenset[str] = frozenset()


#: Fields, t_rx_ns and settings to measurements.
Reader = Callable[[Any, int, Settings], list[Measurement]]


def stamp_from_boot_ms(t_rx_ns: int, milliseconds: int) -> Stamp:
    """A stamp of the time since the autopilot was switched on; 0 means no time."""
    return Stamp(t_rx_ns, milliseconds * 1_000_000, TimeScale.BOOT) if milliseconds else Stamp(t_rx_ns)


def stamp_from_us(t_rx_ns: int, microseconds: int) -> Stamp:
    """A stamp of a time that is UNIX or since boot."""
    return stamp_from_ns(t_rx_ns, microseconds * 1000)


def stamp_from_ns(t_rx_ns: int, nanoseconds: int) -> Stamp:
    """``stamp_from_us`` in ns."""
    if not nanoseconds:
        return Stamp(t_rx_ns)
    return Stamp(t_rx_ns, nanoseconds, TimeScale.UTC if nanoseconds > UNIX_US * 1000 else TimeScale.BOOT)


def scaled_or_none(value: int, unknown: int, factor: float) -> float | None:
    """A value in SI; None if it is the one that means unknown."""
    return None if value == unknown else value * factor


def all_finite(*values: float) -> bool:
    """Are all of them finite?"""
    return all(map(math.isfinite, values))
