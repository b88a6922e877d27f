"""Texts about alarms for a terminal."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from fti.constants import SECOND_NS


def describe_times(alarm: Mapping[str, Any]) -> str:
    """Begin, duration, count and acknowledgement of an alarm."""
    begin = f"{datetime.fromtimestamp(alarm['begin_ns'] // SECOND_NS, UTC):%H:%M:%S}"
    if alarm["end_ns"] is None:
        parts = [f"since {begin}"]
    else:
        parts = [f"{begin}, ended after {(alarm['end_ns'] - alarm['begin_ns']) / SECOND_NS:.1f} s"]
    if alarm["count"] > 1:
        parts.append(f"{alarm['count']} times")
    if alarm["acknowledged_by"]:
        parts.append(f"acknowledged by {alarm['acknowledged_by']}")
    return ", ".join(parts)
