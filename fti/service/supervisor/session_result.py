"""Determines whether a session was recorded completely, and describes the loss."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from fti.logger.storage import NOT_RECORDING
from fti.messages.control import RecorderEnd, RecorderReport
from fti.messages.ledger import DroppedFrames, FrameAccount, LedgerRecord, LinkFrameAccount
from fti.messages.tables import to_table

#: Reasons of dropped frames for which the storage is responsible; see ``fti.service.recorder.link_ledger``.
STORAGE_REASONS = ("buffer_overflow", "snapshot_overflow")


@dataclass(slots=True)
class _Count:
    """Frames received or sent; the frames and bytes among them that are in no file."""

    total: int = 0
    lost: int = 0
    lost_bytes: int = 0

    def add(self, account: FrameAccount, *, held_is_lost: bool) -> None:
        self.total += account.in_frames
        parts = [account.dropped[reason] for reason in STORAGE_REASONS if reason in account.dropped]
        if held_is_lost:
            parts.append(DroppedFrames(account.held_frames, account.held_bytes))
        self.lost += sum(part.frames for part in parts)
        self.lost_bytes += sum(part.bytes or 0 for part in parts)


class SessionResult:
    """Adds up the frames that the recorders of a session could not write to a medium."""

    def __init__(self) -> None:
        self._frames = _Count()
        self._ticks = _Count()
        self._fault = ""
        self._finished = False
        self._counted: RecorderReport | None = None
        self.unrecorded_ledger: LedgerRecord | None = None

    def add_killed_recorder(self, health: RecorderReport | None) -> None:
        """Count the losses of a recorder that died.  health : its last report, if there is one; counted once

        Held frames are counted only if no storage target worked; otherwise they may be in the file.
        """
        if health is None or health is self._counted:
            return
        self._counted = health
        refused = health.storage.state in NOT_RECORDING
        self._add_links((link.ledger for link in health.links.values() if link.ledger), held_is_lost=refused)

    def handle_report(self, report: RecorderEnd) -> None:
        """Handle the last report of the recorder that has stopped."""
        self._finished = True
        ledger = report.ledger
        self._add_links(ledger.links.values(), held_is_lost=True)
        self._frames.lost += report.unsafe_frames
        self._frames.lost_bytes += report.unsafe_bytes
        self._ticks.add(ledger.ticks, held_is_lost=True)
        self._fault = report.fault or ""
        self.unrecorded_ledger = None if report.ledger_recorded else ledger

    def _add_links(self, accounts: Iterable[LinkFrameAccount], *, held_is_lost: bool) -> None:
        for account in accounts:
            self._frames.add(account, held_is_lost=held_is_lost)
            self._frames.add(account.sent, held_is_lost=held_is_lost)

    def describe_loss(self, folder: Path) -> str | None:
        """A sentence about the missing data; None when everything was recorded."""
        if not self._finished:
            return f"{folder}: the recording may be incomplete: the recorder ended before it closed its files"
        frames = self._frames
        reason = self._fault or "the medium did not take them in time"
        if frames.lost and frames.lost == frames.total:
            return f"{folder}: nothing was recorded: all {frames.total} frames are lost: {reason}"
        if frames.lost:
            size = f"{frames.lost} of {frames.total} frames ({frames.lost_bytes} bytes) are lost"
            return f"{folder}: not everything was recorded: {size}: {reason}"
        if self._fault or self._ticks.lost or self.unrecorded_ledger:
            rest = "all frames of the links are in the files" if frames.total else "no frame arrived"
            return f"{folder}: not everything was recorded: {rest}, but not all ticks and notes: {reason}"
        return None


def save_ledger(ledger: LedgerRecord, session: str, run_dir: Path) -> str:
    """Save a ledger that no storage target accepted: in the run directory, otherwise in the returned text."""
    text = json.dumps(to_table(ledger), separators=(",", ":"))
    path = run_dir / f"{session}_ledger.json"
    try:
        fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        with os.fdopen(fd, "w") as file:
            file.write(text)
    except OSError:
        return f"the last ledger: {text}"
    return f"the last ledger is in {path}"
