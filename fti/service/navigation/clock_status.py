"""Status of a device clock for health: offset as time of day, standard deviations, share of late messages."""

from __future__ import annotations

from fti.formats.device_time import GPS_EPOCH_UTC_NS, LEAP_NS
from fti.messages.health import ClockHealth
from fti.messages.measurements import TimeScale
from fti.messages.notes import ClockEstimate

NS_PER_MS = 1e6


def clock_status(known: ClockEstimate, *, used: bool) -> ClockHealth:
    """Health of a clock.  used : validity times are taken from it (``use_device_time``)"""
    offset_ns = known.offset_ns + (GPS_EPOCH_UTC_NS - LEAP_NS if known.scale == TimeScale.GPS else 0)
    return ClockHealth(
        scale=known.scale,
        state=known.state,
        used=used,
        offset_ms=offset_ns / NS_PER_MS,
        offset_sd_ms=None if known.offset_sd_ns is None else known.offset_sd_ns / NS_PER_MS,
        drift_ppm=known.drift_ppm,
        drift_sd_ppm=known.drift_sd_ppm,
        late_share=known.late / known.messages if known.messages else 0.0,
        messages=known.messages,
        refused=known.refused,
    )
