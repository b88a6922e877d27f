"""Word synchronisation on a line without packets, by parity and enabled labels.

Search: no word is released until ``required`` enabled labels were found at distances of whole words, with correct
parity between them, and no other offset has nearly as many.  ``required`` depends on the number of enabled labels, for
one false synchronisation in 10^9 bytes of noise (a day at 115200 baud).  With q the enabled fraction of all label
bytes, an offset looks like an enabled word with probability q/2, and shows a further one before a wrong parity with
q/(1+q).  This gives 4 words for one label, 7 for ten, 8 for twenty: one label at 25 Hz is found after 0.12 s, and the
held words are released with their own stamps.  Two words, the minimum, would accept noise 8 times a second with ten
labels.  At the start of a stream MIN_WORDS_AT_START are enough: captures and datagrams begin with a word, and noise has
only one chance.

In step: an enabled label with correct parity is released at once.  Another word is framed when the next enabled label
confirms the offset: a word shifted by a whole byte keeps its parity, so after a lost byte parity alone would accept a
wrong offset.  A word with wrong parity is skipped if two enabled labels follow at the right offset; otherwise the
search begins again.  At most SEARCH_BYTES are held; as many bytes with correct parity also confirm the offset.

Constant words of one or two labels may look alike at two offsets: then no word is released ("ambiguous").  Without
parity only the labels are checked: the search then needs ``required`` consecutive enabled labels.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from fti.drivers._framing import Skip
from fti.drivers.arinc429.word import Parity, is_intact

WORD_BYTES = 4
SEARCH_BYTES = 64 * WORD_BYTES
MAX_FALSE_SYNC_RATE = 1e-9  # false synchronisations per byte of noise
MIN_WORDS_AT_START = 3
OTHER_OFFSETS = (1, 2, 3)
MIN_WORDS_OTHER_OFFSET = 3  # enabled words at another offset that end the synchronisation


def required_words(enabled: float, parity: Parity) -> int:
    """Number of enabled words for synchronisation.  enabled : label bytes of 256; one sdi counts 0.25."""
    part = enabled / 256
    first, further = (part, part) if parity == "none" else (part / 2, part / (1 + part))
    if further >= 1:
        return SEARCH_BYTES // WORD_BYTES
    needed = 1 + math.ceil(math.log(MAX_FALSE_SYNC_RATE / first) / math.log(further))
    return min(max(needed, 2), SEARCH_BYTES // WORD_BYTES)


class OffsetCheck(NamedTuple):
    """Check of an offset.  good : None if undecided; end : of the deciding word; enabled_words : their number."""

    good: bool | None
    end: int
    enabled_words: int


class WordStream:
    """Frames of one word each.  word_of : converts bytes to the word; is_enabled : is its label enabled?"""

    def __init__(
        self,
        word_of: Callable[[bytearray], int],
        is_enabled: Callable[[int], bool],
        parity: Parity,
        required: int,
    ) -> None:
        self._word_of, self._is_enabled = word_of, is_enabled
        self._parity, self._required = parity, required
        self._at_beginning = True
        self._in_step = False
        self._confirmed_words = 0  # following words whose offset is confirmed

    def measure(self, buffer: bytearray) -> int | Skip:
        """See ``_framing``."""
        result = self._measure(buffer)
        if result:
            self._at_beginning = False
        return result

    def _measure(self, buffer: bytearray) -> int | Skip:
        if len(buffer) < WORD_BYTES:
            return 0
        if self._confirmed_words:
            self._confirmed_words -= 1
            return WORD_BYTES
        word = self._word_of(buffer[:WORD_BYTES])
        good, enabled = is_intact(word, self._parity), self._is_enabled(word)
        if self._in_step:
            return WORD_BYTES if good and enabled else self._check_following(buffer, good)
        return self._search(buffer) if good and enabled else Skip(1, "no_sync")

    def _search(self, buffer: bytearray) -> int | Skip:
        """At an enabled label: is this the offset of words?"""
        required = MIN_WORDS_AT_START if self._at_beginning else self._required
        check = self._check_offset(buffer, 0, required, dense=self._parity == "none")
        if check.good is None and len(buffer) < SEARCH_BYTES:
            return 0
        if check.good is False:
            return Skip(1, "no_sync")
        # Does another offset have at most one enabled label less, and no wrong parity?
        searched, enough = buffer[: check.end], max(check.enabled_words - 1, 1)
        if any(self._check_offset(searched, at, enough).good for at in OTHER_OFFSETS):
            return Skip(1, "ambiguous")
        self._in_step, self._confirmed_words = True, check.end // WORD_BYTES - 1
        return WORD_BYTES

    def _check_following(self, buffer: bytearray, good: bool) -> int | Skip:
        """After a word that is not enabled or not intact: is the offset still right?  The first check decides."""
        here = self._check_offset(buffer, 0, 1) if good else self._check_offset(buffer, WORD_BYTES, 2)
        others = [
            (check.end, at)
            for at in OTHER_OFFSETS
            if (check := self._check_offset(buffer, at, MIN_WORDS_OTHER_OFFSET)).good
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

    def _check_offset(self, buffer: bytearray, start: int, required: int, *, dense: bool = False) -> OffsetCheck:
        """Find ``required`` enabled labels from start on, or a wrong parity.  dense : each word must be enabled."""
        enabled_words, at = 0, start
        for at in range(start, len(buffer) - WORD_BYTES + 1, WORD_BYTES):
            word = self._word_of(buffer[at : at + WORD_BYTES])
            enabled = self._is_enabled(word)
            if not is_intact(word, self._parity) or (dense and not enabled):
                return OffsetCheck(False, at + WORD_BYTES, enabled_words)
            enabled_words += enabled
            if enabled_words == required:
                return OffsetCheck(True, at + WORD_BYTES, enabled_words)
        return OffsetCheck(None, at + WORD_BYTES, enabled_words)
