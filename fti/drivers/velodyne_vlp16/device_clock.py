"""Clock of the scanner: microseconds of an hour, of UTC once a position packet has confirmed it."""

from __future__ import annotations

from typing import NamedTuple

from fti.drivers._nmea_framing import measure_sentence, split
from fti.formats import nmea_fields
from fti.formats.device_time import utc_ns
from fti.messages.measurements import TimeScale

HOUR_NS = 3_600_000_000_000


class Sentence(NamedTuple):
    """A GPRMC sentence.  utc_ns : its time [ns], None if not known; flag : why it confirms no clock, else ''"""

    utc_ns: int | None
    flag: str


def read_sentence(data: bytes) -> Sentence:
    """The sentence of a position packet, which may have none."""
    if not data:
        return Sentence(None, "no_gprmc")
    if measure_sentence(bytearray(data)) != len(data):
        return Sentence(None, "bad_gprmc")
    fields = split(data)
    try:
        of_day, day = nmea_fields.time_of_day(fields[1]), nmea_fields.day(fields[9])
    except (ValueError, IndexError):
        return Sentence(None, "bad_gprmc")
    if fields[2] != "A" or of_day is None or day is None:
        return Sentence(None, "gnss_not_valid")
    return Sentence(utc_ns(day, of_day), "")


class DeviceClock:
    """Completes the time of the packets by the hour, the one that is nearest to the time before."""

    def __init__(self) -> None:
        self._utc_ns: int | None = None
        self._boot_ns = 0

    def set_utc(self, time_us: int, sentence_ns: int | None) -> int | None:
        """UTC of a position packet [ns] from that of its sentence; None: the clock is not that of UTC from here on."""
        self._utc_ns = None if sentence_ns is None else in_nearest_hour(time_us, sentence_ns)
        return self._utc_ns

    def data_time(self, time_us: int) -> tuple[int, TimeScale]:
        """Time [ns] of a data packet, and its scale."""
        if self._utc_ns is not None:
            self._utc_ns = in_nearest_hour(time_us, self._utc_ns)
            return self._utc_ns, TimeScale.UTC
        self._boot_ns = max(in_nearest_hour(time_us, self._boot_ns), 1000 * time_us)
        return self._boot_ns, TimeScale.BOOT


def in_nearest_hour(time_us: int, near_ns: int) -> int:
    """The time [ns] with these microseconds of an hour that is nearest to another one."""
    return near_ns + (1000 * time_us - near_ns + HOUR_NS // 2) % HOUR_NS - HOUR_NS // 2
