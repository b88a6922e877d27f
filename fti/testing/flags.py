"""Intervals in which a flag is set on a topic."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

Condition = Callable[[dict[str, Any]], bool]
#: Fields of a message that list words.
LISTS = ("flags", "reasons")


class FlagSpan(NamedTuple):
    """A flag is set from the message that has it to the first without it; infinity where none follows [s]."""

    from_s: float
    until_s: float


def spans_of(times_s: Sequence[float], rows: Sequence[dict[str, Any]], flag: str | Condition) -> list[FlagSpan]:
    """Intervals in which a flag is set, in order.  times_s : of the rows, ascending"""
    is_set: Condition = flag if callable(flag) else lambda row: any(flag in (row.get(name) or ()) for name in LISTS)
    spans = list[FlagSpan]()
    begin: float | None = None
    for t_s, row in zip(times_s, rows, strict=True):
        if is_set(row):
            begin = t_s if begin is None else begin
        elif begin is not None:
            spans.append(FlagSpan(begin, t_s))
            begin = None
    return spans if begin is None else [*spans, FlagSpan(begin, math.inf)]


def show(flag: str | Condition) -> str:
    """A flag as text for a failure message."""
    return repr(flag) if isinstance(flag, str) else "of the given condition"
