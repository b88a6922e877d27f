"""Limits the queries that are answered, so that peers cannot use up the processor."""

from __future__ import annotations

import threading
import time

#: Largest mean rate of answered queries [Hz], and how many may come at once.
MAX_RATE_HZ, MAX_BURST = 20.0, 40.0


class QueryBudget:
    """A token bucket; used by several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._tokens, self._then_s = MAX_BURST, time.monotonic()

    def take(self) -> bool:
        """May one more query be answered now?"""
        with self._lock:
            now_s = time.monotonic()
            self._tokens = min(MAX_BURST, self._tokens + (now_s - self._then_s) * MAX_RATE_HZ)
            self._then_s = now_s
            if self._tokens < 1.0:
                return False
            self._tokens -= 1.0
            return True
