"""The clock of a device as a person reads it: its offset as time of day, how far it can be believed, what came late."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fti.drivers._times import GPS_EPOCH_UTC_NS, LEAP_NS
from fti.types import TimeScale

NS_PER_MS = 1e6


def clock_status(known: Mapping[str, Any], *, used: bool) -> dict[str, Any]:
    """Health of a clock that ``fti.nav.device_times.describe`` has told.

    offset_ms  : device - FTI time; GPS time is shown as UTC, so that the difference is one that can be read
    late_share : of the messages since the clock is what it is, those beyond what is usual
    refused    : messages that did not fit at all
    used       : validity times are taken from it (``use_device_time``)
    """
    offset_ns = known["offset_ns"] + (GPS_EPOCH_UTC_NS - LEAP_NS if known["scale"] == TimeScale.GPS else 0)
    return {
        "scale": known["scale"],
        "state": known["state"],
        "used": used,
        "offset_ms": offset_ns / NS_PER_MS,
        "offset_sd_ms": None if known["offset_sd_ns"] is None else known["offset_sd_ns"] / NS_PER_MS,
        "drift_ppm": known["drift_ppm"],
        "drift_sd_ppm": known["drift_sd_ppm"],
        "late_share": known["late"] / known["messages"] if known["messages"] else 0.0,
        "messages": known["messages"],
        "refused": known["refused"],
    }
