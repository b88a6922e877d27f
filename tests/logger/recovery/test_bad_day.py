"""Exit codes and outputs of the commands for damaged files, checked by the official reader."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest
from mcap.writer import CompressionType

from fti.cli.main import main
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.session import SessionFolder
from fti.logger.stream_writer import StreamWriter
from tests.logger.damaged_recordings import Original, write_foreign, write_own
from tests.logger.official_reader import MessageTuple, read_closed, read_stream

START_NS = 1_767_323_045_000_000_000
LZ4 = CompressionType.LZ4
PAYLOAD = 120


def write_session(folder: Path, seconds: int, *, finish: bool = False) -> Path:
    """A raw file as a recorder writes it: 50 frames and a sync each second; its recorder was killed."""
    session = SessionFolder.create(folder, "da42", START_NS)
    log = RawLog(session, [RawTopic("ins", "udp", {})], LogSettings(split_s=3600, split_mb=1000))
    for seq in range(50 * seconds):
        log.write_frame("ins", seq, START_NS + seq * 20_000_000, frame(seq))
        log.flush()
        if seq % 50 == 49:
            log.sync()
    if finish:
        log.close()
    path = log.path
    log.segment.abandon()  # as a kill does: descriptors go, nothing is written
    return path


def frame(seq: int) -> bytes:
    """A payload that stands nowhere else."""
    return random.Random(seq).randbytes(PAYLOAD)


def run(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str]:
    """Exit code and everything that was printed."""
    code = main([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return code, captured.out + captured.err


def flip(path: Path, at: int, mask: int = 0x10) -> None:
    data = bytearray(path.read_bytes())
    data[at] ^= mask
    path.write_bytes(data)


# ---------------------------------------------------------------------------------------------------- open chunks


def test_one_flipped_length_costs_no_record(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_session(tmp_path, 10)
    whole = path.read_bytes()
    flip(path, whole.index(frame(200)) - 30)  # the length of that message's record
    damaged = path.read_bytes()
    assert run(capsys, "verify", path.parent)[0] == 1
    code, output = run(capsys, "recover", "--in-place", path.parent)
    assert code == 3 and f"{path}: is damaged" in output and path.read_bytes() == damaged
    code, output = run(capsys, "recover", path.parent, "--out", tmp_path / "copy")
    messages = read_closed(next((tmp_path / "copy").glob("*.mcap")))
    assert code == 3 and messages == read_stream(whole)  # one bit, turned back
    assert "(50 without a checksum that covers them)" in output


def test_damage_costs_the_stretch_between_two_syncs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of an open chunk and of a finished one: the checkpoints prove the seconds around it."""
    for finish in (False, True):
        folder = tmp_path / str(finish)
        folder.mkdir()
        path = write_session(folder, 10, finish=finish)
        whole = path.read_bytes()
        at = whole.index(frame(225))
        path.write_bytes(whole[:at] + bytes(64) + whole[at + 64 :])
        code, _ = run(capsys, "recover", path.parent, "--out", folder / "copy", "--json")
        messages = read_closed(next((folder / "copy").glob("*.mcap")))
        original = read_stream(whole)
        assert code == 3 and messages == original[:200] + original[250:]


def test_a_chunk_whose_head_is_damaged_is_found_by_its_checkpoints(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_session(tmp_path, 10)
    whole = path.read_bytes()
    head = whole.index(frame(0)) - 31
    head = whole.rindex(b"\x06", 0, head)
    flip(path, head + 1, 0x80)
    run(capsys, "recover", path.parent, "--out", tmp_path / "copy")
    messages = read_closed(next((tmp_path / "copy").glob("*.mcap")))
    assert messages == read_stream(whole)


def test_unverified_messages_are_counted_before_and_after_closing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An altered message behind the last sync is sealed by closing: its second is counted."""
    path = write_session(tmp_path, 10)
    log = read_stream(path.read_bytes())
    data = bytearray(path.read_bytes())
    data[data.index(frame(499)) + 5] ^= 0xFF
    data[data.index(frame(460)) + 5] ^= 0xFF
    path.write_bytes(data)
    code, output = run(capsys, "verify", path.parent)
    assert code == 3 and "50 messages from 03:04:14.000 on are unverified" in output
    code, output = run(capsys, "recover", "--in-place", path.parent)
    assert code == 3 and "50 messages at its end are unverified" in output
    assert read_closed(path)[:450] == log[:450]
    code, output = run(capsys, "verify", path.parent)
    assert code == 3 and "50 messages from 03:04:14.000 on are unverified" in output


def test_flips_in_declarations_end_no_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of schema and channel records in an open chunk; what is closed all the same can be read by everybody."""
    path = tmp_path / "a_000.mcap"
    writer = StreamWriter(path)
    schema = writer.add_schema("fti.Note", "jsonschema", b'{"type": "object"}')
    channels = [writer.add_channel("/fti/event", "json", schema), writer.add_channel("/raw/ins", "x-fti-raw")]
    for n in range(4):
        writer.write(channels[n % 2], n, b"{}", n)
    writer.flush()
    writer.abandon()
    whole = path.read_bytes()
    for at in range(whole.index(b"fti.Note") - 15, whole.index(b"x-fti-raw") + 20):
        for mask in (1, 0x80):
            path.write_bytes(whole)
            flip(path, at, mask)
            assert run(capsys, "verify", path)[0] in (1, 3)
            run(capsys, "recover", "--in-place", path)
            if path.read_bytes().endswith(b"\x89MCAP0\r\n"):
                read_closed(path)
            for kept in tmp_path.glob("*.bin"):
                kept.unlink()


# --------------------------------------------------------------------------------------------- nothing is missing


def cuts(whole: bytes) -> dict[str, int]:
    """Where files of a session end after a bad day."""
    original = Original(whole)
    return {
        "nothing": 0,
        "magic": 8,
        "behind the metadata": whole.index(b"\x81\x00\x04\0\0\0\0\0\0"),
        "at a chunk boundary": original.chunks[2][0][0] - 1033,
        "in a chunk": original.chunks[2][0][0] + 300,
        "behind the last message index": whole.rindex(b"\x0f\x04\0\0\0\0\0\0\0"),
    }


def test_a_file_without_a_footer_is_not_verified_complete(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = write_own(tmp_path / "whole.mcap", messages=300, chunk_bytes=3000)
    for name, size in cuts(whole).items():
        path = tmp_path / f"{size}_000.mcap"
        path.write_bytes(whole[:size])
        code, output = run(capsys, "recover", path, "--out", tmp_path / f"{size}")
        assert code == 3 and "nothing is missing" not in output, name
        assert "not verified to be complete" in output, name
        assert run(capsys, "verify", tmp_path / f"{size}")[0] == 3, name


def test_altered_metadata_is_copied_and_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = SessionFolder.create(tmp_path, "da42", START_NS)
    log = RawLog(session, [], LogSettings(split_s=60, split_mb=10, metadata={"fti": {"aircraft": "D-EFTI"}}))
    log.write_tick(0, START_NS)
    log.close()
    path = log.path
    path.write_bytes(path.read_bytes().replace(b"D-EFTI", b"D-EFTJ"))
    code, output = run(capsys, "recover", path.parent, "--out", tmp_path / "copy")
    assert code == 3 and "the checksum of its metadata fti does not match" in output and "nothing is missing;" in output
    report = json.loads((tmp_path / "copy" / "recovered.json").read_text())
    assert report["files"][0]["altered_metadata"] == ["fti"] and not report["complete"]
    assert run(capsys, "verify", tmp_path / "copy")[0] == 1


def joined(whole: bytes, other: bytes, foreign: bytes) -> dict[str, tuple[bytes, list[MessageTuple]]]:
    """Joined files, and the messages that must come out, each once."""
    a, b, c = read_stream(whole), read_stream(other), read_stream(foreign)
    cut = whole[: Original(whole).chunks[3][0][0] + 10]  # within the head of a chunk
    return {
        "two": (whole + other, a + b),
        "the same twice": (whole + whole, a),
        "own and foreign": (whole + foreign, a + c),
        "foreign and own": (foreign + whole, c + a),
        "a cut one first": (cut + other, read_stream(cut) + b),
        "a cut one and the whole": (cut + whole, a),
        "a cut one last": (other + cut, b + read_stream(cut)),
    }


def test_joined_files_give_every_message_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = write_own(tmp_path / "a.mcap", 90)
    cases = joined(whole, write_own(tmp_path / "b.mcap", 60, 500), write_foreign(tmp_path / "c.mcap", LZ4))
    for name, (data, messages) in cases.items():
        path = tmp_path / f"{name.replace(' ', '_')}_000.mcap"
        path.write_bytes(data)
        code, _ = run(capsys, "recover", path, "--out", tmp_path / name)
        results = [message for file in sorted((tmp_path / name).glob("*.mcap")) for message in read_closed(file)]
        assert sorted(results) == sorted(messages), name
        assert code == (3 if "cut" in name else 0), name


def test_a_raw_file_that_is_finished_and_has_no_ledger_is_a_loss(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_session(tmp_path, 1)
    path.write_bytes(path.read_bytes()[: -60 * (PAYLOAD + 31)])
    run(capsys, "recover", "--in-place", path)
    code, output = run(capsys, "verify", path)
    assert code == 3 and "no ledger in these files" in output and "all holds" not in output


def test_closing_does_not_make_a_cut_file_complete(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Closed at once, it has a summary and no trace of what followed; only a final ledger would prove it."""
    whole = write_own(tmp_path / "whole.mcap", messages=300, chunk_bytes=3000)
    for size in (0, 8, Original(whole).chunks[2][0][0] - 1033):
        path = tmp_path / f"{size}_000.mcap"
        path.write_bytes(whole[:size])
        code, output = run(capsys, "recover", "--in-place", path)
        assert code == 3 and "not verified to be complete" in output, size
        code, output = run(capsys, "recover", path, "--out", tmp_path / f"{size}")
        assert code == 3 and "nothing is missing\n" not in output, size
        assert "no final ledger: not verified to be complete" in output, size


def test_a_damaged_checkpoint_gives_one_answer_before_and_after(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_session(tmp_path, 10)
    flip(path, path.read_bytes().index(b"\x81\x00\x04\0\0\0\0\0\0") + 9 + 3 * 16)
    damaged = path.read_bytes()
    assert run(capsys, "verify", path.parent)[0] == 1
    code, output = run(capsys, "recover", "--in-place", path.parent)
    assert code == 3 and "its checkpoints are damaged" in output and path.read_bytes() == damaged
    assert run(capsys, "verify", path.parent)[0] == 1


def test_a_table_before_a_damaged_attachment_is_copied(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = SessionFolder.create(tmp_path, "da42", START_NS)
    text = b"name = 1\n" * 20
    log = RawLog(session, [], LogSettings(split_s=60, split_mb=10, attachments=[("config.toml", "text/plain", text)]))
    log.write_tick(0, START_NS)
    log.close()
    flip(log.path, log.path.read_bytes().index(text) + 5)
    code, output = run(capsys, "recover", log.path.parent, "--out", tmp_path / "copy")
    assert code == 3 and "metadata" not in output.replace("metadata records recovered", "")
    assert json.loads((tmp_path / "copy" / "recovered.json").read_text())["files"][0]["altered_metadata"] == []
