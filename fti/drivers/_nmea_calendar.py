"""The date of an NMEA 0183 receiver: some sentences carry it, most carry only the time of day."""

from __future__ import annotations

from datetime import date, timedelta

from fti.constants import SECOND_NS
from fti.formats.device_time import utc_ns
from fti.messages.measurements import Stamp, TimeScale

DAY_NS = 86_400 * SECOND_NS
HALF_DAY_NS = DAY_NS // 2


class Calendar:
    """The date of the receiver, if known."""

    def __init__(self) -> None:
        self._day: date | None = None
        self._of_day_ns = 0

    def set(self, day: date, of_day_ns: int) -> None:
        """Set date and time of day from a sentence."""
        self._day, self._of_day_ns = day, of_day_ns

    def clear(self) -> None:
        """Clear the date: the receiver was restarted and does not know it."""
        self._day = None

    def stamp(self, t_rx_ns: int, of_day_ns: int | None) -> Stamp:
        """The stamp of a sentence with a time of the day; without device time if the date is unknown."""
        if of_day_ns is None or self._day is None:
            return Stamp(t_rx_ns)
        if of_day_ns < self._of_day_ns - HALF_DAY_NS:
            self.set(self._day + timedelta(days=1), of_day_ns)
        elif of_day_ns <= self._of_day_ns + HALF_DAY_NS:
            self._of_day_ns = of_day_ns
        else:  # of the previous day
            return Stamp(t_rx_ns, utc_ns(self._day - timedelta(days=1), of_day_ns), TimeScale.UTC)
        return Stamp(t_rx_ns, utc_ns(self._day, of_day_ns), TimeScale.UTC)
