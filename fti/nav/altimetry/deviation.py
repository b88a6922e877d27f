"""Refusals by the known ground over time: a deviating altimeter stays refused while the ground is unknown.

A refusal is in force when samples deviate for 0.5 s, three or more of them, and agree for less than 0.3 s in between:
the edges of woods are farther apart.  Meanwhile, samples that the ground cannot check (no position, no altitude, the
edge of the terrain) are refused, too.  The refusal ends after 1 s of checked samples that do not deviate, three or
more, or without a check for 20 times the duration of the deviation, 10 minutes at most: an unmapped wood is short, fog
is not.  Where the gate is as wide as twice its limit, a sample within the limit itself does not deviate; one beyond it,
within the gate, is not checked.  In a bank, at grazing incidence and over uneven ground a deviation is inconclusive.
All times are chosen, not measured.
"""

from __future__ import annotations

from fti.constants import SECOND_NS

#: Duration [ns] and samples of a deviation that begin a refusal; agreement that resets the count [ns].
BEGIN_NS, BEGIN_COUNT, RESET_NS = SECOND_NS // 2, 3, 3 * SECOND_NS // 10
#: Agreement that ends a refusal [ns], and its samples.
END_NS, END_COUNT = SECOND_NS, 3
#: Without a check a refusal ends after this multiple of its deviation, and after this time at most [ns].
UNCHECKED_SHARE, MAX_UNCHECKED_NS = 20, 600 * SECOND_NS
#: Time without a deviation, or without an agreeing sample, that resets the count of these: more than two samples at
#: 1 Hz [ns].
MAX_GAP_NS = 5 * SECOND_NS // 2


class DeviationMemory:
    """State of one altimeter.  since_ns : first sample of the refusal in force [ns]; None: no refusal"""

    def __init__(self) -> None:
        self.since_ns: int | None = None
        self._last_ns = self._checked_ns = self._deviated_ns = 0
        self._lasted_ns = 0  # duration of the deviation without unchecked time
        self._first_ns: int | None = None
        self._count = 0
        self._agrees_ns: int | None = None
        self._agreed_ns = self._agreements = 0

    def update(self, t_ns: int, deviates: bool | None) -> bool:
        """Whether a refusal is in force.  deviates : None where the ground cannot check"""
        if t_ns <= self._last_ns:
            return self.since_ns is not None
        self._last_ns = t_ns
        if deviates is not None:
            self._checked_ns = t_ns
        if deviates:
            self._count_deviation(t_ns)
        elif deviates is None:
            self._miss_check(t_ns)
        else:
            self._count_agreement(t_ns)
        return self.since_ns is not None

    def forget(self) -> None:
        """No refusal is in force."""
        self.since_ns = self._first_ns = self._agrees_ns = None
        self._count = self._lasted_ns = 0

    @property
    def agreements(self) -> int:
        """Consecutive agreeing samples, of those that the ground checked."""
        return 0 if self._agrees_ns is None else self._agreements

    def _miss_check(self, t_ns: int) -> None:
        if self.since_ns is None:
            return
        unchecked_ns = min(UNCHECKED_SHARE * self._lasted_ns, MAX_UNCHECKED_NS)
        if t_ns - self._checked_ns > unchecked_ns:
            self.forget()

    def _count_deviation(self, t_ns: int) -> None:
        if self.since_ns is None and t_ns - self._deviated_ns > MAX_GAP_NS:
            self.forget()
        if self._first_ns is not None:
            self._lasted_ns += min(t_ns - self._deviated_ns, MAX_GAP_NS)
        self._agrees_ns, self._deviated_ns = None, t_ns
        self._first_ns = t_ns if self._first_ns is None else self._first_ns
        self._count += 1
        if self._count >= BEGIN_COUNT and t_ns - self._first_ns >= BEGIN_NS and self.since_ns is None:
            self.since_ns = self._first_ns

    def _count_agreement(self, t_ns: int) -> None:
        if self._agrees_ns is None or t_ns - self._agreed_ns > MAX_GAP_NS:
            self._agrees_ns, self._agreements = t_ns, 0
        self._agreed_ns, self._agreements = t_ns, self._agreements + 1
        lasted_ns = t_ns - self._agrees_ns
        if (lasted_ns >= END_NS and self._agreements >= END_COUNT) or (self.since_ns is None and lasted_ns >= RESET_NS):
            self.forget()
