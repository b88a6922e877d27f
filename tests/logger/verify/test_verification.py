"""``fti verify``: an intact session passes, and every missing or changed byte is found."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.stream_reader import StreamReader

from fti.cli.main import main
from fti.logger.derived_log import DerivedLog
from fti.logger.log_layout import LogSettings
from fti.logger.reading import record_cursor
from fti.logger.reading.record_cursor import ChunkHead, chunk_head
from fti.logger.reading.recording import Recording
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.recovery.extract import extract_session
from fti.logger.session import SessionFolder
from fti.logger.verify.gap_check import GapNotes
from fti.logger.verify.ledger import LedgerReader
from fti.logger.verify.ledger_check import LedgerCheck
from fti.logger.verify.report import CheckResult, VerifyReport
from fti.logger.verify.sequence_check import SequenceCheck
from fti.logger.verify.verification import verify
from tests.logger.small_session import STARTED, TURN, Recorder, Table, make, open_log, time_of

FRAMES = 500
assert settings.default
SCALE = max(1, settings.default.max_examples // 100)


@pytest.fixture
def folder(tmp_path: Path) -> SessionFolder:
    return SessionFolder.create(tmp_path, "s", STARTED)


@pytest.fixture(scope="module")
def parent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the examples of a property make their sessions."""
    return tmp_path_factory.mktemp("sessions")


class Whole:
    """The raw files of a whole session, which a block may change."""

    def __init__(self, folder: SessionFolder) -> None:
        self.path = folder.path
        self._files = [(path, path.read_bytes()) for path in folder.files("raw")]

    def prove(self, file: int = 0, change: Callable[[bytes], bytes] = lambda content: content) -> VerifyReport:
        """With one file changed."""
        path, content = self._files[file]
        path.write_bytes(change(content))
        try:
            return verify(Recording.open(self.path))
        finally:
            path.write_bytes(content)


@pytest.fixture(scope="module")
def whole(parent: Path) -> Whole:
    return Whole(make(SessionFolder.create(parent, "whole", STARTED), 420))


NO_LEDGER = "no ledger in these files: complete reception cannot be verified"


def report_on(folder: SessionFolder) -> VerifyReport:
    return verify(Recording.open(folder.path))


def once(parent: Path, **keys: Any) -> VerifyReport:
    """Make a session, prove it, remove it."""
    folder = make(SessionFolder.create(parent, "once", STARTED), FRAMES, **keys)
    try:
        return report_on(folder)
    finally:
        shutil.rmtree(folder.path)


def check(report: VerifyReport, name: str) -> tuple[CheckResult, list[str]]:
    """Result and sentences of one check."""
    found = next(c for c in report.checks if c.name == name)
    return found.result, [text for _, text in found.lines]


# ------------------------------------------------------------------------------------------------------- what holds


def test_a_whole_session_holds(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    make(folder)
    report = report_on(folder)
    assert report.findings == [] and report.result is CheckResult.OK
    assert {c.result for c in report.checks} == {CheckResult.OK}
    assert (report.numbered, report.missing, report.files, report.ledgers) == (FRAMES, 0, 3, 11)
    assert main(["verify", str(folder.path)]) == 0
    text = capsys.readouterr().out
    assert "all holds: 3 files, 500 numbered messages" in text
    assert "/tx/radar" in text and "/tx/ins" not in text  # nothing was sent there


def test_a_copy_of_a_recovery_is_not_whole_where_a_checksum_did_not_hold(folder: SessionFolder, tmp_path: Path) -> None:
    """Its own checksums hold; a copy of the copy says so as well, one of a sound session is whole."""
    make(folder)
    sound = extract_session(folder.path, tmp_path / "sound", print)
    assert sound.complete and verify(Recording.open(tmp_path / "sound")).holds
    path = folder.files("raw")[0]
    with TolerantFile(path) as source:
        chunk_at = next(at for at in range(source.size) if (head := chunk_head(source, at)) and head.content(source))
        head = chunk_head(source, chunk_at)
    assert head
    content = bytearray(path.read_bytes())
    content[head.end - 1] ^= 4  # of the last message
    path.write_bytes(content)
    for session, out in ((folder.path, tmp_path / "copy"), (tmp_path / "copy", tmp_path / "again")):
        extract_session(session, out, print)
        report = verify(Recording.open(out))
        assert report.result is CheckResult.LOSS
        assert any("messages had no valid checksum" in text for text in report.findings)


def test_accounts_are_made_again_from_the_frames(folder: SessionFolder) -> None:
    make(folder, socket=4)
    account = next(a for a in report_on(folder).accounts if a.topic == "/raw/ins")
    frames = [seq for seq in range(FRAMES) if TURN[seq % len(TURN)] == "/raw/ins"]
    assert account.recorded == (len(frames), sum(6 + seq % 7 for seq in frames))
    assert account.incoming.frames == len(frames) + 4
    assert account.dropped == {"socket_queue": (4, 0)}


@given(late=st.sets(st.integers(0, FRAMES - 60), max_size=40))
@settings(max_examples=15 * SCALE)
def test_frames_that_are_held_at_a_ledger_and_written_later_are_there(parent: Path, late: set[int]) -> None:
    """A link is written in its order, so all behind the first that waits wait too."""
    waiting = {seq for first in late for seq in range(first, first - first % 50 + 50) if (seq - first) % 6 == 0}
    waiting |= {seq + 3 for seq in waiting if TURN[seq % 6] == "/raw/ins" and (seq + 3) // 50 == seq // 50}
    waiting = {seq for seq in waiting if TURN[seq % 6] != "/raw/ins"}
    assert once(parent, late=waiting).findings == []


def test_a_single_file_is_verified_as_far_as_it_goes(folder: SessionFolder) -> None:
    make(folder)
    for path in folder.files("raw"):
        report = verify(Recording.open(path))
        assert report.holds, report.findings
        assert report.ledgers >= 2
    text = check(verify(Recording.open(folder.files("raw")[1])), "recorders")
    assert text[0] is CheckResult.NOTE and "it continued in another file" in text[1][0]


def test_what_navigation_lost_is_reported(folder: SessionFolder) -> None:
    make(folder)
    log = DerivedLog(folder, LogSettings(split_s=300, split_mb=100))
    log.write_table("/fti/gap", STARTED, {"t_ns": STARTED, "text": "17 frames were overwritten"})
    log.close()
    report = report_on(folder)
    assert report.holds
    assert check(report, "gaps") == (CheckResult.NOTE, ["03:04:05.000: 17 frames were overwritten"])


def test_without_a_ledger_only_the_sequence_is_verified(folder: SessionFolder) -> None:
    log = open_log(folder)
    for seq in range(10):
        log.write_tick(seq, time_of(seq))
    log.close()
    report = report_on(folder)
    assert report.result is CheckResult.LOSS and report.findings == [NO_LEDGER]


def test_a_time_without_ticks_is_reported(folder: SessionFolder) -> None:
    log = open_log(folder)
    for seq, t_s in enumerate((0.0, 0.02, 2.5, 2.52)):
        log.write_tick(seq, STARTED + round(t_s * 1e9))
    log.close()
    assert check(report_on(folder), "ticks") == (CheckResult.NOTE, ["none for 2.48 s from 03:04:05.020 on"])


def test_numbers_in_two_files_count_once(folder: SessionFolder) -> None:
    """Where a medium failed in the middle of a write, the next one gets the same again."""
    recorder = Recorder(open_log(folder), 0).run(100)
    recorder.log.close()
    recorder.log = open_log(folder)
    for seq in range(94, 100):
        recorder.write(seq)
    recorder.run(100).end()
    report = report_on(folder)
    assert check(report, "sequence")[0] is CheckResult.NOTE
    assert "6 numbers occur in two files" in check(report, "sequence")[1][0]
    assert check(report, "ledger")[0] is CheckResult.OK


def test_ledgers_that_stand_on_two_media_count_once(folder: SessionFolder) -> None:
    """What a medium had not made sure of when it failed is recorded again, several ledgers too."""
    notes: list[Table] = []
    recorder = Recorder(open_log(folder), 0, doctor=lambda index, note: notes.append(note)).run(100)
    recorder.log.close()
    recorder.log = open_log(folder)
    for note in [*notes]:
        recorder.log.write_json("/fti/ledger", note["t_ns"], note)
    recorder.run(100).end()
    report = report_on(folder)
    assert report.result is CheckResult.OK, report.findings
    assert report.ledgers == 5


def often(folder: SessionFolder, **keys: Any) -> list[tuple[int, bytes]]:
    """A session whose ledgers leave out most links: one after every two frames.  The ledgers, with their times."""
    Recorder(open_log(folder), 0, **keys).run(FRAMES, ledger_every=2).end()
    return [(t_ns, data) for _, t_ns, _, _, data in Recording.open(folder.path).messages("/fti/ledger", kind="raw")]


def test_what_a_ledger_leaves_out_is_under_proof_too(folder: SessionFolder) -> None:
    ledgers = often(folder)
    assert sum(len(json.loads(data)["links"]) < 3 for _, data in ledgers) > 200
    report = report_on(folder)
    assert (report.result, report.ledgers) == (CheckResult.OK, len(ledgers)), report.findings
    for path in folder.files("raw"):
        assert verify(Recording.open(path)).holds


@given(removed=st.integers(0, FRAMES - 1))
@settings(max_examples=5 * SCALE)
def test_a_frame_that_is_taken_away_is_found_though_ledgers_leave_out_its_link(parent: Path, removed: int) -> None:
    folder = SessionFolder.create(parent, "often", STARTED)
    often(folder, removed=[removed])
    report = report_on(folder)
    shutil.rmtree(folder.path)
    assert (report.result, report.missing) == (CheckResult.REFUTED, 1)


def test_a_ledger_that_a_damage_took_does_not_refute_those_behind_it(folder: SessionFolder) -> None:
    """What they leave out is not known then, and not what stood in an earlier one."""
    ledgers = often(folder)
    for lost in range(1, 100, 7):
        proof = LedgerCheck(SequenceCheck(), is_from_start=True)
        for n, ledger in enumerate(ledgers):
            if n != lost:
                proof.feed(*ledger)
        assert (proof.findings, proof.unreadable, proof.notes) == ([], 0, len(ledgers) - 1)
        reader = LedgerReader()
        notes = [reader.read(*ledger) for n, ledger in enumerate(ledgers) if n != lost]
        assert not notes[lost].whole or json.loads(ledgers[lost + 1][1])["complete"]
        assert notes[-1].whole


def test_ledgers_of_a_failed_medium_count_once_though_the_next_file_begins_with_a_complete_one(
    folder: SessionFolder,
) -> None:
    notes: list[Table] = []
    recorder = Recorder(open_log(folder), 0, doctor=lambda index, note: notes.append(note)).run(100, ledger_every=2)
    recorder.log.close()
    recorder.log = open_log(folder)
    for note in notes[-5:]:
        recorder.log.write_json("/fti/ledger", note["t_ns"], note)
    recorder.run(100, ledger_every=2).end()
    report = report_on(folder)
    assert (report.result, report.ledgers) == (CheckResult.OK, 101), report.findings


def test_a_place_that_is_given_twice_is_looked_at_once(folder: SessionFolder, tmp_path: Path) -> None:
    make(folder)
    (tmp_path / "again").symlink_to(folder.path)
    report = verify(Recording.open(folder.path, tmp_path / "again", folder.files("raw")[0]))
    assert (report.files, report.result) == (len(folder.files("raw")), CheckResult.OK)
    assert check(report, "sequence")[0] is CheckResult.OK


def test_ledgers_of_a_silent_link_do_not_wait_for_it(folder: SessionFolder) -> None:
    recorder = Recorder(open_log(folder, split_s=1000), 0).run(30)
    recorder.ledger()
    silent = json.loads(json.dumps(recorder.note()))["links"]["bus"] | {"errors": {}}
    note = recorder.note()
    proof = LedgerCheck(SequenceCheck(), is_from_start=True)
    for n in range(1000):
        note["links"] = {"quiet": silent}
        note["t_ns"] = time_of(n)
        note["next_seq"] = 30 + n
        proof.feed(time_of(n), json.dumps(note).encode())
    assert max(len(marks) for marks in proof._marks.values()) <= 3
    recorder.end()


# ---------------------------------------------------------------------------------------------------- what is refuted


@given(removed=st.sets(st.integers(0, FRAMES - 1), min_size=1, max_size=20))
@settings(max_examples=25 * SCALE)
def test_frames_that_are_taken_away_are_found(parent: Path, removed: set[int]) -> None:
    report = once(parent, removed=removed)
    assert report.result is CheckResult.REFUTED
    assert report.missing == len(removed)


@given(which=st.integers(0, 10), choice=st.integers(0, 10**6), by=st.integers(-5, 10**6).filter(bool))
@settings(max_examples=40 * SCALE)
def test_every_number_of_a_ledger_is_verified(parent: Path, which: int, choice: int, by: int) -> None:
    changed = []

    def doctor(index: int, note: dict[str, Any]) -> None:
        if index == which:
            numbers = list(numbers_in(note))
            place, key = numbers[choice % len(numbers)]
            place[key] += by
            changed.append((key, note))

    report = once(parent, doctor=doctor, socket=3, lost=range(120, 140))
    assert changed and report.result is CheckResult.REFUTED, changed


def numbers_in(table: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str]]:
    """Every number of a ledger but those of line errors, which no other record confirms."""
    for key, value in table.items():
        if isinstance(value, dict) and key != "errors":
            yield from numbers_in(value)
        elif isinstance(value, int) and not isinstance(value, bool):
            yield table, key


@given(file=st.integers(0, 2), place=st.floats(0, 1, exclude_max=True), mask=st.integers(1, 255))
@settings(max_examples=100 * SCALE)
def test_every_flipped_byte_is_found(whole: Whole, file: int, place: float, mask: int) -> None:
    def flip(content: bytes) -> bytes:
        at = int(place * len(content))
        return content[:at] + bytes([content[at] ^ mask]) + content[at + 1 :]

    assert not whole.prove(file, flip).holds


@given(file=st.integers(0, 2), place=st.floats(0, 1, exclude_max=True))
@settings(max_examples=30 * SCALE)
def test_every_cut_is_found(whole: Whole, file: int, place: float) -> None:
    assert not whole.prove(file, lambda content: content[: int(place * len(content))]).holds
    assert whole.prove().holds


def test_a_file_that_is_missing_is_named(folder: SessionFolder) -> None:
    make(folder)
    folder.files("raw")[1].unlink()
    report = report_on(folder)
    assert check(report, "splits") == (CheckResult.REFUTED, ["raw files 1 are missing"])
    assert check(report, "sequence")[0] is CheckResult.REFUTED
    assert main(["verify", str(folder.path)]) == 1


def test_missing_numbers_are_named(folder: SessionFolder) -> None:
    log = open_log(folder)
    for seq in (*range(1, 10), *range(12, 20), *range(21, 30)):
        log.write_frame("ins", seq, STARTED + seq, b"x")
    log.close()
    report = report_on(folder)
    assert report.missing == 4
    assert "4 numbers are missing: 0, 10-11, 20 " in report.findings[0]
    assert "no ledger accounts for them" in report.findings[0]


def test_a_number_that_stands_twice_is_reported(folder: SessionFolder) -> None:
    log = open_log(folder)
    for seq in (0, 1, 1, 2):
        log.write_frame("ins", seq, STARTED + seq, b"x")
    log.close()
    assert "1 numbers occur twice in a file" in report_on(folder).findings


def test_numbers_of_a_link_rise(folder: SessionFolder) -> None:
    log = open_log(folder)
    for seq in (0, 2, 1, 3):
        log.write_frame("ins", seq, STARTED, b"x")
    log.close()
    assert report_on(folder).findings == ["/raw/ins: the numbers do not increase 1 times", NO_LEDGER]


def test_time_runs_forward_on_each_link(folder: SessionFolder) -> None:
    log = open_log(folder)
    for seq, (link, ms) in enumerate([("ins", 10.0), ("radar", 5.0), ("ins", 9.5), ("radar", 6.0), ("ins", 5.0)]):
        log.write_frame(link, seq, STARTED + round(ms * 1e6), b"x")  # two clock readings explain 0.5 ms back, not 4.5
    log.close()
    assert report_on(folder).findings == ["/raw/ins: the time goes back 1 times", NO_LEDGER]


def test_error_frames_are_counted_again(folder: SessionFolder) -> None:
    def doctor(index: int, note: dict[str, Any]) -> None:
        note["links"]["bus"]["errors"]["can_error_frames"] += note["final"]

    make(folder, doctor=doctor)
    assert check(report_on(folder), "ledger") == (
        CheckResult.REFUTED, ["/raw/bus: 17 error frames, the ledger states 18"],
    )  # fmt: skip


@pytest.mark.parametrize("count", [0, 1000])
def test_line_errors_do_not_become_fewer(folder: SessionFolder, count: int) -> None:
    make(folder, doctor=lambda i, note: i == 3 and note["links"]["bus"]["errors"].update(can_rx_overflow=count))
    assert any("counts less than an earlier one" in text for text in check(report_on(folder), "ledger")[1])


def test_a_ledger_that_is_none_is_reported(folder: SessionFolder) -> None:
    make(folder, doctor=lambda index, note: note.pop("ticks") if index == 3 else None)
    assert report_on(folder).findings == ["1 ledgers cannot be read"]


@pytest.mark.parametrize("spoil", [{"t_ns": 10**30}, {"next_seq": 2**64}, {"links": []}])
def test_a_ledger_of_impossible_numbers_is_reported(folder: SessionFolder, spoil: Table) -> None:
    make(folder, doctor=lambda index, note: note.update(spoil) if index == 3 else None)
    assert report_on(folder).findings == ["1 ledgers cannot be read"]


@pytest.mark.parametrize("spoil", [b'{"kind": "buffer_overflow", "link": "a", "first_seq": 1e999}', b"[" * 100_000])
def test_a_note_of_a_gap_that_says_nothing_is_reported(spoil: bytes) -> None:
    gaps = GapNotes()
    gaps.feed(0, spoil, raw=True)
    proof = LedgerCheck(SequenceCheck(), is_from_start=True)
    proof.feed(0, spoil)
    assert gaps.unreadable == proof.unreadable == 1


# ------------------------------------------------------------------------------------------------------------- losses


def test_dropped_frames_are_a_loss_with_its_reason(folder: SessionFolder, capsys: pytest.CaptureFixture[str]) -> None:
    make(folder, lost=range(100, 112), socket=2)
    report = report_on(folder)
    assert report.result is CheckResult.LOSS
    assert "12 numbers are missing: 100-111 " in report.findings[0]
    assert "/raw/radar: 2 frames (23 bytes) were dropped: buffer_overflow" in report.findings
    assert "/raw/ins: 2 frames were dropped: socket_queue" in report.findings
    assert main(["verify", str(folder.path), "--json"]) == 3
    output = json.loads(capsys.readouterr().out)
    assert output["accounts"]["/raw/ins"]["dropped"] == {
        "socket_queue": {"frames": 2, "bytes": 0},
        "buffer_overflow": {"frames": 4, "bytes": 37},
    }
    assert (output["verdict"], output["holds"], output["missing"]) == ("loss", False, 12)


def _refusing(per_ledger: int) -> Callable[[int, Table], None]:
    """So many stamps of ins are refused before each ledger."""

    def doctor(index: int, note: Table) -> None:
        note["links"]["ins"]["stamp_refused"] = per_ledger * (index + 1)

    return doctor


def test_refused_stamps_are_a_loss_and_those_of_several_recorders_are_added(folder: SessionFolder) -> None:
    Recorder(open_log(folder), 0, doctor=_refusing(10)).run(200).end()  # five ledgers
    Recorder(open_log(folder), 200, doctor=_refusing(1)).run(100).end()  # three
    report = report_on(folder)
    assert report.result is CheckResult.LOSS
    result, lines = check(report, "stamps")
    assert result is CheckResult.LOSS
    assert lines == ["/raw/ins: 53 frames have the time at which they were read: the kernel's timestamps were refused"]
    assert check(report, "ledger")[0] is CheckResult.OK


def test_a_single_file_reports_the_stamps_that_were_refused_in_it(folder: SessionFolder) -> None:
    Recorder(open_log(folder), 0, doctor=_refusing(10)).run(200).end()
    Recorder(open_log(folder), 200).run(100).end()
    first, *_, last = (check(verify(Recording.open(path)), "stamps")[0] for path in folder.files("raw"))
    assert (first, last) == (CheckResult.LOSS, CheckResult.OK)


@pytest.mark.parametrize(("frames", "result"), [(4, CheckResult.OK), (13, CheckResult.REFUTED)])
def test_notes_of_gaps_must_fit_the_holes(folder: SessionFolder, frames: int, result: CheckResult) -> None:
    recorder = Recorder(open_log(folder), 0, lost=range(100, 112)).run(200)
    span = {"first_seq": 100, "last_seq": 111, "first_t_ns": time_of(100), "last_t_ns": time_of(111)}
    about = {"t_ns": time_of(112), "kind": "buffer_overflow", "link": "ins", "frames": frames, "bytes": 0}
    recorder.log.write_json("/fti/gap", time_of(112), {**about, **span, "text": "dropped"})
    recorder.end()
    report = report_on(folder)
    assert check(report, "gaps")[0] is result
    assert "notes of gaps for 12" in check(report, "sequence")[1][0]


def kill_and_go_on(folder: SessionFolder, held: tuple[int, ...], again: int) -> None:
    """A recorder that is killed at number 220 with some numbers in its buffers, and the next one."""
    Recorder(open_log(folder), 0, held=held).run(220).kill()
    Recorder(open_log(folder), again).run(200).end()


def test_what_a_killed_recorder_received_and_never_wrote_is_reported(folder: SessionFolder) -> None:
    kill_and_go_on(folder, held=(215, 218, 219), again=222)
    report = report_on(folder)
    assert report.result is CheckResult.LOSS and report.missing == 5
    assert check(report, "sequence")[1] == [
        "5 numbers are missing: 215, 218-221 (03:04:07.140 to 03:04:07.220); they were received and never written"
    ]
    (text,) = check(report, "recorders")[1]
    assert "recorder 1000 ended without a final ledger after its ledger of 03:04:07.000" in text
    assert "it assigned 22 more numbers, 5 of them are missing" in text


def test_a_seam_without_a_hole_is_reported(folder: SessionFolder) -> None:
    kill_and_go_on(folder, held=(), again=220)
    report = report_on(folder)
    assert report.result is CheckResult.LOSS and report.missing == 0
    assert check(report, "sequence")[0] is check(report, "ledger")[0] is CheckResult.OK
    assert "it assigned 20 more numbers, none is missing" in check(report, "recorders")[1][0]


def test_frames_that_a_killed_recorder_had_written_are_verified_to_its_last_ledger(folder: SessionFolder) -> None:
    Recorder(open_log(folder), 0, removed=[150]).run(220).kill()
    Recorder(open_log(folder), 220).run(100).end()
    assert report_on(folder).result is CheckResult.REFUTED


def test_accounts_of_several_recorders_are_added(folder: SessionFolder) -> None:
    Recorder(open_log(folder), 0, socket=5).run(220).kill()
    Recorder(open_log(folder), 220, socket=7, lost=range(300, 306)).run(100).end()
    account = next(a for a in report_on(folder).accounts if a.topic == "/raw/ins")
    assert account.dropped == {"socket_queue": (12, 0), "buffer_overflow": (2, 20)}
    assert account.incoming.frames == 107 + 12


def test_a_power_cut_is_reported_before_and_after_the_repair(
    folder: SessionFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    Recorder(open_log(folder), 0).run(230).kill()
    path = folder.files("raw")[-1]
    assert main(["verify", str(folder.path)]) == 3
    assert f"{path.name}: ends after byte" in capsys.readouterr().out
    assert main(["recover", str(folder.path), "--in-place"]) == 3
    assert "not verified to be complete" in capsys.readouterr().out
    assert main(["verify", str(folder.path)]) == 3
    text = capsys.readouterr().out
    assert "ends after byte" not in text
    assert "whether it received more is not known" in text


def test_what_the_medium_took_no_more_is_a_loss_of_the_end(folder: SessionFolder) -> None:
    make(folder, held=range(490, 500))
    report = report_on(folder)
    assert report.result is CheckResult.LOSS and report.missing == 10
    assert "/raw/ins: 3 frames (26 bytes) were dropped: storage" in report.findings


def test_a_session_that_is_being_recorded_is_reported(folder: SessionFolder) -> None:
    recorder = Recorder(open_log(folder), 0).run(230)
    report = report_on(folder)
    assert report.result is CheckResult.LOSS
    assert f"{folder.files('raw')[-1].name}: is being written" in report.findings
    assert "the session is being recorded" in check(report, "recorders")[1][0]
    recorder.end()
    assert report_on(folder).holds


def test_a_file_that_grows_while_it_is_verified_is_not_refuted(
    folder: SessionFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between this program's look and the official reader's, and between two looks at the head of the open chunk."""
    recorder = Recorder(open_log(folder, split_s=1000), 0).run(75)
    with monkeypatch.context() as patch:
        stream_read = StreamReader.__init__

        def late(*args: Any, **keys: Any) -> None:
            recorder.run(5)
            stream_read(*args, **keys)

        patch.setattr(StreamReader, "__init__", late)
        report = report_on(folder)
        assert report.result is CheckResult.LOSS, report.findings
    with monkeypatch.context() as patch:

        def patched(source: TolerantFile, at: int) -> ChunkHead | None:
            recorder.run(5)
            return chunk_head(source, at)

        patch.setattr(record_cursor, "chunk_head", patched)
        report = report_on(folder)
        assert report.result is CheckResult.LOSS, report.findings
    recorder.end()
    assert report_on(folder).holds


# ---------------------------------------------------------------------------------------------------------- snapshots


def snapshot(folder: SessionFolder, seqs: Iterable[int], spoil: int | None = None, **keys: Any) -> None:
    """A copy of some numbers in a file of its own."""
    recorder = Recorder(open_log(folder, kind="snapshot", **keys), 0)
    for seq in seqs:
        if seq == spoil:
            recorder.log.write_frame("ins", seq, time_of(seq), b"other")
        else:
            recorder.write(seq)
    recorder.log.close()


def test_snapshots_are_copies(folder: SessionFolder) -> None:
    make(folder)
    snapshot(folder, range(150, 350))
    report = report_on(folder)
    assert report.result is CheckResult.OK, report.findings
    text = next(c for c in report.checks if c.name == "snapshots").text
    assert text == "1 files with 200 numbered messages; 200 are in raw files too, identical"


def test_a_snapshot_that_differs_is_refuted(folder: SessionFolder) -> None:
    make(folder)
    snapshot(folder, range(150, 350), spoil=201)
    assert report_on(folder).findings == ["1 messages differ from the raw files"]


def test_a_snapshot_alone_is_verified_as_far_as_it_goes(folder: SessionFolder, tmp_path: Path) -> None:
    """Also under another name, and of frames that stand twice."""
    make(folder)
    snapshot(folder, range(150, 350))
    snapshot(folder, [*range(30, 40), *range(30, 40)])
    good, bad = folder.files("snapshot")
    report = verify(Recording.open(shutil.copy(good, tmp_path / "flutter.mcap")))
    assert (report.result, report.numbered, report.missing) == (CheckResult.OK, 200, 0)
    assert report.accounts[0].recorded.frames > 0
    assert "no raw file: " in check(report, "splits")[1][0]
    assert verify(Recording.open(bad)).result is CheckResult.REFUTED


def test_a_raw_file_of_mode_snapshot_alone_is_not_refuted(folder: SessionFolder, tmp_path: Path) -> None:
    """Its ledgers tell of frames that stand in the snapshots."""
    frames = [seq for seq in range(100) if TURN[seq % len(TURN)] != "/fti/tick"]
    log = open_log(folder, metadata={"fti": {"mode": "snapshot"}})
    Recorder(log, 0, removed=frames).run(100).end()
    snapshot(folder, frames, metadata={"fti": {"mode": "snapshot"}})
    report = report_on(folder)
    assert report.result is CheckResult.OK, report.findings
    assert "SNAPSHOT" in check(report, "snapshots")[1][0]
    report = verify(Recording.open(folder.files("raw")[0]))
    assert report.result is CheckResult.OK, report.findings
    assert "SNAPSHOT" in check(report, "snapshots")[1][0]
    folder.files("snapshot")[0].unlink()
    assert report_on(folder).result is CheckResult.REFUTED


def test_a_session_without_its_raw_files_is_not_whole(folder: SessionFolder) -> None:
    """What navigation made again from other files is."""
    for metadata, result in (({}, CheckResult.LOSS), ({"fti": {"reprocessed": "true"}}, CheckResult.OK)):
        log = DerivedLog(folder, LogSettings(split_s=2, split_mb=100, metadata=metadata))
        log.write_table("/fti/gap", STARTED, {"t_ns": STARTED, "text": "late"})
        log.close()
        report = report_on(folder)
        assert report.result is result, report.findings
        folder.files("derived")[0].unlink()


def test_missing_derived_files_are_named_without_raw_ones_too(folder: SessionFolder) -> None:
    for _ in range(3):
        log = DerivedLog(folder, LogSettings(split_s=2, split_mb=100))
        log.write_table("/fti/gap", STARTED, {"t_ns": STARTED, "text": "late"})
        log.close()
    folder.files("derived")[1].unlink()
    assert "derived files 1 are missing" in report_on(folder).findings
