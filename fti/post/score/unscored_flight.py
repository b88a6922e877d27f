"""A flight that could not be scored."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class UnscoredFlight:
    """Why there is no score.

    name : of the scenario or session; reason : one sentence; exit_code : of the command
    """

    name: str
    reason: str
    exit_code: int
