"""Times of day and ranges of numbers as text."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

SHOWN_RANGES = 5


def clock_text(t_ns: int) -> str:
    """Time of day to the millisecond."""
    return f"{datetime.fromtimestamp(t_ns / 1e9, UTC):%H:%M:%S.%f}"[:-3]


def ranges_text(ranges: Sequence[tuple[int, int]]) -> str:
    """Ranges of numbers, the first few of many."""
    texts = [str(first) if first == last else f"{first}-{last}" for first, last in ranges[:SHOWN_RANGES]]
    return ", ".join(texts) + (f" and {len(ranges) - SHOWN_RANGES} more ranges" if len(ranges) > SHOWN_RANGES else "")
