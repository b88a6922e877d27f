"""The raw and the derived log: files, splits, topics, times."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from mcap.reader import make_reader

from fti.errors import StorageError
from fti.logger.derived_log import Decimator, DerivedLog
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.messages.frames import TICK_LINK, RawFrame
from fti.messages.measurements import Ack, Calibration, CalibrationPoint, RadioHeight, Stamp, SurfaceDeflection
from fti.messages.outputs import ClearanceIntegrity, Event, GlideSlope, HeightAboveGround, IntegrityState, NavSolution
from fti.messages.reasons import Reason
from fti.messages.topics import snake_case
from tests.logger.official_reader import read_closed, read_stream

STARTED = 1_767_323_045_000_000_000
SECOND = 1_000_000_000
TOPICS = [RawTopic("ins", "udp", {"bind": "127.0.0.1:4000"}), RawTopic("radar", "serial", {"baud": "57600"})]
ABOUT: dict[str, Any] = {"attachments": [("a.toml", "text/plain", b"x = 1")], "metadata": {"fti": {"origin": "hil"}}}


def open_raw(folder: SessionFolder, split_s: float = 300, split_mb: float = 100) -> RawLog:
    return RawLog(folder, TOPICS, LogSettings(split_s=split_s, split_mb=split_mb, **ABOUT))


@pytest.fixture
def folder(tmp_path: Path) -> SessionFolder:
    return SessionFolder.create(tmp_path, "s", STARTED)


def test_raw_log_keeps_every_frame(folder: SessionFolder) -> None:
    log = open_raw(folder)
    log.write_frame("ins", 0, STARTED, b"one")
    log.write_tick(1, STARTED + 1)
    log.write_sent("radar", 2, STARTED + 2, b"ask")
    log.write_frame("radar", 2**32 + 3, STARTED + 3, b"answer")
    log.write_json("/fti/clock", STARTED, {"t_ns": STARTED, "monotonic_ns": 1, "monotonic_raw_ns": 2, "realtime_ns": 3})
    log.write_json("/fti/event", STARTED, Event(t_ns=STARTED, level="warning", source="ins", text="silent"))
    log.write_json("/fti/event", STARTED, {"t_ns": STARTED, "level": "info", "source": "user", "text": "mark"})
    log.flush()
    log.sync()
    assert len(read_stream(log.path.read_bytes())) == 7
    log.close()
    messages = read_closed(log.path)
    assert messages[:4] == [
        ("/raw/ins", STARTED, STARTED, 0, b"one"),
        ("/fti/tick", STARTED + 1, STARTED + 1, 1, b""),
        ("/tx/radar", STARTED + 2, STARTED + 2, 2, b"ask"),
        ("/raw/radar", STARTED + 3, STARTED + 3, 3, b"answer"),
    ]
    assert json.loads(messages[5][4])["level"] == 3 and json.loads(messages[6][4])["message"] == "mark"
    with log.path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary
    channel = next(c for c in summary.channels.values() if c.topic == "/raw/radar")
    assert (channel.message_encoding, channel.schema_id) == ("x-fti-raw", 0)
    assert channel.metadata == {"link": "radar", "kind": "serial", "baud": "57600"}


def test_raw_log_refuses_a_topic_without_a_schema(folder: SessionFolder) -> None:
    log = open_raw(folder)
    with pytest.raises(ValueError, match="/fti/health"):
        log.write_json("/fti/oops", 0, {})
    log.close()


@pytest.mark.parametrize("by", ["time", "size"])
def test_each_split_is_readable_alone(folder: SessionFolder, by: str) -> None:
    log = open_raw(folder, split_s=1) if by == "time" else open_raw(folder, split_mb=0.002)
    seq = 0
    for n in range(300):
        for link in ("ins", "radar"):
            log.write_frame(link, seq, STARTED + n * SECOND // 50, bytes([n % 256]) * 20)
            seq += 1
        log.write_json("/fti/ledger", STARTED + n * SECOND // 50, {"t_ns": n, "links": {}})
        log.flush()
    log.close()
    files = folder.files("raw")
    assert len(files) > 5
    assert log.bytes_written == sum(f.stat().st_size for f in files)
    for file in files:
        alone = Recording.open(file)
        assert alone.attachments() == {"a.toml": b"x = 1"}
        assert alone.metadata["fti"] == {"origin": "hil"}
        assert alone.links == {"ins": "udp", "radar": "serial"}
        read_closed(file)
    frames = list(Recording.open(folder.path).frames())
    assert [f.seq for f in frames] == list(range(600))
    if by == "time":
        assert len(files) == 6


def test_a_full_medium_at_the_split_loses_nothing(folder: SessionFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    log = open_raw(folder, split_s=1)
    pwrite, full, refused = os.pwrite, [False], 0

    def write(fd: int, data: Any, offset: int) -> int:
        if full[0]:
            raise OSError(errno.ENOSPC, "No space left on device")
        return pwrite(fd, data, offset)

    monkeypatch.setattr(os, "pwrite", write)
    for n in range(200):
        log.write_frame("ins", n, STARTED + n * SECOND // 50, b"frame")
        full[0] = 40 < n < 140 and n % 3 > 0
        try:
            log.flush()
        except StorageError:
            refused += 1
    full[0] = False
    log.close()
    assert refused > 50
    assert [f.seq for f in Recording.open(folder.path).frames()] == list(range(200))
    for file in folder.files("raw"):
        read_closed(file)


def test_when_the_next_file_cannot_be_made_the_old_one_goes_on(
    folder: SessionFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = open_raw(folder, split_s=1)
    real = os.open

    def refuse(path: Any, flags: int, *rest: Any) -> int:
        if flags & os.O_CREAT:
            raise OSError(errno.EROFS, "Read-only file system")
        return real(path, flags, *rest)

    with monkeypatch.context() as patch:
        patch.setattr(os, "open", refuse)
        for n in range(100):
            log.write_frame("ins", n, STARTED + n * SECOND // 50, b"frame")
            log.flush()  # a file that takes bytes is no reason to refuse
            assert bool(log.fault) == (n >= 50)
            assert len(read_stream(log.path.read_bytes())) == n + 1
    log.write_frame("ins", 100, STARTED + 2 * SECOND, b"frame")
    log.flush()
    assert log.fault is None
    log.close()
    assert len(folder.files("raw")) == 2
    assert [f.seq for f in Recording.open(folder.path).frames()] == list(range(101))


def test_closing_on_a_full_medium_releases_the_file(folder: SessionFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    log = open_raw(folder)
    log.write_frame("ins", 0, STARTED, b"kept")
    log.flush()

    def refuse(fd: int, data: Any, offset: int) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "pwrite", refuse)
        with pytest.raises(StorageError, match="No space left"):
            log.close()
    assert [m[4] for m in read_stream(log.path.read_bytes())] == [b"kept"]


def test_free_space_is_reported(folder: SessionFolder) -> None:
    log = open_raw(folder)
    state = os.statvfs(folder.path)
    assert log.free_mb() == pytest.approx(state.f_bavail * state.f_frsize / 2**20, abs=100)
    log.close()


def test_the_recorder_stays_small() -> None:
    code = (
        "import sys, fti.logger.raw_log\n"
        "print(sorted({m.split('.')[0] for m in sys.modules} & {'numpy', 'numba', 'mcap', 'zenoh', 'aiohttp'}))"
    )
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert process.stdout == "[]\n"


# --------------------------------------------------------------------------------------------------------- derived


def open_derived(folder: SessionFolder) -> DerivedLog:
    return DerivedLog(folder, LogSettings(split_s=300, split_mb=100, **ABOUT))


def test_every_change_of_a_calibration_is_kept_however_fast_they_come(folder: SessionFolder) -> None:
    log = open_derived(folder)
    points = (CalibrationPoint(raw=0, deflection=0.0), CalibrationPoint(raw=9, deflection=0.1))
    changes = [Calibration(stamp=Stamp(STARTED + i), surface="flaps", points=points, change=str(i)) for i in range(20)]
    for change in changes:
        log.write_measurement("pickups", change)
    log.close()
    contents = [json.loads(data) for _, _, _, _, data in read_closed(log.path)]
    assert [m["change"] for m in contents] == [str(i) for i in range(20)]
    assert contents[0]["points"] == [{"raw": 0, "deflection": 0.0}, {"raw": 9, "deflection": 0.1}]


def test_derived_topics_times_and_schemas(folder: SessionFolder) -> None:
    log = open_derived(folder)
    stamp = Stamp(STARTED + 5, t_valid_ns=STARTED + 3)
    log.write_measurement("radar", RadioHeight(stamp=stamp, height_agl=float("nan"), sd=0.1))
    log.write_measurement("ins", Ack(stamp=Stamp(STARTED + 6), command="reset", accepted=True))
    height = HeightAboveGround(
        t_ns=STARTED + 9, t_valid_ns=STARTED + 3, sensor="radar", raw=1.0, height_agl=None, sd=float("inf"),
        valid=False, reasons=(Reason.ROLL, Reason.STALE),
    )  # fmt: skip
    log.write_output(height)
    log.write_output(GlideSlope(t_ns=STARTED + 9, t_valid_ns=None, valid=True, reasons=(), deviation=0.01))
    log.write_output(
        ClearanceIntegrity(t_ns=STARTED + 9, t_valid_ns=None, state=IntegrityState.OK, reasons=(), valid=True)
    )
    log.write_output(solution(valid=True))
    log.write_output(solution(valid=False))
    log.write_output(Event(t_ns=STARTED + 9, level="error", source="nav", text="lost"))
    log.write_table("/fti/gap", STARTED + 10, {"t_ns": STARTED + 10, "kind": "ring"})
    log.write_table("/fti/gap", STARTED + 11, {"t_ns": STARTED + 11, "kind": "ring", "first_seq": 3, "last_seq": 4})
    log.flush()
    log.sync()
    log.close()
    messages = read_closed(log.path)
    assert [(topic, log_time - STARTED, published - STARTED) for topic, log_time, published, _, _ in messages] == [
        ("/radar/radio_height", 5, 3),
        ("/ins/ack", 6, 6),
        ("/nav/height_above_ground/radar", 9, 3),
        ("/nav/glide_slope", 9, 9),
        ("/nav/clearance_integrity", 9, 9),
        ("/nav/nav_solution", 9, 4),
        ("/nav/location", 9, 4),
        ("/nav/nav_solution", 9, 4),
        ("/fti/event", 9, 9),
        ("/fti/gap", 10, 10),
        ("/fti/gap", 11, 11),
    ]
    assert json.loads(messages[0][4])["height_agl"] is None
    assert json.loads(messages[2][4])["reasons"] == ["roll", "stale"] and json.loads(messages[2][4])["sd"] is None
    fix = json.loads(messages[6][4])
    assert fix["latitude"] == pytest.approx(48.0, abs=1e-12) and fix["altitude"] == 500.0
    assert fix["position_covariance"] == [4.0, 0, 0, 0, 4.0, 0, 0, 0, 9.0]
    assert fix["timestamp"] == {"sec": STARTED // SECOND, "nsec": 4}
    validate_against_own_schemas(log.path)


def solution(valid: bool) -> NavSolution:
    return NavSolution(
        t_ns=STARTED + 9, t_valid_ns=STARTED + 4, valid=valid, reasons=(), lat=0.8377580409572782, lon=0.2, alt=500.0,
        horizontal_sd=2.0, vertical_sd=3.0,
    )  # fmt: skip


def validate_against_own_schemas(path: Path) -> None:
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema and schema.encoding == "jsonschema" and channel.message_encoding == "json"
            jsonschema.validate(json.loads(message.data), json.loads(schema.data))


def test_measurements_are_decimated_and_outputs_are_not(folder: SessionFolder) -> None:
    log = open_derived(folder)
    for n in range(1000):  # 10 s at 100 Hz
        t = STARTED + n * SECOND // 100
        log.write_measurement("fast", RadioHeight(stamp=Stamp(t), height_agl=1.0))
        log.write_measurement("servo", SurfaceDeflection(stamp=Stamp(t), surface="aileron", deflection=0.1))
        log.write_measurement("servo", SurfaceDeflection(stamp=Stamp(t), surface="rudder", deflection=0.2))
        log.write_output(GlideSlope(t_ns=t, t_valid_ns=None, valid=True, reasons=()))
    log.close()
    messages = read_closed(log.path)
    counts = {topic: sum(m[0] == topic for m in messages) for topic in {m[0] for m in messages}}
    assert counts["/nav/glide_slope"] == 1000
    assert counts["/fast/radio_height"] == pytest.approx(250, abs=2)
    assert counts["/servo/surface_deflection"] == pytest.approx(500, abs=4)
    surfaces = [json.loads(m[4])["surface"] for m in messages if m[0] == "/servo/surface_deflection"]
    assert surfaces.count("aileron") == surfaces.count("rudder")


def test_a_stream_of_the_rate_with_jitter_passes_whole() -> None:
    decimator = Decimator(25)
    times = [n * 40_000_000 + (n * 7919 % 19 - 9) * 1_000_000 for n in range(1000)]  # up to 9 ms either way
    assert sum(decimator.is_due("a", t) for t in times) == 1000


def test_whoever_forgets_to_flush_does_not_fill_the_memory(folder: SessionFolder) -> None:
    log = open_derived(folder)
    for n in range(6000):
        log.write_output(GlideSlope(t_ns=STARTED + n, t_valid_ns=None, valid=True, reasons=()))
    assert log.bytes_written > 2**20
    log.close()


def test_snake_case() -> None:
    assert [snake_case(n) for n in ("ImuSample", "HeightAboveGround", "Ack")] == [
        "imu_sample", "height_above_ground", "ack",
    ]  # fmt: skip


# ------------------------------------------------------------------------------------------------------- recording


def write_in_disorder(folder: SessionFolder) -> list[RawFrame]:
    """Links are written one after another, radar a batch late (over splits); numbers are missing and pass 2^32."""
    log = open_raw(folder, split_s=1)
    expected: list[RawFrame] = []
    late: list[RawFrame] = []
    for batch in range(51):
        frames = []
        for n in range(20 if batch < 50 else 0):
            number = batch * 20 + n
            link = ("ins", "radar", TICK_LINK)[n % 3]
            data = b"" if link == TICK_LINK else bytes([n])
            frames.append(RawFrame(link, 2**32 - 500 + number, STARTED + number * SECOND // 100, data))
        frames = [frame for frame in frames if frame.seq % 97]
        expected += frames
        radar = [frame for frame in frames if frame.link == "radar"]
        for frame in (*late, *(f for f in frames if f.link == TICK_LINK), *(f for f in frames if f.link == "ins")):
            if frame.link == TICK_LINK:
                log.write_tick(frame.seq, frame.t_rx_ns)
            else:
                log.write_frame(frame.link, frame.seq, frame.t_rx_ns, frame.data)
        late = radar
        log.flush()
    log.close()
    return expected


@pytest.mark.parametrize("waiting_frames", [50_000, 10])
def test_frames_come_in_order_of_their_number(
    folder: SessionFolder, monkeypatch: pytest.MonkeyPatch, waiting_frames: int
) -> None:
    monkeypatch.setattr("fti.logger.reading.recording.MAX_WAITING_FRAMES", waiting_frames)
    expected = write_in_disorder(folder)
    recording = Recording.open(folder.path)
    assert len(recording.raw_files) > 5
    assert list(recording.frames()) == expected


def test_frames_do_not_wait_for_a_number_that_never_comes(
    folder: SessionFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fti.logger.reading.recording.MAX_WAITING_FRAMES", 10)
    expected = write_in_disorder(folder)
    recording = Recording.open(folder.path)
    chunks, taken = recording._numbered_chunks, [0, 0]

    def counted() -> Any:
        calls = taken[1]
        taken[1] += 1
        for chunk in chunks():
            taken[0] += calls == 0  # the first walk; a second one only looks for the smallest numbers
            yield chunk

    monkeypatch.setattr(recording, "_numbered_chunks", counted)
    frames = recording.frames()
    for _ in range(len(expected) // 2):
        next(frames)
    assert taken[1] == 2 and taken[0] < len(recording.raw_files) * 0.7


def test_a_recording_that_is_being_written_is_read_and_reported(folder: SessionFolder) -> None:
    log = open_raw(folder)
    log.write_frame("ins", 0, STARTED, b"a")
    log.write_sent("ins", 1, STARTED, b"b")
    log.flush()
    recording = Recording.open(folder.path)
    assert recording.find_unfinished_files() == [log.path]
    assert [f.data for f in recording.frames()] == [b"a"]
    assert [f.data for f in recording.sent_frames()] == [b"b"]
    assert "being written" in recording.faults[log.path].text
    log.close()
    assert Recording.open(folder.path).find_unfinished_files() == []


def test_derived_messages_by_prefix(folder: SessionFolder) -> None:
    log = open_derived(folder)
    log.write_output(GlideSlope(t_ns=STARTED, t_valid_ns=None, valid=True, reasons=()))
    log.write_table("/fti/gap", STARTED, {"t_ns": STARTED, "text": "x"})
    log.close()
    for path in (folder.path, log.path):
        recording = Recording.open(path)
        assert recording.derived_files == [log.path]
        assert [m[0] for m in recording.messages("/nav/")] == ["/nav/glide_slope"]
        assert len(list(recording.messages())) == 2
        assert recording.metadata["fti"] == {"origin": "hil"}
