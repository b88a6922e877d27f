"""Selects the altimeter that gives the height below the aircraft.

The selected altimeter is kept while it is valid.  When it becomes invalid, the valid one with the smallest sigma
replaces it.  A valid one whose sigma is less than ``SWITCH_SIGMA_RATIO`` times as large replaces it after
``SWITCH_DELAY_NS``, if this held for every sample of both: two altimeters with equal sigmas do not alternate.

Each output of the selected altimeter makes one HeightBelowAircraft.  While none is valid, each output of the last
selected one, or of the first in the configuration, makes an invalid one.  An output that is not newer than the last one
makes none.
"""

from __future__ import annotations

from collections.abc import Sequence

from fti.constants import SECOND_NS
from fti.messages.outputs import HeightAboveGround, HeightBelowAircraft
from fti.messages.reasons import Reason

SWITCH_SIGMA_RATIO = 0.7
SWITCH_DELAY_NS = 2 * SECOND_NS


class HeightSelector:
    """Selects among altimeters.  names : all of them, in order of preference"""

    def __init__(self, names: Sequence[str]) -> None:
        self._latest: dict[str, HeightAboveGround | None] = dict.fromkeys(names)
        self._chosen = next(iter(names), None)
        self._better_since: dict[str, int] = {}
        self._newest_ns = -1

    def feed(self, height: HeightAboveGround) -> list[HeightBelowAircraft]:
        """Add an output of an altimeter; returns the height below the aircraft if this output makes one."""
        self._latest[height.sensor] = height
        self._choose(height.t_ns)
        if height.sensor != self._chosen:
            return []
        if height.valid and height.t_valid_ns is not None:
            if height.t_valid_ns <= self._newest_ns:
                return []
            self._newest_ns = height.t_valid_ns
        return [_below(height)]

    def _choose(self, t_ns: int) -> None:
        valid = {name: _sd(height) for name, height in self._latest.items() if height is not None and height.valid}
        if not valid:
            return
        if self._chosen not in valid:
            self._chosen = min(valid, key=valid.__getitem__)
            self._better_since.clear()
        limit = SWITCH_SIGMA_RATIO * valid[self._chosen]
        self._better_since = {name: self._better_since.get(name, t_ns) for name, sd in valid.items() if sd < limit}
        for name, since_ns in self._better_since.items():
            if t_ns - since_ns >= SWITCH_DELAY_NS:
                self._chosen = name
                self._better_since = {}
                return


def _sd(height: HeightAboveGround) -> float:
    return float("inf") if height.sd is None else height.sd


def _below(height: HeightAboveGround) -> HeightBelowAircraft:
    return HeightBelowAircraft(
        t_ns=height.t_ns,
        t_valid_ns=height.t_valid_ns,
        sensor=height.sensor,
        height_agl=height.height_agl if height.valid else None,
        sd=height.sd if height.valid else None,
        valid=height.valid,
        reasons=() if height.valid else (Reason.NO_HEIGHT,),
        compensation=height.compensation if height.valid else None,
    )
