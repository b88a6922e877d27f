"""Whether everything that arrived in a session was recorded, and the sentence that says how much was not."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fti.logger.storage import NOT_RECORDING

#: Reasons of dropped frames for which the storage is responsible; see ``fti.service.recorder.link_ledger``.
STORAGE_REASONS = ("buffer_overflow", "snapshot_overflow")
Account = Mapping[str, Any]


@dataclass(slots=True)
class _Count:
    """Frames that arrived or were sent; of these, frames and bytes that are in no file."""

    came: int = 0
    lost: int = 0
    lost_bytes: int = 0

    def add(self, account: Account, *, held_is_lost: bool) -> None:
        self.came += account["in_frames"]
        parts = [account["dropped"].get(reason, {"frames": 0, "bytes": 0}) for reason in STORAGE_REASONS]
        if held_is_lost:
            parts.append({"frames": account["held_frames"], "bytes": account["held_bytes"]})
        self.lost += sum(part["frames"] for part in parts)
        self.lost_bytes += sum(part["bytes"] for part in parts)


class SessionResult:
    """Adds up what the recorders of a session could not record because no medium took it."""

    def __init__(self) -> None:
        self._frames = _Count()
        self._ticks = _Count()
        self._fault = ""
        self._finished = False
        self._counted: Mapping[str, Any] | None = None
        self.unrecorded_ledger: Mapping[str, Any] | None = None

    def add_dead_recorder(self, health: Mapping[str, Any]) -> None:
        """Count the losses of a recorder that died.  health : its last one; counted once.

        Frames that it held are counted only when no storage took them: otherwise they may be in the file.
        """
        if health is self._counted:
            return
        self._counted = health
        refused = health.get("storage", {}).get("state") in NOT_RECORDING
        self._add_links((link["ledger"] for link in health.get("links", {}).values()), held_is_lost=refused)

    def handle_report(self, report: Mapping[str, Any]) -> None:
        """The last report of the recorder that has stopped.

        ledger : its last one; ledger_recorded : the ledger is in a file; fault : why a file could not be closed, or
        None; unsafe_frames, unsafe_bytes : written to a medium that failed afterwards, and nowhere else
        """
        self._finished = True
        ledger = report["ledger"]
        self._add_links(ledger["links"].values(), held_is_lost=True)
        self._frames.lost += report["unsafe_frames"]
        self._frames.lost_bytes += report["unsafe_bytes"]
        self._ticks.add(ledger["ticks"], held_is_lost=True)
        self._fault = report["fault"] or ""
        self.unrecorded_ledger = None if report["ledger_recorded"] else ledger

    def _add_links(self, accounts: Iterable[Account], *, held_is_lost: bool) -> None:
        for account in accounts:
            self._frames.add(account, held_is_lost=held_is_lost)
            self._frames.add(account["sent"], held_is_lost=held_is_lost)

    def describe_loss(self, folder: Path) -> str | None:
        """What is missing in the recording, in a sentence; None when everything was recorded."""
        if not self._finished:
            return f"{folder}: not everything may be recorded: the recorder ended before it had closed its files"
        frames = self._frames
        reason = self._fault or "the medium did not take them in time"
        if frames.lost and frames.lost == frames.came:
            return f"{folder}: nothing was recorded: all {frames.came} frames are lost: {reason}"
        if frames.lost:
            size = f"{frames.lost} of {frames.came} frames ({frames.lost_bytes} bytes) are lost"
            return f"{folder}: not everything was recorded: {size}: {reason}"
        if self._fault or self._ticks.lost or self.unrecorded_ledger:
            left = "all frames of the links are in the files" if frames.came else "no frame arrived"
            return f"{folder}: not everything was recorded: {left}, but not all ticks and notes: {reason}"
        return None


def save_ledger(ledger: Mapping[str, Any], session: str, run_dir: Path) -> str:
    """Keep a ledger that no storage target took: in the run directory, or else in the text that is returned."""
    text = json.dumps(ledger, separators=(",", ":"))
    path = run_dir / f"{session}_ledger.json"
    try:
        fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        with os.fdopen(fd, "w") as file:
            file.write(text)
    except OSError:
        return f"the last ledger: {text}"
    return f"the last ledger is in {path}"
