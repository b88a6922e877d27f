"""What the campaign has found, each place aimed at."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest

from fti.logger.recovery.close_unfinished import close_all
from tests.logger.campaign.commands import fti
from tests.logger.campaign.mcap_parser import ATTACHMENT, CHECKPOINTS, CHUNK, CHUNK_HEAD_BYTES, MESSAGE_INDEX, Record
from tests.logger.campaign.open_sessions import SHAPES, OpenSession, make_open_session

CHUNKS = next(shape for shape in SHAPES if shape.name == "chunks")


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> OpenSession:
    return make_open_session(tmp_path_factory.mktemp("killed"), CHUNKS, Random(4))


def _put(session: OpenSession, directory: Path, at: int, new: bytes) -> Path:
    return session.put(directory, session.data[:at] + new + session.data[at + len(new) :])


def _last_chunk(session: OpenSession) -> Record:
    return session.parsed.of(CHUNK)[-1]


def _checkpoint_sizes(session: OpenSession, slots: Record) -> list[int]:
    """Verified bytes of the chunk behind, at each checkpoint; 0: none yet."""
    return [int.from_bytes(session.data[at : at + 8], "little") for at in range(slots.begin + 9, slots.end, 16)]


def test_a_copy_of_a_closed_file_says_what_of_it_is_unverified(killed: OpenSession, tmp_path: Path) -> None:
    """Closing gives the chunk a checksum that holds; the copy does not count it as verified."""
    cut = killed.parsed.messages[-3].begin
    assert cut > _last_chunk(killed).begin
    folder = killed.put(tmp_path / "data", killed.data[:cut])
    assert close_all(tmp_path / "data")[0].unverified > 0
    copied = fti("recover", folder, "--out", tmp_path / "copy")
    assert copied.code == 3
    assert "unverified" in copied.out
    assert "nothing is missing" not in copied.out
    again = fti("recover", tmp_path / "copy", "--out", tmp_path / "again")
    assert again.code == 3, "nor does a copy of that"


@pytest.mark.parametrize("shift", [41, 46, 49, 62])
def test_a_length_beyond_any_memory_is_refuted(killed: OpenSession, tmp_path: Path, shift: int) -> None:
    """In the head of the first chunk, which opening a session reads over."""
    first = killed.parsed.of(CHUNK)[0]
    at = first.begin + 9 + 8 + 8 + 8 + 4 + 4
    length = int.from_bytes(killed.data[at : at + 8], "little") | 1 << shift
    verified = fti("verify", _put(killed, tmp_path, at, length.to_bytes(8, "little")))
    assert verified.crash is None
    assert verified.code == 1


def test_a_damaged_attachment_is_refuted_though_the_file_has_no_end(killed: OpenSession, tmp_path: Path) -> None:
    record = killed.parsed.of(ATTACHMENT)[0]
    verified = fti("verify", _put(killed, tmp_path, record.end - 20, b"\0\0\0"))
    assert verified.code == 1
    assert f"is damaged at byte {record.begin}" in verified.out


def test_a_finished_chunk_without_its_message_index_is_refuted(killed: OpenSession, tmp_path: Path) -> None:
    """It looks like the open one, but for the chunks behind it."""
    chunk = killed.parsed.of(CHUNK)[1]
    index = [r for r in killed.parsed.of(MESSAGE_INDEX) if chunk.end <= r.begin < killed.parsed.of(CHUNK)[2].begin]
    size = index[-1].end - chunk.end
    verified = fti("verify", _put(killed, tmp_path, chunk.end - 40, bytes(40 + size)))
    assert verified.code == 1
    assert "is damaged at byte" in verified.out


def _synced_twice(session: OpenSession) -> tuple[Record, list[int]] | None:
    """The last chunk with two checkpoints of different sizes, and these sizes; None without one."""
    chunks = {chunk.begin: chunk for chunk in session.parsed.of(CHUNK)}
    checkpoints = [(chunks[slots.end], _checkpoint_sizes(session, slots)) for slots in session.parsed.of(CHECKPOINTS)]
    return next(((c, sizes) for c, sizes in reversed(checkpoints) if 0 < sizes[0] < sizes[1]), None)


def test_a_file_cut_off_at_a_sync_is_not_refuted_when_it_is_closed(tmp_path: Path) -> None:
    """All that is left of it is verified, and the checkpoints tell of more: a loss."""
    sessions = (make_open_session(tmp_path / f"made_{seed}", CHUNKS, Random(seed)) for seed in range(20))
    killed, (chunk, sizes) = next((made, found) for made in sessions if (found := _synced_twice(made)))
    folder = killed.put(tmp_path / "data", killed.data[: chunk.begin + CHUNK_HEAD_BYTES + sizes[0]])
    (closed,) = close_all(folder.parent)
    assert closed.unverified == 0
    assert closed.missing_bytes > 0
    for place in (folder, closed.path):
        verified = fti("verify", place)
        assert verified.code == 3, verified.out
        assert "bytes at its end were missing or damaged" in verified.out


def test_a_number_far_from_the_others_is_a_sentence(killed: OpenSession, tmp_path: Path) -> None:
    """The highest bit of a frame's number, in the last second: its full number is none below zero."""
    frames = [m for m in killed.parsed.messages if m.content.channel[0] == "/raw/ins"]
    at = frames[-1].begin + 9 + 2 + 3
    verified = fti("verify", _put(killed, tmp_path, at, bytes([killed.data[at] | 0x80])))
    assert verified.crash is None
    assert verified.code in (1, 3)
