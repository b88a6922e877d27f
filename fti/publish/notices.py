"""Events about single peers of a sink that stays open."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable

#: Level and text of an event.
Notify = Callable[[str, str], None]
#: Peers that come and go give events at most so often [s]; changes in between are one.
PERIOD_S = 10.0


class Notices:
    """Reports faults of peers when they begin and end, and counts of what happened to peers.

    key : of the configuration, in front of each text
    """

    def __init__(self, key: str, notify: Notify) -> None:
        self._key, self._notify = key, notify
        self._faults: dict[str, str] = {}
        self._reported: dict[str, str] = {}
        self._counts: Counter[str] = Counter()
        self._next_s = -math.inf

    def set_fault(self, peer: str, fault: str) -> None:
        """The present fault of a peer, or an empty text."""
        self._faults[peer] = fault

    def count(self, text: str) -> None:
        """Something has happened to a peer; texts that are equal are counted."""
        self._counts[text] += 1

    def report(self) -> None:
        """Report what has changed, unless something was reported just before."""
        now_s = time.monotonic()
        changed = {peer for peer, fault in self._faults.items() if fault != self._reported.get(peer, "")}
        if now_s < self._next_s or not (changed or self._counts):
            return
        self._next_s = now_s + PERIOD_S
        for peer in sorted(changed):
            self._report_fault(peer, self._faults[peer])
        for text, number in self._counts.items():
            self._notify("warning", f"{self._key}: {text}" + (f" ({number} times)" if number > 1 else ""))
        self._counts.clear()

    def _report_fault(self, peer: str, fault: str) -> None:
        self._reported[peer] = fault
        if fault:
            self._notify("warning", f"{self._key}: {peer}: {fault}; tried again with each datagram")
        else:
            self._notify("info", f"{self._key}: {peer}: datagrams are accepted again")
