from __future__ import annotations

import errno
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.records import Chunk, MessageIndex
from mcap.stream_reader import StreamReader

from fti.errors import StorageError
from fti.logger.records import SECTOR
from fti.logger.recovery.close_unfinished import CloseResult, close_unfinished
from fti.logger.storage import is_full
from fti.logger.stream_writer import StreamWriter
from tests.logger.official_reader import MessageTuple, read_closed, read_stream

MESSAGES: list[MessageTuple] = [
    ("/a" if n % 3 else "/b", 1000 + n, 900 + n, n, bytes([n % 256]) * (n % 7)) for n in range(60)
]


def fill(writer: StreamWriter, messages: list[MessageTuple], flush_every: int = 4) -> None:
    schema = writer.add_schema("s", "jsonschema", b"{}")
    channels = {"/a": writer.add_channel("/a", "x"), "/b": writer.add_channel("/b", "json", schema, {"k": "v"})}
    for n, (topic, log_time, publish_time, sequence, data) in enumerate(messages):
        writer.write(channels[topic], log_time, data, sequence, publish_time)
        if n % flush_every == flush_every - 1:
            writer.flush()


# ------------------------------------------------------------------------------------------------------ whole files


def test_closed_file_is_read_by_the_official_reader(tmp_path: Path) -> None:
    writer = StreamWriter(tmp_path / "a.mcap", chunk_bytes=500)
    writer.add_attachment("config.toml", "text/plain", b"[session]\n", 7)
    writer.add_metadata("fti", {"origin": "hil", "ß": "µ"})
    fill(writer, MESSAGES)
    writer.close()
    assert read_closed(tmp_path / "a.mcap") == MESSAGES
    with (tmp_path / "a.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary and summary.statistics
        assert [a.data for a in reader.iter_attachments()] == [b"[session]\n"]
        assert [m.metadata for m in reader.iter_metadata()] == [{"origin": "hil", "ß": "µ"}]
        assert reader.get_header().profile == "fti"
        assert len(summary.chunk_indexes) == summary.statistics.chunk_count > 3
        assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (1000, 1059)
        assert summary.channels[2].metadata == {"k": "v"} and summary.schemas[1].data == b"{}"


def test_message_index_names_the_offset_of_every_message(tmp_path: Path) -> None:
    writer = StreamWriter(tmp_path / "a.mcap", chunk_bytes=500)
    fill(writer, MESSAGES)
    writer.close()
    chunk, indexed = b"", 0
    for record in StreamReader(BytesIO((tmp_path / "a.mcap").read_bytes()), emit_chunks=True).records:
        if isinstance(record, Chunk):
            chunk = record.data
            assert record.uncompressed_crc != 0
        elif isinstance(record, MessageIndex):
            for log_time, offset in record.records:
                op, _, channel, _, stamp = struct.unpack_from("<BQHIQ", chunk, offset)
                assert (op, channel, stamp) == (5, record.channel_id, log_time)
                indexed += 1
    assert indexed == len(MESSAGES)


def test_crcs_are_checked_not_zero(tmp_path: Path) -> None:
    writer = StreamWriter(tmp_path / "a.mcap")
    fill(writer, MESSAGES)
    writer.close()
    data = bytearray((tmp_path / "a.mcap").read_bytes())
    data[data.index(bytes([20, 20, 20, 20, 20, 20]))] ^= 1
    with pytest.raises(ValueError, match="crc validation failed"):
        list(StreamReader(BytesIO(bytes(data)), validate_crcs=True).records)


def test_file_is_readable_while_it_grows(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = StreamWriter(path, chunk_bytes=700)
    channel = writer.add_channel("/a", "x")
    for n in range(200):
        writer.write(channel, n, bytes(n % 50), n)
        assert len(read_stream(path.read_bytes())) == n
        writer.flush()
        assert [m[3] for m in read_stream(path.read_bytes())] == list(range(n + 1))
    writer.close()
    assert len(read_closed(path)) == 200


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"precious")
    with pytest.raises(StorageError, match=r"a\.mcap: cannot be created: File exists"):
        StreamWriter(tmp_path / "a.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == b"precious"


def test_an_empty_file_is_a_valid_file(tmp_path: Path) -> None:
    StreamWriter(tmp_path / "a.mcap").close()
    assert read_closed(tmp_path / "a.mcap") == []


def test_mistakes_of_the_caller_leave_the_file_as_it_was(tmp_path: Path) -> None:
    writer = StreamWriter(tmp_path / "a.mcap")
    channel = writer.add_channel("/a", "x")
    for wrong in (
        lambda: writer.write(2, 0, b""),
        lambda: writer.write(0, 0, b""),
        lambda: writer.write(channel, -1, b""),
        lambda: writer.write(channel, 0, b"", 2**32),
        lambda: writer.add_channel("/b", "x", 3),
    ):
        with pytest.raises(ValueError):
            wrong()
    writer.write(channel, 5, b"good")
    writer.close()
    assert read_closed(tmp_path / "a.mcap") == [("/a", 5, 5, 0, b"good")]
    with pytest.raises(ValueError, match="is closed"):
        writer.write(channel, 6, b"late")
        writer.flush()


MESSAGE = st.tuples(
    st.sampled_from(["/a", "/b"]),
    st.integers(0, 2**63),
    st.integers(0, 2**63),
    st.integers(0, 2**32 - 1),
    st.binary(max_size=300),
)


@settings(max_examples=40)
@given(messages=st.lists(MESSAGE, max_size=60), chunk_bytes=st.integers(1, 3000), flush_every=st.integers(1, 20))
def test_any_messages_come_back(messages: list[MessageTuple], chunk_bytes: int, flush_every: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.mcap"
        writer = StreamWriter(path, chunk_bytes=chunk_bytes)
        fill(writer, messages, flush_every)
        flushed = len(messages) // flush_every * flush_every
        assert read_stream(path.read_bytes()) == messages[:flushed]
        writer.close()
        assert read_closed(path) == messages == read_stream(path.read_bytes())


# ----------------------------------------------------------------------------------------------------------- kills


@dataclass
class Journal:
    """Every change of a file, in order; ``marks`` say how many messages a completed flush had promised."""

    changes: list[tuple[int, bytes]] = field(default_factory=list)
    marks: dict[int, int] = field(default_factory=dict)

    def states(self) -> Iterator[tuple[bytes, int]]:
        """The file after a kill at any byte of any append, and between any two writes; messages promised so far."""
        file, promised = bytearray(), 0
        for number, (offset, data) in enumerate(self.changes):
            promised = self.marks.get(number, promised)
            if offset < len(file):  # a patch: one sector of one page, which a kill cannot split
                assert offset // SECTOR == (offset + len(data) - 1) // SECTOR
            else:
                for n in range(len(data)):
                    yield bytes(file + data[:n]), promised
            file[offset : offset + len(data)] = data
            yield bytes(file), promised


def record_journal(
    path: Path, monkeypatch: pytest.MonkeyPatch, messages: list[MessageTuple], chunk_bytes: int
) -> Journal:
    journal, pwrite = Journal(), os.pwrite

    def noted(fd: int, data: Any, offset: int) -> int:
        journal.changes.append((offset, bytes(data)))
        return pwrite(fd, data, offset)

    with monkeypatch.context() as patch:
        patch.setattr(os, "pwrite", noted)
        writer = StreamWriter(path, chunk_bytes=chunk_bytes)
        flush = writer.flush
        written = [0]

        def marked() -> None:
            written[0] += 4
            flush()
            journal.marks[len(journal.changes)] = written[0]

        patch.setattr(writer, "flush", marked)
        fill(writer, messages)
        writer.close()
    return journal


def close_alone(path: Path) -> CloseResult | None:
    """Close it without the saved rests of earlier ones: their names and bytes are compared with those of a new one."""
    for rest in path.parent.glob("*.rest-at-*.bin"):
        rest.unlink()
    return close_unfinished(path)


def test_a_kill_at_any_byte_loses_nothing_that_was_flushed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = record_journal(tmp_path / "a.mcap", monkeypatch, MESSAGES[:8], chunk_bytes=130)
    monkeypatch.setattr(os, "fsync", lambda fd: None)
    killed = tmp_path / "killed.mcap"
    states = 0
    for data, promised in journal.states():
        streamed = read_stream(data)
        assert len(streamed) >= promised
        assert streamed == MESSAGES[: len(streamed)]
        killed.write_bytes(data)
        closed = close_alone(killed)
        repaired = read_closed(killed)
        assert len(repaired) >= len(streamed)
        assert repaired == MESSAGES[: len(repaired)]
        assert closed is None or closed.messages == len(repaired)
        states += 1
    assert states > 700
    assert data == (tmp_path / "a.mcap").read_bytes()


def test_a_finished_file_that_was_cut_anywhere_is_closed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = StreamWriter(tmp_path / "a.mcap", chunk_bytes=130)
    writer.add_metadata("m", {"a": "b"})
    writer.add_attachment("n", "text/plain", b"content", 0)
    fill(writer, MESSAGES[:8])
    writer.close()
    whole, cut = (tmp_path / "a.mcap").read_bytes(), tmp_path / "cut.mcap"
    monkeypatch.setattr(os, "fsync", lambda fd: None)
    for n in range(len(whole)):
        cut.write_bytes(whole[:n])
        assert close_alone(cut)
        repaired, streamed = read_closed(cut), read_stream(whole[:n])
        assert repaired[: len(streamed)] == streamed
        assert repaired == MESSAGES[: len(repaired)]
    assert repaired == MESSAGES[:8]
    assert cut.read_bytes() == whole
    assert close_unfinished(cut) is None


def test_chunk_heads_lie_within_one_sector(tmp_path: Path) -> None:
    writer = StreamWriter(tmp_path / "a.mcap", chunk_bytes=1)
    channel = writer.add_channel("/a", "x")
    for n in range(300):
        writer.write(channel, n, bytes(n), n)
        writer.flush()
    writer.close()
    data, heads = (tmp_path / "a.mcap").read_bytes(), 0
    with (tmp_path / "a.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary
    for index in summary.chunk_indexes:
        at = index.chunk_start_offset
        assert data[at] == 6 and at // SECTOR == (at + 48) // SECTOR
        heads += 1
    assert heads == 300
    assert [m[3] for m in read_stream(data)] == list(range(300))


CHILD = """
import sys
from pathlib import Path
from fti.logger.stream_writer import StreamWriter
writer = StreamWriter(Path(sys.argv[1]), chunk_bytes=20000)
channel = writer.add_channel("/a", "x")
n = 0
while True:
    for _ in range(50):
        writer.write(channel, n, bytes(n % 100), n)
        n += 1
    writer.flush()
    print(n, flush=True)
"""


def test_kill_9_of_a_writing_process(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    child = subprocess.Popen([sys.executable, "-c", CHILD, str(path)], stdout=subprocess.PIPE, text=True)
    assert child.stdout
    written_count = 0
    while written_count < 5000:
        written_count = int(child.stdout.readline())
    with pytest.raises(StorageError, match="is being written by another process"):
        close_unfinished(path)
    child.send_signal(signal.SIGKILL)
    written_count = max([written_count, *(int(line) for line in child.stdout.read().split("\n")[:-1])])
    child.wait(120)
    child.stdout.close()
    streamed = read_stream(path.read_bytes())
    assert len(streamed) >= written_count >= 5000
    assert [m[3] for m in streamed] == list(range(len(streamed)))
    closed = close_unfinished(path)
    assert closed and closed.messages == len(read_closed(path)) >= len(streamed)


# ---------------------------------------------------------------------------------------------------- sick media


def test_short_writes_are_continued(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pwrite = os.pwrite
    monkeypatch.setattr(os, "pwrite", lambda fd, data, offset: pwrite(fd, data[: max(1, len(data) // 3)], offset))
    writer = StreamWriter(tmp_path / "a.mcap", chunk_bytes=500)
    fill(writer, MESSAGES)
    writer.close()
    assert read_closed(tmp_path / "a.mcap") == MESSAGES


class SickMedium:
    """Refuses the n-th change of a file, after a part of it; ``stays`` : and all later ones until it is healed."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, at: int, code: int, stays: bool) -> None:
        self._pwrite, self._truncate = os.pwrite, os.ftruncate
        self._left, self._code, self._stays = at, code, stays
        self.refused = 0
        monkeypatch.setattr(os, "pwrite", self._write)
        monkeypatch.setattr(os, "ftruncate", self._cut)

    def heal(self) -> None:
        self._left = 10**9

    def _write(self, fd: int, data: Any, offset: int) -> int:
        part = self._count(lambda: self._pwrite(fd, data[: len(data) // 2], offset))
        return self._pwrite(fd, data, offset) if part is None else part

    def _cut(self, fd: int, size: int) -> None:
        self._count(lambda: 0)
        self._truncate(fd, size)

    def _count(self, partly: Callable[[], int]) -> int | None:
        self._left -= 1
        if self._left == -1:
            return partly() or self._refuse()
        if self._left < -1 and (self._stays or self._left == -2):
            self._refuse()
        return None

    def _refuse(self) -> int:
        self.refused += 1
        raise OSError(self._code, os.strerror(self._code))


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EIO])
@pytest.mark.parametrize("stays", [False, True])
def test_a_medium_that_refuses_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, stays: bool
) -> None:
    refusals = 0
    for at in range(3, 36):
        path = tmp_path / f"{at}.mcap"
        writer = StreamWriter(path, chunk_bytes=260)
        with monkeypatch.context() as patch:
            medium = SickMedium(patch, at, code, stays)
            promised = _fill_against_refusals(writer, path, medium)
        refusals += medium.refused
        assert promised == len(MESSAGES)
        assert read_closed(path) == MESSAGES
    assert refusals >= (200 if stays else 25)


def _fill_against_refusals(writer: StreamWriter, path: Path, medium: SickMedium) -> int:
    """Write on whatever the medium says, as the recorder does; the file stays readable all the time."""
    schema = writer.add_schema("s", "jsonschema", b"{}")
    channels = {"/a": writer.add_channel("/a", "x"), "/b": writer.add_channel("/b", "json", schema)}
    promised = 0
    for n, (topic, log_time, publish_time, sequence, data) in enumerate(MESSAGES):
        writer.write(channels[topic], log_time, data, sequence, publish_time)
        if n % 4 == 3:
            promised = _attempt(writer.flush, path, n + 1, promised)
    medium.heal()
    writer.flush()
    _attempt(writer.close, path, len(MESSAGES), promised)
    return len(read_stream(path.read_bytes()))


def _attempt(action: Callable[[], None], path: Path, reached: int, promised: int) -> int:
    try:
        action()
        promised = reached
    except StorageError as error:
        assert str(path) in str(error) and ("No space left" in str(error) or "Input/output" in str(error))
    streamed = read_stream(path.read_bytes())
    assert streamed == MESSAGES[: len(streamed)] and len(streamed) >= promised
    return promised


def test_close_can_be_called_again_after_a_refusal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for at in range(1, 12):
        path = tmp_path / f"{at}.mcap"
        writer = StreamWriter(path)
        fill(writer, MESSAGES[:22])
        with monkeypatch.context() as patch:
            SickMedium(patch, at - 1, errno.ENOSPC, stays=False)
            for _ in range(4):
                try:
                    writer.close()
                    break
                except StorageError:
                    assert read_stream(path.read_bytes())[:20] == MESSAGES[:20]
        assert read_closed(path) == MESSAGES[:22]


def test_a_torn_append_is_cut_by_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = StreamWriter(tmp_path / "a.mcap")
    channel = writer.add_channel("/a", "x")
    with monkeypatch.context() as patch:
        SickMedium(patch, 0, errno.EIO, stays=True)
        with pytest.raises(StorageError):
            writer.add_attachment("big", "text/plain", bytes(range(256)) * 40, 0)
    assert (tmp_path / "a.mcap").stat().st_size > 5000
    writer.write(channel, 1, b"small")
    writer.flush()
    assert (tmp_path / "a.mcap").stat().st_size < 1300
    writer.close()
    assert read_closed(tmp_path / "a.mcap") == [("/a", 1, 1, 0, b"small")]


def test_a_flush_of_nothing_touches_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = StreamWriter(tmp_path / "a.mcap")
    fill(writer, MESSAGES[:8])
    with monkeypatch.context() as patch:
        patch.setattr(os, "pwrite", None)
        writer.flush()
    writer.close()


def test_a_file_that_could_not_be_synced_takes_nothing_any_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The kernel tells it once, and forgets what it could not write."""
    writer = StreamWriter(tmp_path / "a.mcap")
    writer.sync()

    def refuse(fd: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fdatasync", refuse)
        with pytest.raises(StorageError, match=r"a\.mcap: cannot be written: No space left on device") as caught:
            writer.sync()
        assert is_full(caught.value)
    size = writer.path.stat().st_size
    for call in (writer.sync, lambda: writer.add_metadata("a", {}), writer.close):
        with pytest.raises(StorageError, match="a part of it may be lost") as caught:
            call()
        assert not is_full(caught.value)  # another file at this place would do
    writer.abandon()
    assert writer.path.stat().st_size == size


def test_a_medium_that_takes_nothing_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "pwrite", lambda fd, data, offset: 0)
    started = time.monotonic()
    with pytest.raises(StorageError, match="No space left"):
        StreamWriter(tmp_path / "a.mcap")
    assert not (tmp_path / "a.mcap").exists()
    assert time.monotonic() - started < 60
