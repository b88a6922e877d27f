"""Detects that altimeters are the only sources that bound the altitude of navigation.

Without satellites and barometer the heights of an altimeter over known ground bound the altitude of the filter, of the
vertical channel and of the radio fix.  Each of its samples is then compared with a prediction from its own older
samples: a slow drift passes, and the altitude follows.  With a radar 100 m above level ground the fastest drift that
passed for a minute was 1 m/s with an inertial unit of navigation grade, 1.5 m/s of tactical grade and 3.5 m/s of MEMS;
a radio fix follows any drift.  The sigmas of height and altitude remain those of sound altimeters, as over unknown
ground.  An event reports the altimeters; NOT_INDEPENDENT in ``unchecked`` marks that the comparison is no test.
"""

from __future__ import annotations

from collections.abc import Mapping

from fti.constants import SECOND_NS

#: Time after its last measurement for which another source, or an altimeter, bounds the altitude [ns].
OTHER_NS, HOLD_NS = 2 * SECOND_NS, 5 * SECOND_NS


class HoldMonitor:
    """Of the altitude of one source.  altimeters : that alone bound it; none while another source bounds it"""

    def __init__(self) -> None:
        self.altimeters: tuple[str, ...] = ()

    def update(self, t_ns: int, other_ns: int | None, altimeters_ns: Mapping[str, int]) -> None:
        """Update at a time; an altimeter that stops still counts, because its last heights determine the altitude.

        other_ns : last time when another source bounded the altitude;  altimeters_ns : those of altimeters, by name
        """
        if other_ns is not None and t_ns - other_ns <= OTHER_NS:
            self.altimeters = ()
        elif holding := sorted(name for name, last_ns in altimeters_ns.items() if t_ns - last_ns <= HOLD_NS):
            self.altimeters = tuple(holding)
