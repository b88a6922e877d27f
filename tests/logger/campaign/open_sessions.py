"""Sessions whose recorder was killed: the product's own writer, stopped at any of its writes, in simulated time.

The system calls of the writer are watched: the killer stops it before, within or behind one of them, and knows what a
power cut at that moment would have left on the medium for certain.  The data passed to the writer are recorded too.
"""

from __future__ import annotations

import contextlib
import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any
from unittest import mock

from fti.frame_batch import FrameBatch
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.session import SessionFolder
from tests.logger.campaign.mcap_parser import ParsedFile, parse

STARTED_NS = 1_767_323_045_000_000_000
PAGE = 4096
STEP_NS = 20_000_000
SECOND_NS = 1_000_000_000
#: Link, kind, frames a second, bytes of a frame from and to.
LINKS = (
    ("ins", "udp", 25, (60, 140)),
    ("gnss", "serial", 5, (30, 90)),
    ("radar", "serial", 10, (8, 8)),
    ("bus", "can", 20, (16, 16)),
    ("laser", "serial", 3, (6, 12)),
    ("camera", "udp", 1, (300, 1400)),
)
#: A note of each kind with about so many bytes of text comes so often [s].
NOTES = (("/fti/clock", 0, 1), ("/fti/health", 900, 1), ("/fti/event", 0, 7))
Written = tuple[str, int, bytes]


@dataclass(frozen=True, slots=True)
class Shape:
    """Of a session.  rate : factor on the rates of the links; chunk_bytes, split_s : of its files; length_s : about."""

    name: str
    length_s: float
    rate: float = 1.0
    chunk_bytes: int = 4 * 2**20
    split_s: float = 1e6


SHAPES = (
    Shape("chunks", 22.0, 0.8, chunk_bytes=24_000),
    Shape("slow", 95.0, 0.08),
    Shape("one chunk", 25.0, 0.7),
    Shape("fast", 5.0, 4.0, chunk_bytes=40_000),
    Shape("two files", 20.0, 0.7, chunk_bytes=30_000, split_s=9.0),
    Shape("short", 1.5, 1.0),
)


class KilledError(BaseException):
    """The writer's process ends here."""


@dataclass(slots=True)
class OpenSession:
    """A killed session.

    name       : of its folder; files : its files by name, as a kill leaves them
    open_name  : the one that was being written
    durable    : what of that one was on the medium for certain after the last sync
    """

    name: str
    shape: str
    files: dict[str, bytes]
    open_name: str
    durable: bytes
    parsed: ParsedFile = field(default_factory=ParsedFile)

    @property
    def data(self) -> bytes:
        """The open file."""
        return self.files[self.open_name]

    @property
    def finished(self) -> list[str]:
        """The files before it; one of them may be open, too, when the kill came between two files."""
        return [name for name in self.files if name != self.open_name and parse(self.files[name]).has_summary]

    def put(self, directory: Path, data: bytes, name: str | None = None) -> Path:
        """Write the session into a directory, its open file with these bytes; returns its folder, of that name."""
        folder = directory / (name or self.name)
        folder.mkdir(parents=True)
        for file, content in self.files.items():
            (folder / file).write_bytes(data if file == self.open_name else content)
        return folder


class Kernel:
    """Stands between the writer and the system: counts its calls, ends it at one, knows what was synced."""

    def __init__(self, chance: Random) -> None:
        self._chance = chance
        self.durable: dict[int, bytes] = {}
        self.calls_left: int | None = None

    @contextlib.contextmanager
    def installed(self) -> Iterator[None]:
        """In place of the real calls."""
        self._pwrite = os.pwrite
        with mock.patch("os.pwrite", self._write), mock.patch("os.fdatasync", self._sync), mock.patch("os.fsync"):
            yield

    def _write(self, fd: int, data: Any, offset: int) -> int:
        if self._is_last():
            data = bytes(data)
            self._pwrite(fd, data[: self._chance.choice(self._tears(fd, len(data), offset))], offset)
            raise KilledError
        return self._pwrite(fd, data, offset)

    def _tears(self, fd: int, size: int, offset: int) -> list[int]:
        """How many bytes a kill may leave of a write: it comes between two pages; an append may end anywhere."""
        pages = [page - offset for page in range(offset - offset % PAGE + PAGE, offset + size, PAGE)]
        appends = offset + size > os.fstat(fd).st_size
        return [0, size, *pages, *([1, self._chance.randrange(size + 1)] if appends else [])]

    def _sync(self, fd: int) -> None:
        if self._is_last():
            raise KilledError
        self.durable[os.fstat(fd).st_ino] = _content(fd)

    def _is_last(self) -> bool:
        if self.calls_left is None:
            return False
        self.calls_left -= 1
        return self.calls_left < 0


def _content(fd: int) -> bytes:
    return os.pread(fd, os.fstat(fd).st_size, 0)


class _Recorder:
    """Makes frames and notes in simulated time, and keeps its accounts."""

    def __init__(self, log: RawLog, rate: float, chance: Random) -> None:
        self._log = log
        self._rate = rate
        self._chance = chance
        self.now_ns = STARTED_NS
        self._seq = 0
        self._counts: Counter[str] = Counter()
        self._due = {name: 0.0 for name, *_ in LINKS}
        self.written: list[Written] = []

    def step(self) -> None:
        """20 ms of frames, once a second the notes and a sync."""
        shares: list[tuple[int, list[FrameBatch]]] = []
        for name, kind, rate, sizes in LINKS:
            self._due[name] += rate * self._rate * STEP_NS / SECOND_NS
            count = int(self._due[name])
            self._due[name] -= count
            if count:
                received, _ = self._log.channels(name)
                shares.append((received, [self._burst(name, kind, count, sizes)]))
        if self._chance.random() < 0.02:
            _, sent = self._log.channels("ins")
            shares.append((sent, [self._burst("ins", "tx", 1, (12, 12))]))
        if self.now_ns // STEP_NS % 5 == 0:
            shares.append((self._log.tick_channel, [self._tick()]))
        if shares:
            self._log.write_batches(shares)
        self.now_ns += STEP_NS
        if (self.now_ns - STARTED_NS) % SECOND_NS == 0:
            self._notes()
        self._log.flush()
        if (self.now_ns - STARTED_NS) % SECOND_NS == 0:
            self._log.sync()

    def _burst(self, name: str, kind: str, count: int, sizes: tuple[int, int]) -> FrameBatch:
        positions, times, frames = [], [], []
        for n in range(count):
            positions.append(self._seq)
            times.append(self.now_ns + (n + 1) * STEP_NS // (count + 1))
            frames.append(self._frame(kind, self._chance.randint(*sizes)))
            self._seq += 1
        topic = f"/tx/{name}" if kind == "tx" else f"/raw/{name}"
        self.written += zip([topic] * count, times, frames, strict=True)
        self._counts[topic] += count
        self._counts[topic + " bytes"] += sum(map(len, frames))
        return positions, times, frames, sum(map(len, frames))

    def _frame(self, kind: str, size: int) -> bytes:
        """Random bytes, bytes like records, zeros, text."""
        choice = self._chance.random()
        if kind == "can":
            return self._chance.randrange(2**11).to_bytes(4, "little") + b"\x08\0\0\0" + self._chance.randbytes(8)
        if choice < 0.05:
            return (b"\x05" + (22 + size).to_bytes(8, "little") + b"\x01\0" + bytes(size))[:size]
        if choice < 0.1:
            return bytes(size)
        return self._chance.randbytes(size)

    def _tick(self) -> FrameBatch:
        self.written.append(("/fti/tick", self.now_ns, b""))
        self._counts["/fti/tick"] += 1
        self._seq += 1
        return [self._seq - 1], [self.now_ns], [b""], 0

    def _notes(self) -> None:
        second = (self.now_ns - STARTED_NS) // SECOND_NS
        self._log.write_json("/fti/ledger", self.now_ns, self._ledger())
        for topic, size, period_s in NOTES:
            if second % period_s == 0:
                self._log.write_json(topic, self.now_ns, self._note(topic, size))

    def _note(self, topic: str, size: int) -> dict[str, Any]:
        if topic == "/fti/event":
            return {"t_ns": self.now_ns, "level": "info", "source": "test", "text": "an event"}
        if topic == "/fti/clock":
            names = ("monotonic_ns", "monotonic_raw_ns", "realtime_ns")
            return {"t_ns": self.now_ns, **dict.fromkeys(names, self.now_ns), "width_ns": 400}
        links = {f"link_{n}": {"state": "good", "rate_hz": round(self._chance.random(), 3)} for n in range(size // 45)}
        return {"t_ns": self.now_ns, "links": links}

    def _ledger(self) -> dict[str, Any]:
        links = {
            name: {**self._account(f"/raw/{name}"), "sent": self._account(f"/tx/{name}"), "errors": {}}
            for name, *_ in LINKS
        }
        recorder = {"pid": 4711, "started_ns": STARTED_NS - 1, "first_seq": 0}
        about = {"t_ns": self.now_ns, "recorder": recorder, "next_seq": self._seq, "final": False}
        return {**about, "ticks": self._account("/fti/tick"), "links": links}

    def _account(self, topic: str) -> dict[str, Any]:
        amount = {"frames": self._counts[topic], "bytes": self._counts[topic + " bytes"]}
        came = {f"{part}_{what}": amount[what] for part in ("in", "recorded") for what in amount}
        return {**came, "held_frames": 0, "held_bytes": 0, "dropped": {}}


def make_open_session(directory: Path, shape: Shape, chance: Random) -> OpenSession:
    """Record in a directory, which must be empty, until the killer comes."""
    folder = SessionFolder.create(directory, "killed", STARTED_NS)
    kernel = Kernel(chance)
    with kernel.installed():
        log = _open_log(folder, shape)
        recorder = _Recorder(log, shape.rate, chance)
        _run_until_killed(recorder, kernel, log, shape, chance)
    path = log.path
    durable = kernel.durable.get(path.stat().st_ino, b"")
    log.segment.abandon()
    files = {file.name: file.read_bytes() for file in sorted(folder.path.glob("*.mcap"))}
    session = OpenSession(folder.name, shape.name, files, path.name, durable)
    session.parsed = parse(session.data)
    check_written(session, recorder.written)
    return session


def _open_log(folder: SessionFolder, shape: Shape) -> RawLog:
    attachments = [
        ("config.toml", "text/plain", b"[session]\nname = 'killed'\n" * 30),
        ("empty.txt", "text/plain", b""),
    ]
    metadata = {"fti": {"origin": "hil", "version": "1"}, "fti.clock": {"epoch_ns": str(STARTED_NS)}}
    topics = [RawTopic(name, kind, {"baud": "57600"} if kind == "serial" else {}) for name, kind, *_ in LINKS]
    return RawLog(
        folder, topics, LogSettings(split_s=shape.split_s, split_mb=1000, attachments=attachments, metadata=metadata)
    )


def _run_until_killed(recorder: _Recorder, kernel: Kernel, log: RawLog, shape: Shape, chance: Random) -> None:
    end_ns = STARTED_NS + round(chance.uniform(0.6, 1.0) * shape.length_s * SECOND_NS)
    with contextlib.suppress(KilledError):
        while recorder.now_ns < end_ns + SECOND_NS * 5:
            if recorder.now_ns >= end_ns and kernel.calls_left is None:
                kernel.calls_left = chance.choice((0, 1, 2, 3, chance.randrange(200)))
            log.segment.writer._chunk_bytes = shape.chunk_bytes
            recorder.step()


def check_written(session: OpenSession, written: list[Written]) -> None:
    """What the independent reader finds in the files is what the writer was given, from its begin on."""
    records: list[Written] = []
    for name in sorted(session.files):
        parsed = session.parsed if name == session.open_name else parse(session.files[name])
        records += [(m.content.channel[0], m.content.log_time, m.content.data) for m in parsed.messages]
    frames = [entry for entry in records if entry[0].startswith(("/raw/", "/tx/")) or entry[0] == "/fti/tick"]
    counter = Counter(written[: len(frames)])
    assert not Counter(frames) - Counter(written), "the file holds what nobody wrote"
    late = sum((counter - Counter(frames)).values())
    assert late <= 64, f"{late} frames of {len(frames)} are missing"  # those of the torn flush
