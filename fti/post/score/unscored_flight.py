"""A flight of several that could not be judged."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class UnscoredFlight:
    """Why there is no score.

    name : the scenario or session as it was named; reason : one sentence; exit_code : of the command, because of it
    """

    name: str
    reason: str
    exit_code: int
