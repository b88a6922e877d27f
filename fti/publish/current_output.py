"""Outputs that a sink may send as current: checked against their contract, and not late at the time of sending.

Protocols of other programs have no ``late``: a receiver takes what it gets as the present state.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Generic, TypeVar

from fti.bus.message import MessageError, decode
from fti.messages.topics import OUTPUT_MAX_AGE_MS
from fti.publish.message import PublishedMessage

Value = TypeVar("Value")
#: A value is lost when so many periods of its rate have passed without another one, and HOLD_S.
HOLD_PERIODS, HOLD_S = 2.0, 0.5


def current_fields(message: PublishedMessage, now_s: float) -> dict[str, Any] | None:
    """Fields of an output; None if it is late, or violates the contract of its topic.

    now_s : ``time.monotonic`` [s]
    """
    try:
        fields = decode(message.topic, message.payload)
    except MessageError:
        return None
    age_ms = (fields.get("age_ms") or 0.0) + 1000.0 * (now_s - message.received_s)
    is_late = fields.get("late") or age_ms > fields.get("max_age_ms", OUTPUT_MAX_AGE_MS)
    return None if is_late else fields


def number(fields: Mapping[str, Any], name: str, low: float, high: float) -> float | None:
    """A field as a number; None if it is unknown, or outside low to high."""
    value = fields.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value) if low <= value <= high else None


class LatestValue(Generic[Value]):
    """The latest value, until the next one is overdue.

    rate_hz : of the values [Hz]; initial : the value without a current one
    """

    def __init__(self, rate_hz: float, initial: Value) -> None:
        self._hold_s = HOLD_S + HOLD_PERIODS / rate_hz
        self._initial, self._value = initial, initial
        self._until_s = -math.inf

    def set(self, value: Value, now_s: float) -> None:
        """Replace the value at now_s (``time.monotonic``) [s]."""
        self._value, self._until_s = value, now_s + self._hold_s

    def get(self, now_s: float) -> Value:
        """The value at now_s [s]."""
        return self._value if now_s < self._until_s else self._initial


class Periodic:
    """Says when something is due again, at a constant mean rate."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._next_s = -math.inf

    def is_due(self, now_s: float) -> bool:
        """Is it due at now_s (``time.monotonic``) [s]?  If so, it is due next one period later."""
        if now_s < self._next_s:
            return False
        next_s = self._next_s + self._period_s
        self._next_s = next_s if next_s > now_s else now_s + self._period_s
        return True
