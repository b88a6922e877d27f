"""What the recorder says of the medium: health, and an event when it refuses or accepts again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fti.errors import StorageError
from fti.logger.raw_log import RawLog
from fti.service.writing import Writer

#: Level, source and text of an event.
Tell = Callable[[str, str, str], None]


class StorageReport:
    """Looks at the log and its writer."""

    def __init__(self, log: RawLog, writer: Writer, min_free_mb: float, tell: Tell) -> None:
        self._log = log
        self._writer = writer
        self._min_free_mb = min_free_mb
        self._tell = tell
        self._fault_told: str | None = None

    def tell_changes(self) -> None:
        """The one loud failure: the medium refuses; and that it takes bytes again."""
        fault = self._writer.storage_fault
        if bool(fault) != bool(self._fault_told):
            text = f"the medium refuses: {fault}" if fault else "the medium accepts again"
            self._tell("error" if fault else "warning", "storage", text)
        self._fault_told = fault

    def health(self) -> dict[str, Any]:
        """File, space and state, for health."""
        free_mb = self._free_mb()
        fault = self._writer.storage_fault
        low = free_mb is not None and free_mb < self._min_free_mb
        return {
            "file": str(self._log.path),
            "file_bytes": self._log.bytes_written,
            "file_age_s": self._writer.silence_s,
            "free_mb": free_mb,
            "state": "error" if fault else "full" if low else "ok",
            "hint": fault or ("less space than session.min_free_mb is left" if low else ""),
        }

    def _free_mb(self) -> float | None:
        try:
            return self._log.free_mb()
        except StorageError:
            return None
