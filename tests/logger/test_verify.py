"""``fti verify``, ``info``, ``recover`` and ``export``: what they say of good, killed and damaged recordings."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fti.cli.info import activity_bar, size_text
from fti.cli.main import main
from fti.logger.csv_export import flatten
from fti.logger.derived_log import DerivedLog
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.recording import Recording
from fti.logger.session import SessionFolder
from fti.logger.verify import read_books, verify
from fti.types import GlideSlope, ImuSample, Reason, Stamp

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
    log._log._writer.abandon()  # as a kill leaves it
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


# --------------------------------------------------------------------------------------------------- info, export


def test_info_as_json(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    record(folder, range(500), skip=lambda seq: seq % 2 == 1 or 200 <= seq < 300).close()
    assert main(["info", str(folder.path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["metadata"]["fti"] == {"origin": "hil"} and told["links"] == {"ins": "udp", "radar": "serial"}
    topics = {topic["topic"]: topic for topic in told["topics"]}
    radar = topics["/raw/radar"]
    assert (radar["messages"], radar["bytes"]) == (200, 2000)
    assert radar["first_ns"] == STARTED and radar["longest_gap_s"] == pytest.approx(2.04, abs=1e-9)
    assert sum(radar["activity"]) == 200 and 0 in radar["activity"]
    assert topics["/raw/ins"]["messages"] == 0 and topics["/raw/ins"]["rate_hz"] is None
    assert len(told["files"]) == len(folder.files("raw"))


def test_info_as_text(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    record(folder, range(500), skip=lambda seq: seq % 2 == 1).close()
    assert main(["info", str(folder.path)]) == 0
    text = capsys.readouterr().out
    assert "2026-01-02 03:04:05 UTC" in text and "origin hil" in text
    line = next(line for line in text.splitlines() if line.startswith("/raw/radar"))
    assert line.split()[1:6] == ["250", "2.5", "kB", "25.00", "0.00"]
    assert next(line for line in text.splitlines() if line.startswith("/raw/ins")).endswith("silent")


def test_missing_sessions_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in (["info"], ["verify"], ["recover", "--in-place"], ["export", "--out", str(tmp_path / "t")]):
        assert main([*command, str(tmp_path / "nothing")]) == 2
        assert "nothing: there is no such session folder or file" in capsys.readouterr().err
    assert main(["info", str(tmp_path)]) == 2
    assert "holds no MCAP files" in capsys.readouterr().err


def test_bars_and_sizes() -> None:
    assert activity_bar([0, 1, 500, 1000]) == " ▁▄█"
    assert activity_bar([0, 0]) == "  "
    assert [size_text(n) for n in (0, 999, 1500, 2_500_000, 5e12)] == ["0 B", "999 B", "1.5 kB", "2.5 MB", "5000.0 GB"]


def read_table(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_export_of_derived_and_raw(folder: SessionFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record(folder, range(100)).close()
    log = DerivedLog(folder, split_s=300, split_mb=100)
    log.measurement("imu", ImuSample(stamp=Stamp(STARTED)))
    log.measurement("imu", ImuSample(stamp=Stamp(STARTED + SECOND), accel_b=(0.1, -0.2, 9.81)))
    log.output(
        GlideSlope(t_ns=STARTED, t_valid_ns=None, valid=False, reasons=(Reason.ROLL, Reason.STALE), deviation=1e-3)
    )
    log.close()
    out = tmp_path / "deep" / "tables"
    assert main(["export", str(folder.path), "--out", str(out), "--raw"]) == 0
    assert sorted(p.name for p in out.iterdir()) == [
        "imu_imu_sample.csv", "nav_glide_slope.csv", "raw_ins.csv", "raw_radar.csv",
    ]  # fmt: skip
    imu = read_table(out / "imu_imu_sample.csv")
    assert imu[0]["accel_b.2"] == "" and imu[1]["accel_b.2"] == "9.81" and "accel_b" not in imu[0]
    assert imu[1]["stamp.t_rx_ns"] == str(STARTED + SECOND) == imu[1]["log_time_ns"]
    slope = read_table(out / "nav_glide_slope.csv")[0]
    assert (slope["reasons"], slope["deviation"], slope["sd"]) == ("roll stale", "0.001", "")
    raw = read_table(out / "raw_ins.csv")
    assert len(raw) == 50
    assert raw[0] == {"seq": "1", "t_rx_ns": str(STARTED + SECOND // 50), "length": "10", "hex": "00" * 10}
    capsys.readouterr()
    assert main(["export", str(folder.path), "--out", str(out)]) == 2
    assert "imu_imu_sample.csv: cannot be written: File exists" in capsys.readouterr().err


def test_flatten() -> None:
    value = {"a": {"b": 1, "c": [1.5, None]}, "t": ["x", "y"], "o": [{"p": 1}], "e": [], "n": None}
    assert dict(flatten(value)) == {
        "a.b": 1, "a.c.0": 1.5, "a.c.1": None, "t": "x y", "o": '[{"p": 1}]', "e": "", "n": None,
    }  # fmt: skip
