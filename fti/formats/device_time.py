"""Device time scales: GPS week and second, UTC calendar, and the device time of the emulator.

GPS time counts from 1980-01-06 without leap seconds, UTC from 1970-01-01.  GPS - UTC = 18 s since 2017-01-01
(IERS Bulletin C 52); earlier dates (older captures) are not converted.
"""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta

from fti.constants import SECOND_NS
from fti.messages.measurements import Stamp, TimeScale

WEEK_S = 604_800
GPS_EPOCH_UTC_NS = 315_964_800 * SECOND_NS
LEAP_NS = 18 * SECOND_NS
_UNIX_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def gps_ns(week: int, second_ns: int) -> int:
    """GPS time [ns] of a week number and the time in the week [ns]."""
    return week * WEEK_S * SECOND_NS + second_ns


def gps_week(t_gps_ns: int) -> tuple[int, int]:
    """Week number and time in the week [ns]."""
    return divmod(max(t_gps_ns, 0), WEEK_S * SECOND_NS)


def utc_ns(day: date, of_day_ns: int) -> int:
    """UTC [ns] of a date and the time of the day [ns]."""
    return (day.toordinal() - _UNIX_EPOCH.toordinal()) * 86_400 * SECOND_NS + of_day_ns


def utc_date(t_utc_ns: int) -> tuple[date, int]:
    """Date and time of the day [ns]."""
    days, of_day_ns = divmod(max(t_utc_ns, 0), 86_400 * SECOND_NS)
    return (_UNIX_EPOCH + timedelta(days=days)).date(), of_day_ns


def device_time_ns(stamp: Stamp, scale: TimeScale) -> int:
    """Device time of an emulated device [ns] in its scale: that of the stamp, otherwise t_rx_ns as UTC."""
    if stamp.t_dev_ns is not None and stamp.time_scale is scale:
        return stamp.t_dev_ns
    utc = stamp.t_rx_ns
    if stamp.t_dev_ns is not None and stamp.time_scale is TimeScale.UTC:
        utc = stamp.t_dev_ns
    elif stamp.t_dev_ns is not None and stamp.time_scale is TimeScale.GPS:
        utc = stamp.t_dev_ns + GPS_EPOCH_UTC_NS - LEAP_NS
    return max(utc - GPS_EPOCH_UTC_NS + LEAP_NS, 0) if scale is TimeScale.GPS else utc
