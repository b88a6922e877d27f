"""State of a u-blox receiver: GPS week, fix, and incomplete ephemerides."""

from __future__ import annotations

from fti.constants import SECOND_NS
from fti.drivers._lnav import Subframe
from fti.formats.device_time import WEEK_S, gps_ns
from fti.messages.measurements import Stamp, TimeScale

WEEK_MS = WEEK_S * 1000
_HALF_WEEK_MS = WEEK_MS // 2
UNKNOWN_U32 = 0xFFFFFFFF


class ReceiverState:
    """Most messages have only the time of the week (iTOW); the week comes from others.

    fix : is the newest stated fix valid?  None before the first
    """

    def __init__(self) -> None:
        self.fix: bool | None = None
        self._week: int | None = None
        self._itow_ms = 0
        self._subframes: dict[int, dict[int, Subframe]] = {}  # by satellite and number

    def add_subframe(self, satellite: int, subframe: Subframe) -> tuple[Subframe, ...]:
        """Subframes 1, 2 and 3 of a GPS satellite if this one completes them; otherwise none."""
        if subframe.issue is None:
            return ()
        parts = self._subframes.setdefault(satellite, {})
        parts[subframe.number] = subframe
        if len(parts) < 3 or len({part.issue for part in parts.values()}) != 1:
            return ()
        del self._subframes[satellite]
        return parts[1], parts[2], parts[3]

    def set_week(self, week: int, itow_ms: int) -> None:
        """Set the week of this time."""
        self._week, self._itow_ms = week, itow_ms

    def clear_week(self) -> None:
        """Clear the week: the receiver was restarted and does not know the time."""
        self._week = None

    def stamp(self, t_rx_ns: int, itow_ms: int) -> Stamp:
        """GPS time of a message with time of the week [ms]; without device time if the week is unknown."""
        if self._week is None or itow_ms >= WEEK_MS:
            return Stamp(t_rx_ns)
        week, difference_ms = self._week, itow_ms - self._itow_ms
        if difference_ms < -_HALF_WEEK_MS:
            week += 1
            self.set_week(week, itow_ms)
        elif difference_ms > _HALF_WEEK_MS:  # of the previous week
            week -= 1
        return Stamp(t_rx_ns, gps_ns(week, itow_ms * SECOND_NS // 1000), TimeScale.GPS)


def metres(millimetres: int) -> float | None:
    """An accuracy from mm; None if it has the value for unknown."""
    return None if millimetres == UNKNOWN_U32 else millimetres / 1000
