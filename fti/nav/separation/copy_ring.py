"""A ring of copies of different ages that go without the same sources.

Every ``step_ns`` the oldest copy is replaced by one that begins now, so that four copies have ages of up to 1, 2, 3
and 4 steps.  An old copy has seen more of a slow fault, and has drifted more itself; which age sees a ramp best
depends on the inertial unit.  No copy is replaced while its sources are suspected or silent: what one holds then may
be wrong.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from fti.nav.filter.segment import Moment, Piece
from fti.nav.separation.copies import FilterCopy, Separation, separate


@dataclass(frozen=True, slots=True)
class RingSettings:
    """How many copies, and how often one is replaced [ns]; None: never, one copy begins with the ladder."""

    copies: int
    step_ns: int | None

    @property
    def max_age_ns(self) -> int | None:
        """Age of the oldest copy when it is replaced [ns]; None: never."""
        return None if self.step_ns is None else self.copies * self.step_ns


class CopyRing:
    """Of one class of sources, by their names as ``Aiding``.

    removed : what its copies go without;  tested : those of them that are compared with the oldest copy
    """

    def __init__(self, removed_names: frozenset[str], tested: frozenset[str], settings: RingSettings) -> None:
        self.removed_names, self.tested = removed_names, tested
        self._settings = settings
        self._copies: deque[FilterCopy] = deque(maxlen=settings.copies)

    @property
    def copies(self) -> Sequence[FilterCopy]:
        """The oldest one first."""
        return self._copies

    @property
    def oldest(self) -> FilterCopy | None:
        """The copy with the longest way without its sources."""
        return self._copies[0] if self._copies else None

    @property
    def is_full(self) -> bool:
        """Whether all its copies exist."""
        return len(self._copies) == self._settings.copies

    def clear(self) -> None:
        """Forget all copies."""
        self._copies.clear()

    def keep_oldest(self) -> None:
        """Forget all copies but the oldest one."""
        while len(self._copies) > 1:
            self._copies.pop()

    def advance(self, pieces: Sequence[Piece]) -> None:
        """Follow the filter through a segment."""
        for number, copy in enumerate(self._copies):
            copy.advance(pieces, self.tested if number == 0 else frozenset())

    def renew(self, now: Moment, *, keep_oldest: bool = False) -> None:
        """Begin a copy where one is due; the oldest one makes place for it, or the second one where that is kept."""
        step_ns, t_ns = self._settings.step_ns, now.estimate.t_ns
        if not self._copies or (step_ns is not None and t_ns - self._copies[-1].began_ns >= step_ns):
            if keep_oldest and self.is_full:
                del self._copies[1]
            self._copies.append(FilterCopy.begin(now, self.removed_names))

    def drop_before(self, t_ns: int) -> None:
        """Forget copies that began before a time."""
        while self._copies and self._copies[0].began_ns < t_ns:
            self._copies.popleft()

    def separations(self, now: Moment) -> list[Separation]:
        """Of the filter from each copy, the oldest one first."""
        return [separate(now.estimate, copy.estimate) for copy in self._copies]
