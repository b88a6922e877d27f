"""How long a child process that has died waits for its restart.  Times are those of a monotonic clock, in seconds."""

from __future__ import annotations

from typing import Protocol

FIRST_DELAY_S = 0.05
MAX_DELAY_S = 5.0
#: A child that has run for so long has recovered; its next restart is quick again.
RECOVERED_S = 30.0
#: A recorder that dies so soon after its start, so many times one after another, is not started again at once.
EARLY_DEATH_S = 1.0
MAX_EARLY_DEATHS = 3
FIRST_BACK_OFF_S = 0.5


class RestartDelay(Protocol):
    """early_deaths : so many times one after another the child died soon after its start"""

    early_deaths: int

    def after_death(self, lived_s: float) -> float:
        """The delay of the next restart [s].  lived_s : time from the start of the child to its death"""


class DoublingDelay:
    """For a child that is not replaced at once: each restart waits twice as long, until the child has recovered."""

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
    """For a child whose stand-in waits: no delay, unless it dies soon after its start again and again."""

    def __init__(self) -> None:
        self.early_deaths = 0

    def after_death(self, lived_s: float) -> float:
        """See ``RestartDelay``."""
        self.early_deaths = self.early_deaths + 1 if lived_s < EARLY_DEATH_S else 0
        beyond = self.early_deaths - MAX_EARLY_DEATHS
        if beyond < 0:
            return 0.0
        return float(min(FIRST_BACK_OFF_S * 2 ** min(beyond, 10), MAX_DELAY_S))
