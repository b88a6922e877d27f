"""Which altimeters hold the altitude of navigation alone.

Without satellites and barometer the heights of an altimeter over known ground hold the altitude of the filter, of the
vertical channel and of the fix by radio.  Each of its samples is then compared with a prediction from its own older
samples: a drift that is slow enough passes, and the altitude follows.  With a radar 100 m above level ground the
fastest drift that passed for a minute was 1 m/s with an inertial unit of navigation grade, 1.5 m/s of tactical grade
and 3.5 m/s of MEMS; a fix by radio follows any.  The sigmas of height and altitude are those of sound altimeters all
the same, as over unknown ground.  An event says who holds the altitude, and NOT_INDEPENDENT in ``unchecked`` that the
comparison is no check.
"""

from __future__ import annotations

from collections.abc import Sequence

from fti.nav.time_series import SECOND_NS

#: Another source bounds the altitude for so long after its last measurement, an altimeter holds it for so long [ns].
OTHER_NS, HOLD_NS = 2 * SECOND_NS, 5 * SECOND_NS


class HoldMonitor:
    """Of the altitude of one source.  altimeters : that hold it; none while another source bounds it"""

    def __init__(self) -> None:
        self.altimeters: tuple[str, ...] = ()

    def update(self, t_ns: int, other_ns: int | None, altimeters: Sequence[str]) -> None:
        """Take the state at a time; an altimeter that stops goes on holding what its last heights made.

        other_ns : when another source bounded the altitude last;  altimeters : those that have bounded it lately
        """
        if other_ns is not None and t_ns - other_ns <= OTHER_NS:
            self.altimeters = ()
        elif altimeters:
            self.altimeters = tuple(altimeters)
