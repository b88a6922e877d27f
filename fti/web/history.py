"""History of the plotted values: the last two minutes, five rows per second, on one time axis."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

SPAN_NS = 120_000_000_000
PERIOD_NS = 200_000_000
GAP_NS = 1_000_000_000  # a longer interruption is a gap in the lines
HEIGHT = "/nav/height_above_ground/"
GLIDE = "/nav/glide_slope"


class History:
    """Rows of ``{series: value}``; a series is ``topic:field``, an invalid value is None."""

    def __init__(self) -> None:
        self._rows: deque[tuple[int, dict[str, float | None]]] = deque()
        self._now: dict[str, float | None] = {}

    def update(self, topic: str, fields: Mapping[str, Any]) -> None:
        """Handle an output; add a row if the last one is old enough."""
        if not topic.startswith((HEIGHT, GLIDE)) or not isinstance(fields.get("t_ns"), int):
            return
        self._now |= _values(topic, fields)
        t_ns = fields["t_ns"]
        last_ns = self._rows[-1][0] if self._rows else t_ns - PERIOD_NS
        if t_ns - last_ns > GAP_NS:
            self._rows.append((last_ns + PERIOD_NS, {}))
        if t_ns - last_ns >= PERIOD_NS:
            self._rows.append((t_ns, dict(self._now)))
            self._forget(t_ns - SPAN_NS)

    def _forget(self, before_ns: int) -> None:
        while self._rows and self._rows[0][0] < before_ns:
            self._rows.popleft()

    def message(self) -> dict[str, Any]:
        """``{"type": "history", "t": [s], "series": {name: [value]}}``."""
        series = {name: [row.get(name) for _, row in self._rows] for name in sorted(self._now)}
        return {"type": "history", "t": [t_ns / 1e9 for t_ns, _ in self._rows], "series": series}


def _values(topic: str, fields: Mapping[str, Any]) -> dict[str, float | None]:
    valid = bool(fields.get("valid")) and not fields.get("late")
    if topic.startswith(HEIGHT):
        raw = None if fields.get("late") else fields.get("raw")
        return {f"{topic}:raw": raw, f"{topic}:height_agl": fields.get("height_agl") if valid else None}
    return {f"{topic}:{name}": fields.get(name) if valid else None for name in ("deviation", "dh")}
