"""Detects a go-around by the climb rate."""

from __future__ import annotations

GO_AROUND_CLIMB = 2.0
GO_AROUND_NS = 3_000_000_000


class GoAround:
    """Begins after a climb of more than 2 m/s for 3 s, ends after 3 s without."""

    def __init__(self) -> None:
        self.active = False
        self._since_ns: int | None = None

    def step(self, t_ns: int, climb: float | None) -> bool:
        """Whether a go-around is in progress."""
        climbing = climb is not None and climb > GO_AROUND_CLIMB
        if climbing == self.active:
            self._since_ns = None
        elif self._since_ns is None:
            self._since_ns = t_ns
        elif t_ns - self._since_ns >= GO_AROUND_NS:
            self.active, self._since_ns = climbing, None
        return self.active
