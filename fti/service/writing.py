"""The writer thread of the recorder: from the triple buffers into the MCAP file, wherever that can be.

It is called with every tick of the recorder, and when a buffer passes its threshold.  What it has taken from a buffer
counts as written only after the medium has accepted it; while the medium refuses, the buffers fill, and their own
rule decides what is lost and counts it.

A thread that calls into a sick medium may stay there for long.  Therefore a *stint*, the writing at one place, has a
thread of its own: it opens its file, takes over from the stint before, and what that had not brought home it takes
from the buffers again.  The stint before ends whenever its medium lets it, and touches nothing any more.  Which stint
begins where and when, ``fti.logger.storage`` decides.
"""

from __future__ import annotations

import time

from fti.errors import StorageError
from fti.service.guard import guarded
from fti.service.stint import Stint
from fti.service.succession import FLUSH_PERIOD_S, LAST_CHANCE_S, Succession, Writing

#: How often the storage should be tended [s].
TEND_PERIOD_S = 0.1


class Writer(Succession):
    """Owns the log and its stints.  ``tend`` must be called every ``TEND_PERIOD_S``; no call but ``stop`` waits."""

    # ------------------------------------------------------------------------------------------------ for the reader

    def start(self) -> None:
        """Begin to open a file."""
        self.tend()

    def tend(self) -> None:
        """Begin the attempt that the storage needs now."""
        with self._deciding:
            attempt = self._machine.wanted(time.monotonic())
        if attempt:
            stint = Stint(self, attempt)
            self._others = [other for other in self._others if other.is_alive()] + [stint]
            stint.start()

    # --------------------------------------------------------------------------------------------------- for the end

    def stop(self) -> None:
        """Write what the buffers hold and end the thread; the log stays open for last notes."""
        self.stopping.set()
        self.wake()
        give_up = time.monotonic() + LAST_CHANCE_S
        while self._stint or time.monotonic() < give_up:
            self.tend()
            stint = self._stint
            if stint is None:
                time.sleep(FLUSH_PERIOD_S)
                continue
            stint.join(FLUSH_PERIOD_S)
            if not stint.is_alive() and self._is_last(stint):
                return

    def _is_last(self, stint: Writing) -> bool:
        """Is it still the one that writes?  Then nobody takes over from it any more: its thread would not leave."""
        with self.turn:
            self._finished = stint is self._stint
            return self._finished

    def finish(self) -> None:
        """Record the last notes and close the file; after ``stop``."""
        with guarded("storage", self.report), self.turn:
            self._finished = True
            if self._stint is None:
                raise StorageError(f"what the buffers held is lost: {self.state()[1]}")
            for source in self.sources:
                source.tell_gaps(self.note, final=True)
            self.notes.record_all(self.log)
            self.log.close()
        deadline = time.monotonic() + LAST_CHANCE_S
        for stint in self._others:
            stint.join(max(0.0, deadline - time.monotonic()))
