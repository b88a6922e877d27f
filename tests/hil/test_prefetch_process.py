"""Reading a recording ahead, in a process of its own."""

from __future__ import annotations

import fcntl
import io
import pickle
import struct
import termios
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pytest

from fti.errors import MissingError, RecordingError
from fti.hil.prefetch_process import BATCH_FRAMES, PIPE_BYTES, PrefetchProcess, PrefetchRequest, write_batches
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.session import SessionFolder
from fti.messages.frames import RawFrame
from tests.helpers import until

START_NS = 1_700_000_000_000_000_000


def recorded(folder: Path, count: int, size: int = 8) -> Path:
    """A session of one link, a frame in each millisecond."""
    session = SessionFolder.create(folder, "made", START_NS)
    log = RawLog(session, [RawTopic("eth", "udp", {})], LogSettings(split_s=300, split_mb=100))
    for seq in range(count):
        log.write_frame("eth", seq, START_NS + 1_000_000 * seq, seq.to_bytes(4, "little") + bytes(size - 4))
    log.close()
    return session.path


def test_all_frames_come_in_order(tmp_path: Path) -> None:
    count = 3 * BATCH_FRAMES + 5
    with PrefetchProcess(PrefetchRequest(str(recorded(tmp_path, count)))) as frames:
        found = list(frames)
    assert [frame.seq for frame in found] == list(range(count))
    assert [frame.t_rx_ns for frame in found] == [1_000_000 * k for k in range(count)]
    assert found[-1] == RawFrame(
        "eth", count - 1, 1_000_000 * (count - 1), (count - 1).to_bytes(4, "little") + bytes(4)
    )


def test_what_is_asked_for_is_what_comes(tmp_path: Path) -> None:
    with PrefetchProcess(
        PrefetchRequest(str(recorded(tmp_path, 20)), from_s=0.015, only=("eth",), loop=True)
    ) as frames:
        assert [frame.seq for frame in islice(frames, 7)] == [15, 16, 17, 18, 19, 15, 16]


def test_it_ends_when_nobody_wants_more_though_it_could_go_on_for_ever(tmp_path: Path) -> None:
    prefetch = PrefetchProcess(PrefetchRequest(str(recorded(tmp_path, 20)), loop=True))
    with prefetch as frames:
        assert next(frames).seq == 0
    assert prefetch._process.poll() is not None


def test_it_reads_only_so_far_ahead(tmp_path: Path) -> None:
    size = 4096
    prefetch = PrefetchProcess(PrefetchRequest(str(recorded(tmp_path, 3 * PIPE_BYTES // size, size))))
    with prefetch as frames:
        next(frames)
        until(lambda: _unread(prefetch) > 0.8 * PIPE_BYTES)
        assert prefetch._process.poll() is None


def _unread(prefetch: PrefetchProcess) -> int:
    """Bytes that wait in the pipe."""
    count: int = struct.unpack("i", fcntl.ioctl(prefetch._pipe, termios.FIONREAD, bytes(4)))[0]
    return count


def test_errors_of_the_session_are_reported_unchanged(tmp_path: Path) -> None:
    with (
        PrefetchProcess(PrefetchRequest(str(tmp_path / "nowhere"))) as frames,
        pytest.raises(MissingError, match="nowhere"),
    ):
        next(frames)


def test_what_is_wrong_with_the_recording_is_raised_in_its_place() -> None:
    def broken() -> Iterator[RawFrame]:
        yield from [RawFrame("eth", 0, 0, b"")] * BATCH_FRAMES
        raise RecordingError("twice")

    pipe = io.BytesIO()
    write_batches(broken(), pipe)
    pipe.seek(0)
    assert len(pickle.load(pipe)) == BATCH_FRAMES
    assert str(pickle.load(pipe)) == "twice"


def test_a_medium_that_cannot_be_read_is_reported() -> None:
    def broken() -> Iterator[RawFrame]:
        raise OSError(5, "Input/output error", "raw_000.mcap")
        yield

    pipe = io.BytesIO()
    write_batches(broken(), pipe)
    pipe.seek(0)
    assert str(pickle.load(pipe)) == "raw_000.mcap: cannot be read: Input/output error"


def test_a_reader_that_is_killed_is_reported(tmp_path: Path) -> None:
    prefetch = PrefetchProcess(PrefetchRequest(str(recorded(tmp_path, 3 * PIPE_BYTES // 4096, 4096))))
    with prefetch as frames:
        next(frames)
        prefetch._process.kill()
        with pytest.raises(RecordingError, match="ended unexpectedly"):
            list(frames)
