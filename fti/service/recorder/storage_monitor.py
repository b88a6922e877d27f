"""Storage health, and an event for every change of the storage state, with the loss."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

from fti.buffers.triple_buffer import BufferStats
from fti.links.base import LinkStatus
from fti.logger.raw_log import RawLog
from fti.logger.storage import StorageState
from fti.messages.health import StorageHealth
from fti.service.fault_guard import ReportEvent
from fti.service.recorder.log_writer import LogWriter

LEVELS = {StorageState.ERROR: "error", StorageState.GONE: "error"}


class Dropped(NamedTuple):
    """Dropped data of a link: frames and bytes by its buffers, frames by the kernel."""

    frames: int = 0
    bytes: int = 0
    kernel_frames: int = 0

    @classmethod
    def of(cls, buffer: BufferStats, link: LinkStatus) -> Dropped:
        """From the present counters."""
        return cls(buffer.dropped_frames, buffer.dropped_bytes, link.socket_dropped)

    def describe_since(self, before: Dropped, link: str) -> list[str]:
        """The drops since then, as texts."""
        frames, size, kernel = (now - then for now, then in zip(self, before, strict=True))
        texts = [f"{frames} frames ({size} bytes) of {link}"] if frames else []
        return [*texts, f"{kernel} frames of {link} by the kernel"] if kernel else texts


class StorageMonitor:
    """Watches the storage state of the writer."""

    def __init__(
        self,
        log: RawLog,
        writer: LogWriter,
        dropped: Callable[[], Mapping[str, Dropped]],
        report_event: ReportEvent,
    ) -> None:
        self._log, self._writer = log, writer
        self._dropped = dropped
        self._report_event = report_event
        self._state = StorageState.OK
        self._refused_since = 0.0
        self._dropped_before: Mapping[str, Dropped] = {}

    def report_changes(self) -> None:
        """Events for changes since the last call."""
        state, hint = self._writer.state()
        if state is self._state:
            return
        before, self._state = self._state, state
        if before is StorageState.ERROR:
            self._report_event("warning", "storage", f"recording again {self._describe_outage()}")
        if state is StorageState.ERROR:
            self._refused_since = time.monotonic()
            self._dropped_before = self._dropped()
            hint = f"the medium refuses: {hint}; frames are buffered"
        elif state is StorageState.OK and before is not StorageState.ERROR:
            hint = f"recovered; recording to {self._writer.file}"
        if hint:
            self._report_event(LEVELS.get(state, "warning"), "storage", hint)

    def _describe_outage(self) -> str:
        """Duration and loss of an outage."""
        before, lost = self._dropped_before, list[str]()
        for link, dropped in self._dropped().items():
            lost += dropped.describe_since(before.get(link, Dropped()), link)
        seconds = time.monotonic() - self._refused_since
        return f"after {seconds:.1f} s, in {self._writer.file}; lost: {', '.join(lost) or 'nothing'}"

    def health(self) -> StorageHealth:
        """File, space and state."""
        state, hint = self._writer.state()
        file = self._writer.file
        return StorageHealth(
            file=str(file) if file else None,
            file_bytes=self._log.bytes_written,
            file_age_s=self._writer.silence_s,
            free_mb=self._writer.free_mb,
            state=state,
            hint=hint,
        )
