"""Where words begin on a line that has nothing but words: parity, and the labels that are enabled.

Searching, nothing is released until ``wanted`` enabled labels have stood at a distance of whole words with good
parity between them, and no other place shows nearly as many.  ``wanted`` follows from how many labels are enabled, so
that noise is believed once in 10^9 bytes (a day at 115200 baud): with q the part of all label bytes that is enabled,
a place looks like an enabled word with q/2, and shows a further one before a bad parity with q/(1+q).  That is 4 words
for one label, 7 for ten, 8 for twenty: one label sent 25 times a second is found after 0.12 s, and what was held is
released with its own stamps.  Two words, the least that could do, would believe noise 8 times a second with ten labels.
A stream that begins with a word is believed after WANTED_AT_BEGINNING: captures and datagrams do, and noise has but
one chance.

In step, an enabled label in good parity is released at once.  A word that is not enabled is framed as soon as the
next enabled label shows that words still begin there: turned by a whole byte a word keeps its parity, so after a lost
byte parity alone would believe the wrong place.  A word in bad parity is skipped when two enabled labels follow it
where they should; otherwise the search begins again.  At most SEARCH_BYTES are held; as many bytes of good parity are
proof too.

Words that never change, of one label or two, may look alike at two places: then nothing is released ("ambiguous").
Without parity the labels are all there is: while searching, ``wanted`` enabled ones must follow each other directly.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from fti.drivers._framing import Skip
from fti.drivers.arinc429.word import Parity, is_intact

WORD_BYTES = 4
SEARCH_BYTES = 64 * WORD_BYTES
MAX_FALSE_SYNC_RATE = 1e-9  # false finds per byte of noise
MIN_WORDS_AT_START = 3
OTHER_OFFSETS = (1, 2, 3)
MIN_WORDS_ELSEWHERE = 3  # enabled words at another place that end being in step


def required_words(enabled: float, parity: Parity) -> int:
    """Enabled words that prove where words begin.  enabled : label bytes that are, of 256; one sdi counts a quarter."""
    part = enabled / 256
    first, further = (part, part) if parity == "none" else (part / 2, part / (1 + part))
    if further >= 1:
        return SEARCH_BYTES // WORD_BYTES
    needed = 1 + math.ceil(math.log(MAX_FALSE_SYNC_RATE / first) / math.log(further))
    return min(max(needed, 2), SEARCH_BYTES // WORD_BYTES)


class WordEvidence(NamedTuple):
    """What a place shows.  good : None when the bytes do not tell; end : of the word that told; seen : enabled ones."""

    good: bool | None
    end: int
    seen: int


class WordStream:
    """Frames of one word each.  word_of : bytes to the word; is_enabled : its label is."""

    def __init__(
        self,
        word_of: Callable[[bytearray], int],
        is_enabled: Callable[[int], bool],
        parity: Parity,
        wanted: int,
    ) -> None:
        self._word_of, self._is_enabled = word_of, is_enabled
        self._parity, self._wanted = parity, wanted
        self._at_beginning = True
        self._in_step = False
        self._confirmed_words = 0  # words ahead of which it is known that they begin here

    def measure(self, buffer: bytearray) -> int | Skip:
        """See ``_framing``."""
        seen = self._measure(buffer)
        if seen:
            self._at_beginning = False
        return seen

    def _measure(self, buffer: bytearray) -> int | Skip:
        if len(buffer) < WORD_BYTES:
            return 0
        if self._confirmed_words:
            self._confirmed_words -= 1
            return WORD_BYTES
        word = self._word_of(buffer[:WORD_BYTES])
        good, enabled = is_intact(word, self._parity), self._is_enabled(word)
        if self._in_step:
            return WORD_BYTES if good and enabled else self._look_ahead(buffer, good)
        return self._search(buffer) if good and enabled else Skip(1, "no_sync")

    def _search(self, buffer: bytearray) -> int | Skip:
        """An enabled label stands here; do words begin here?"""
        wanted = MIN_WORDS_AT_START if self._at_beginning else self._wanted
        seen = self._evidence(buffer, 0, wanted, dense=self._parity == "none")
        if seen.good is None and len(buffer) < SEARCH_BYTES:
            return 0
        if seen.good is False:
            return Skip(1, "no_sync")
        if self._is_ambiguous(buffer[: seen.end], seen.seen):
            return Skip(1, "ambiguous")
        self._in_step, self._confirmed_words = True, seen.end // WORD_BYTES - 1
        return WORD_BYTES

    def _is_ambiguous(self, buffer: bytearray, seen: int) -> bool:
        """Another place shows one enabled label less at most, and no bad parity."""
        return any(self._evidence(buffer, at, max(seen - 1, 1)).good for at in OTHER_OFFSETS)

    def _look_ahead(self, buffer: bytearray, good: bool) -> int | Skip:
        """A word that is not enabled or not intact: do words still begin here?  What is shown first counts."""
        here = self._evidence(buffer, 0, 1) if good else self._evidence(buffer, WORD_BYTES, 2)
        others = [
            (seen.end, at) for at in OTHER_OFFSETS if (seen := self._evidence(buffer, at, MIN_WORDS_ELSEWHERE)).good
        ]
        if others and (here.good is None or min(others)[0] < here.end):
            return self._lost(min(others)[1], good)
        if here.good is None and len(buffer) < SEARCH_BYTES:
            return 0
        if here.good is False or (here.good is None and not good):
            return self._lost(1, good)
        self._confirmed_words = here.end // WORD_BYTES - 1
        return WORD_BYTES if good else Skip(WORD_BYTES, "bad_parity")

    def _lost(self, size: int, good: bool) -> Skip:
        self._in_step = False
        return Skip(size, "no_sync" if good else "bad_parity")

    def _evidence(self, buffer: bytearray, start: int, wanted: int, *, dense: bool = False) -> WordEvidence:
        """So many enabled labels from start on, or a bad parity before.  dense : each word must be enabled."""
        seen, at = 0, start
        for at in range(start, len(buffer) - WORD_BYTES + 1, WORD_BYTES):
            word = self._word_of(buffer[at : at + WORD_BYTES])
            enabled = self._is_enabled(word)
            if not is_intact(word, self._parity) or (dense and not enabled):
                return WordEvidence(False, at + WORD_BYTES, seen)
            seen += enabled
            if seen == wanted:
                return WordEvidence(True, at + WORD_BYTES, seen)
        return WordEvidence(None, at + WORD_BYTES, seen)
