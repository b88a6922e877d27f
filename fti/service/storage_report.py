"""What the recorder says of the medium: health, and an event for every change, with what was lost meanwhile."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

from fti.logger.storage import State
from fti.service.writing import Writer

#: Level, source and text of an event.
Tell = Callable[[str, str, str], None]
#: Frames and bytes that the buffers of each link have dropped.
Dropped = Mapping[str, tuple[int, int]]
LEVELS = {State.ERROR: "error", State.GONE: "error"}


class StorageReport:
    """Looks at the writer."""

    def __init__(self, writer: Writer, dropped: Callable[[], Dropped], tell: Tell) -> None:
        self._writer = writer
        self._dropped = dropped
        self._tell = tell
        self._state = State.OK
        self._refused_since = 0.0
        self._dropped_before: Dropped = {}

    def tell_changes(self) -> None:
        """Events for what has changed since the last call."""
        state, hint = self._writer.state()
        if state is self._state:
            return
        before, self._state = self._state, state
        if before is State.ERROR:
            self._tell("warning", "storage", f"the medium accepts again {self._describe_outage()}")
        if state is State.ERROR:
            self._refused_since = time.monotonic()
            self._dropped_before = self._dropped()
            hint = f"the medium refuses: {hint}; the buffers hold what they can"
        elif state is State.OK and before is not State.ERROR:
            hint = f"all is well again, recording to {self._writer.file}"
        if hint:
            self._tell(LEVELS.get(state, "warning"), "storage", hint)

    def _describe_outage(self) -> str:
        """How long it refused and what that cost."""
        lost = []
        for link, (frames, size) in self._dropped().items():
            frames_before, size_before = self._dropped_before.get(link, (0, 0))
            if frames > frames_before:
                lost.append(f"{frames - frames_before} frames ({size - size_before} bytes) of {link}")
        seconds = time.monotonic() - self._refused_since
        return f"after {seconds:.1f} s, in {self._writer.file}; lost: {', '.join(lost) or 'nothing'}"

    def health(self) -> dict[str, Any]:
        """File, space and state, for health."""
        state, hint = self._writer.state()
        file = self._writer.file
        return {
            "file": str(file) if file else None,
            "file_bytes": self._writer.log.bytes_written,
            "file_age_s": self._writer.silence_s,
            "free_mb": self._writer.free_mb,
            "state": state,
            "hint": hint,
        }
