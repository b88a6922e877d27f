"""``fti verify`` and ``recover``: what they say of good, killed and damaged recordings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fti.cli.main import main
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.recording import Recording
from fti.logger.session import SessionFolder
from fti.logger.verify import read_books, verify

STARTED = 1_767_323_045_000_000_000
SECOND = 1_000_000_000
LINKS = [RawTopic("ins", "udp", {}), RawTopic("radar", "serial", {})]
Entry = dict[str, Any]


def open_log(folder: SessionFolder, links: list[RawTopic] = LINKS) -> RawLog:
    return RawLog(folder, links, split_s=2, split_mb=100, metadata={"fti": {"origin": "hil"}})


def entry(frames: int, lost: int = 0) -> Entry:
    dropped = {"buffer_overflow": {"frames": lost, "bytes": 10 * lost}} if lost else {}
    arrived = {"in_frames": frames + lost, "in_bytes": 10 * (frames + lost)}
    return {**arrived, "recorded_frames": frames, "recorded_bytes": 10 * frames, "dropped": dropped}


def record(
    folder: SessionFolder, seqs: range, skip: Callable[[int], bool] = lambda seq: False, lost: int = 0
) -> RawLog:
    """Frames of 10 bytes at 50 Hz, in turn of the two links; a ledger each second.  The log is left open."""
    log = open_log(folder)
    counts = {"ins": 0, "radar": 0}
    for seq in seqs:
        t_ns = STARTED + seq * SECOND // 50
        link = "ins" if seq % 2 else "radar"
        if not skip(seq):
            log.frame(link, seq, t_ns, bytes(10))
            counts[link] += 1
        if seq % 50 == 49:
            note(log, t_ns, counts, lost)
        log.flush()
    return log


def note(log: RawLog, t_ns: int, counts: dict[str, int], lost: int = 0) -> None:
    log.json("/fti/ledger", t_ns, {"t_ns": t_ns, "links": {link: entry(n, lost) for link, n in counts.items()}})


@pytest.fixture
def folder(tmp_path: Path) -> SessionFolder:
    return SessionFolder.create(tmp_path, "s", STARTED)


def test_a_whole_recording_holds(folder: SessionFolder) -> None:
    record(folder, range(500)).close()
    report = verify(Recording.open(folder.path))
    assert report.findings == [] and report.holds and report.ledger
    assert (report.numbered, report.missing, report.files) == (500, 0, 5)
    assert main(["verify", str(folder.path)]) == 0


def test_sent_bytes_are_numbered_with_the_frames(folder: SessionFolder) -> None:
    log = open_log(folder)
    log.frame("ins", 0, STARTED, b"a")
    log.sent("ins", 1, STARTED, b"b")
    log.tick(2, STARTED)
    log.close()
    assert verify(Recording.open(folder.path)).holds


def test_missing_numbers_are_named(folder: SessionFolder) -> None:
    log = open_log(folder)
    for seq in (*range(1, 10), *range(12, 20), *range(21, 30)):
        log.frame("ins", seq, STARTED + seq, b"x")
    log.close()
    report = verify(Recording.open(folder.path))
    assert report.findings == ["4 numbers are missing: 0, 10-11, 20"] and report.missing == 4
    assert main(["verify", str(folder.path)]) == 3
    alone = verify(Recording.open(folder.files("raw")[0]))
    assert alone.findings == ["3 numbers are missing: 10-11, 20"]  # a single split may begin anywhere


def test_a_number_that_stands_twice_is_told(folder: SessionFolder) -> None:
    log = open_log(folder)
    for seq in (0, 1, 1, 2):
        log.frame("ins", seq, STARTED + seq, b"x")
    log.close()
    assert verify(Recording.open(folder.path)).findings == ["/raw/ins: the number 1 comes after 1; it stands twice"]


def test_time_runs_forward_on_each_link(folder: SessionFolder) -> None:
    log = open_log(folder)
    for seq, (link, ms) in enumerate([("ins", 10.0), ("radar", 5.0), ("ins", 9.5), ("radar", 6.0), ("ins", 5.0)]):
        log.frame(link, seq, STARTED + round(ms * 1e6), b"x")  # 0.5 ms back is two readings of the clocks, 4.5 is not
    log.close()
    assert verify(Recording.open(folder.path)).findings == ["/raw/ins: the time goes back 1 times"]


def test_dropped_frames_are_a_loss(folder: SessionFolder) -> None:
    record(folder, range(100), lost=3).close()
    assert sorted(verify(Recording.open(folder.path)).findings) == [
        "/raw/ins: 3 frames (30 bytes) were dropped: buffer_overflow",
        "/raw/radar: 3 frames (30 bytes) were dropped: buffer_overflow",
    ]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"recorded_frames": 11, "in_frames": 11}, "tells of 11 recorded frames, the files hold 10"),
        ({"recorded_frames": 9, "in_frames": 9}, "tells of 9 recorded frames, the files hold 10"),
        ({"recorded_bytes": 99}, "tells of 99 recorded bytes, the files hold 100"),
        ({"in_frames": 12}, "12 frames came in, 10 were recorded or dropped"),
    ],
)
def test_a_ledger_that_disagrees_is_told(folder: SessionFolder, change: Entry, words: str) -> None:
    log = open_log(folder)
    for seq in range(10):
        log.frame("ins", seq, STARTED + seq, bytes(10))
    log.json("/fti/ledger", STARTED + 10, {"t_ns": 0, "links": {"ins": {**entry(10), **change}}})
    log.close()
    findings = verify(Recording.open(folder.path)).findings
    assert len(findings) == 1 and words in findings[0]


def test_books_behind_the_frames_may_be_short(folder: SessionFolder) -> None:
    """A killed recorder has written frames after its last ledger."""
    log = open_log(folder)
    for seq in range(10):
        log.frame("ins", seq, STARTED + seq, bytes(10))
        if seq == 5:
            log.json("/fti/ledger", STARTED, {"t_ns": 0, "links": {"ins": {**entry(5), "in_frames": 7}}})
    log.close()
    assert verify(Recording.open(folder.path)).findings == []


def test_books_of_a_restarted_recorder_are_added(folder: SessionFolder) -> None:
    for run, (first, frames) in enumerate([(0, 30), (30, 20)]):
        log = open_log(folder)
        for seq in range(first, first + frames):
            log.frame("ins", seq, STARTED + seq, bytes(10))
        log.json("/fti/ledger", STARTED + seq, {"t_ns": 0, "links": {"ins": entry(frames - run, lost=run)}})
        log.close()
    books = read_books(Recording.open(folder.path))
    assert books.restarted and books.links["ins"].recorded_frames == 49
    assert books.links["ins"].dropped == {"buffer_overflow": (1, 10)}


def test_a_killed_recording_is_told_then_recovered(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    log = record(folder, range(230))
    log._log.part.abandon()  # as a kill leaves it
    path = log.path
    assert main(["verify", str(folder.path)]) == 3
    assert f"{path.name}: ends after byte" in capsys.readouterr().out
    assert main(["info", str(folder.path)]) == 3
    assert "was cut off" in capsys.readouterr().out
    assert main(["recover", str(folder.path), "--in-place"]) == 0
    assert f"{path}: closed with" in capsys.readouterr().out
    assert main(["verify", str(folder.path)]) == 0
    assert main(["recover", str(folder.path), "--in-place"]) == 0
    assert "is finished" in capsys.readouterr().out


def test_every_flipped_byte_of_a_chunk_is_found(folder: SessionFolder) -> None:
    record(folder, range(60)).close()
    path = folder.files("raw")[0]
    whole = path.read_bytes()
    begin = whole.index(b"/raw/radar") + 20
    for at in range(begin, begin + 600, 13):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x10]) + whole[at + 1 :])
        assert not verify(Recording.open(folder.path)).holds, at
    path.write_bytes(whole)
    assert verify(Recording.open(folder.path)).holds


def test_a_damaged_summary_is_found(folder: SessionFolder) -> None:
    record(folder, range(60)).close()
    path = folder.files("raw")[0]
    whole = path.read_bytes()
    at = len(whole) - 100
    path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x10]) + whole[at + 1 :])
    findings = verify(Recording.open(folder.path)).findings
    assert len(findings) == 1 and path.name in findings[0] and "summary" in findings[0]


def test_recover_leaves_damage_alone(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder.next_path("raw")
    path.write_bytes(b"nonsense")
    assert main(["recover", str(folder.path), "--in-place"]) == 3
    assert "was not written by this program" in capsys.readouterr().err
    assert path.read_bytes() == b"nonsense"
