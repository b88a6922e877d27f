"""The latest value, for the display only: what is not looked at in time is overwritten."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

Value = TypeVar("Value")


class LatestValue(Generic[Value]):
    """One value and how often it was set; any thread may set and get."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._value: Value | None = None
        self._count = 0

    def set(self, value: Value) -> None:
        """Replace the value."""
        with self._lock:
            self._value = value
            self._count += 1

    def get(self) -> tuple[int, Value | None]:
        """How often a value was set, and the last one (None before the first)."""
        with self._lock:
            return self._count, self._value
