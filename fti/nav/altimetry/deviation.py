"""Memory of refusals by the known ground: who deviates stays refused while the ground cannot be asked.

A refusal is in force when samples deviate for 0.5 s, three or more of them, and agree for less than 0.3 s in between:
the edges of woods follow each other less closely.  While it is, samples that the ground cannot check (no position, no
altitude, the edge of the terrain) are refused, too.  It ends after 1 s of checked samples that do not deviate, or when
none could be checked for 20 times as long as it deviated, 10 minutes at most: a wood that nobody knows is short, fog is
not.  Where the gate is as wide as twice its limit, a sample within the limit itself does not deviate; one beyond it,
within the gate, is not checked.  In a bank, and where the beam grazes the ground or meets ground that is uneven, a
deviation proves nothing.
Stated, not measured: all times.
"""

from __future__ import annotations

from fti.nav.series import SECOND_NS

#: A refusal begins after so long, and so many samples; agreement that begins the count anew; that ends a refusal [ns].
BEGIN_NS, BEGIN_COUNT, RESET_NS, END_NS = SECOND_NS // 2, 3, 3 * SECOND_NS // 10, SECOND_NS
#: Without a check a refusal ends after so many times its deviations, and after this time at most [ns].
UNCHECKED_SHARE, MAX_UNCHECKED_NS = 20, 600 * SECOND_NS
#: So long without a deviation, and without a check, the count begins anew [ns].
MAX_GAP_NS = SECOND_NS


class DeviationMemory:
    """Of one altimeter.  since_ns : first sample of the refusal that is in force [ns]; None : none is"""

    def __init__(self) -> None:
        self.since_ns: int | None = None
        self._last_ns = self._checked_ns = self._deviated_ns = 0
        self._first_ns: int | None = None
        self._count = 0
        self._agrees_ns: int | None = None

    def update(self, t_ns: int, deviates: bool | None) -> bool:
        """Whether a refusal is in force.  deviates : None where the ground cannot be asked"""
        if t_ns <= self._last_ns:
            return self.since_ns is not None
        self._last_ns = t_ns
        if deviates is not None:
            self._checked_ns = t_ns
        if deviates:
            self._count_deviation(t_ns)
        elif deviates is None:
            self._miss_check(t_ns)
        elif self._agrees_for(t_ns) >= (RESET_NS if self.since_ns is None else END_NS):
            self.forget()
        return self.since_ns is not None

    def forget(self) -> None:
        """No refusal is in force."""
        self.since_ns = self._first_ns = self._agrees_ns = None
        self._count = 0

    def _miss_check(self, t_ns: int) -> None:
        self._agrees_ns = None
        if self.since_ns is None:
            is_over = t_ns - self._deviated_ns > MAX_GAP_NS
        else:
            unchecked_ns = min(UNCHECKED_SHARE * (self._deviated_ns - self.since_ns), MAX_UNCHECKED_NS)
            is_over = t_ns - self._checked_ns > unchecked_ns
        if is_over:
            self.forget()

    def _count_deviation(self, t_ns: int) -> None:
        self._agrees_ns, self._deviated_ns = None, t_ns
        self._first_ns = t_ns if self._first_ns is None else self._first_ns
        self._count += 1
        if self._count >= BEGIN_COUNT and t_ns - self._first_ns >= BEGIN_NS and self.since_ns is None:
            self.since_ns = self._first_ns

    def _agrees_for(self, t_ns: int) -> int:
        self._agrees_ns = t_ns if self._agrees_ns is None else self._agrees_ns
        return t_ns - self._agrees_ns
