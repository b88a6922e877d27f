"""A ring of copies of different ages without the same sources.

Every ``step_ns`` the oldest copy is replaced by a new one, so that four copies have ages of up to 1, 2, 3 and 4 steps.
An old copy shows more of a slow fault, but has drifted more itself; the best age for a ramp depends on the inertial
unit.  No copy is replaced while its sources are suspected or silent, because a new one could contain the fault.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from fti.nav.filter.segment import Moment, Piece
from fti.nav.separation.copies import FilterCopy, Separation, separate


@dataclass(frozen=True, slots=True)
class RingSettings:
    """Number of copies, and period of their replacement [ns]; None: never, the copy starts with the ring."""

    copies: int
    step_ns: int | None

    @property
    def max_age_ns(self) -> int | None:
        """Age of the oldest copy when it is replaced [ns]; None: never."""
        return None if self.step_ns is None else self.copies * self.step_ns


class CopyRing:
    """Copies for one class of sources, by names of ``Aiding``.

    removed_names : sources that its copies do not use;  tested_names : those that are tested against the oldest copy
    """

    def __init__(self, removed_names: frozenset[str], tested_names: frozenset[str], settings: RingSettings) -> None:
        self.removed_names, self.tested_names = removed_names, tested_names
        self._settings = settings
        self.copies: deque[FilterCopy] = deque(maxlen=settings.copies)  # the oldest one first

    @property
    def oldest(self) -> FilterCopy | None:
        """The copy that has run longest without its sources."""
        return self.copies[0] if self.copies else None

    @property
    def is_full(self) -> bool:
        """Whether all its copies exist."""
        return len(self.copies) == self._settings.copies

    def clear(self) -> None:
        """Remove all copies."""
        self.copies.clear()

    def keep_oldest(self) -> None:
        """Remove all copies but the oldest one."""
        while len(self.copies) > 1:
            self.copies.pop()

    def advance(self, pieces: Sequence[Piece]) -> None:
        """Follow the filter through a segment."""
        for number, copy in enumerate(self.copies):
            copy.advance(pieces, self.tested_names if number == 0 else frozenset())

    def renew(self, moment: Moment, *, keep_oldest: bool = False) -> None:
        """Add a copy if one is due; it replaces the oldest one, or with ``keep_oldest`` the second one."""
        step_ns, t_ns = self._settings.step_ns, moment.estimate.t_ns
        if not self.copies or (step_ns is not None and t_ns - self.copies[-1].began_ns >= step_ns):
            if keep_oldest and self.is_full:
                del self.copies[1]
            self.copies.append(FilterCopy.begin(moment, self.removed_names))

    def drop_before(self, t_ns: int) -> None:
        """Remove copies that began before a time."""
        while self.copies and self.copies[0].began_ns < t_ns:
            self.copies.popleft()

    def separations(self, moment: Moment) -> list[Separation]:
        """Of the filter from each copy, the oldest one first."""
        return [separate(moment.estimate, copy.estimate) for copy in self.copies]
