"""Delay before a child process is restarted.  Times: monotonic clock [s]."""

from __future__ import annotations

from typing import Protocol

FIRST_DELAY_S = 0.05
MAX_DELAY_S = 5.0
#: A child that has run for this time has recovered; its next restart delay is the first one again.
RECOVERED_S = 30.0
#: A recorder is not restarted at once after this many consecutive exits within this time after the start.
EARLY_DEATH_S = 1.0
MAX_EARLY_DEATHS = 3
FIRST_BACK_OFF_S = 0.5


class RestartDelay(Protocol):
    """early_deaths : number of consecutive exits soon after the start"""

    early_deaths: int

    def after_death(self, lived_s: float) -> float:
        """The delay of the next restart [s].  lived_s : run time of the child"""


class DoublingDelay:
    """For a child without a standby process: each delay is twice the last one, until the child has recovered."""

    def __init__(self) -> None:
        self.early_deaths = 0
        self._next_s = FIRST_DELAY_S

    def after_death(self, lived_s: float) -> float:
        """See ``RestartDelay``."""
        if lived_s > RECOVERED_S:
            self._next_s = FIRST_DELAY_S
        delay_s, self._next_s = self._next_s, min(2 * self._next_s, MAX_DELAY_S)
        return delay_s


class StandbyDelay:
    """For a child with a standby process: no delay, except after repeated exits soon after the start."""

    def __init__(self) -> None:
        self.early_deaths = 0

    def after_death(self, lived_s: float) -> float:
        """See ``RestartDelay``."""
        self.early_deaths = self.early_deaths + 1 if lived_s < EARLY_DEATH_S else 0
        excess = self.early_deaths - MAX_EARLY_DEATHS
        if excess < 0:
            return 0.0
        return float(min(FIRST_BACK_OFF_S * 2 ** min(excess, 10), MAX_DELAY_S))
