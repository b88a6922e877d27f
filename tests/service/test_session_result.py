"""Completeness of a session: lost frames, and the sentence about them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from fti.messages.control import RecorderEnd, RecorderReport
from fti.messages.ledger import LedgerRecord
from fti.messages.tables import from_table, to_table
from fti.service.supervisor.session_result import SessionResult, save_ledger

FOLDER = Path("/data/s_0")
COUNTS = [f"{part}_{what}" for part in ("in", "recorded", "held") for what in ("frames", "bytes")]
NONE: dict[str, Any] = {**dict.fromkeys(COUNTS, 0), "dropped": {}}


LEDGER = {"t_ns": 1, "recorder": {"pid": 1, "started_ns": 0, "first_seq": 0}, "next_seq": 0, "final": True}


def account(came: int = 0, held: int = 0, **dropped: int) -> dict[str, Any]:
    """Frames of ten bytes."""
    reasons = {
        reason: {"frames": n, "bytes": None if reason == "socket_queue" else 10 * n} for reason, n in dropped.items()
    }
    counts = {"in_frames": came, "held_frames": held, "held_bytes": 10 * held, "dropped": reasons}
    return {**NONE, **counts, "sent": NONE, "errors": {}, "stamp_refused": 0}


def _only_frames(account: dict[str, Any]) -> dict[str, Any]:
    return {name: account[name] for name in NONE}


def report(*links: dict[str, Any], ticks: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    ledger = {**LEDGER, "links": {str(n): link for n, link in enumerate(links)}, "ticks": _only_frames(ticks or NONE)}
    end = {"ledger": ledger, "ledger_recorded": True, "fault": None, "unsafe_frames": 0, "unsafe_bytes": 0}
    return {**end, **changes}


def loss_of(last: dict[str, Any], *killed: RecorderReport | None) -> str:
    result = SessionResult()
    for health in killed:
        result.add_killed_recorder(health)
    result.handle_report(from_table(RecorderEnd, last))
    return result.describe_loss(FOLDER) or ""


@pytest.mark.parametrize(
    "last",
    [
        report(),
        report(account(100), account(7)),
        report(account(100, socket_queue=5)),  # not read in time: not a fault of the storage
        report(account(100, not_triggered=50)),
    ],
)
def test_everything_was_recorded(last: dict[str, Any]) -> None:
    assert loss_of(last) == ""


@pytest.mark.parametrize(
    ("last", "sentence"),
    [
        (report(account(30, held=30), fault="full"), "nothing was recorded: all 30 frames are lost: full"),
        (
            report(account(30, held=2, buffer_overflow=3), account(10)),
            "not everything was recorded: 5 of 40 frames (50 bytes) are lost: the medium did not take them in time",
        ),
        (report(account(9, snapshot_overflow=1)), "not everything was recorded: 1 of 9 frames (10 bytes) are lost"),
        (report(account(9), unsafe_frames=4, unsafe_bytes=40), "4 of 9 frames (40 bytes) are lost"),
        (report({**account(9), "sent": _only_frames(account(3, held=1))}), "1 of 12 frames (10 bytes) are lost"),
        (
            report(account(9), fault="broken"),
            "all frames of the links are in the files, but not all ticks and notes: broken",
        ),
        (report(ticks=account(50, held=9), fault="full"), "no frame arrived, but not all ticks and notes: full"),
        (report(account(9), ledger_recorded=False), "but not all ticks and notes"),
    ],
)
def test_what_is_missing_is_counted(last: dict[str, Any], sentence: str) -> None:
    assert loss_of(last).startswith("/data/s_0: ")
    assert sentence in loss_of(last)


def test_a_recorder_that_died_while_the_medium_refused_has_lost_what_it_held() -> None:
    link = {"kind": "udp", "state": "good", "hint": "", "frames": 0, "bytes": 0}
    links = {"a": {**link, "ledger": account(20, held=5, buffer_overflow=2)}}
    common = {"t_ns": 1, "links": links, "snapshot": None, "next_seq": 0}
    refusing = from_table(RecorderReport, {**common, "storage": {"state": "error"}})
    opening = from_table(RecorderReport, {**common, "storage": {"state": "opening"}})
    well = from_table(RecorderReport, {**common, "storage": {"state": "ok"}})
    assert "7 of 30 frames" in loss_of(report(account(10)), refusing)
    assert "7 of 30 frames" in loss_of(report(account(10)), opening)
    assert "2 of 30 frames" in loss_of(report(account(10)), well)
    assert "7 of 30 frames" in loss_of(report(account(10)), refusing, refusing)  # the next one died before it reported
    assert loss_of(report(), None) == ""


def test_a_recorder_that_never_reported_its_stop_is_not_a_success() -> None:
    assert "before it closed its files" in (SessionResult().describe_loss(FOLDER) or "")


def test_a_ledger_that_no_medium_takes_is_kept(tmp_path: Path) -> None:
    ledger = from_table(LedgerRecord, {**LEDGER, "links": {}, "ticks": NONE})
    text = save_ledger(ledger, "s_0", tmp_path)
    path = tmp_path / "s_0_ledger.json"
    assert str(path) in text and json.loads(path.read_text()) == to_table(ledger)
    assert path.stat().st_mode & 0o777 == 0o600
    assert save_ledger(ledger, "s_0", tmp_path / "none") == f"the last ledger: {path.read_text()}"
