"""Recorders that are killed one after another in one session, fed all the time; and what was lost each time.

What was received is known exactly: the ring outlives the recorder.  What was recorded is read with the official
reader, first as the file lies, then when it has been closed.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import NamedTuple

from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader

from fti.buffers.ring import EntryKind, Ring
from fti.buffers.ring_reader import RingReader
from fti.clock import choose_epoch_ns
from fti.config import Config, Session, UdpLink
from fti.logger import records
from fti.logger.recovery.close_unfinished import close_unfinished
from fti.logger.session import SessionFolder
from fti.service.children import Child
from fti.service.control_channel import ControlChannel
from fti.service.startup import RecorderStartup
from tests.e2e.flood import Flood, free_ports, parse
from tests.helpers import until

HOST = "127.0.77.1"
LINKS = 23
RING_BYTES = 64 * 2**20
SETTLED_FRAMES = 100
#: So many recorders live long enough to close a chunk and to sync.
LONG_RUNS = 0.15
#: seq -> topic, stamp, data
Frames = dict[int, tuple[str, int, bytes]]
#: Waits for the moment of a kill, given the rig.
Moment = Callable[["Rig"], None]


class Span(NamedTuple):
    """A stretch of FTI time [ns]."""

    began_ns: int
    ended_ns: int

    @property
    def ns(self) -> int:
        """How long it is."""
        return self.ended_ns - self.began_ns


@dataclass(frozen=True, slots=True)
class Loss:
    """What a kill has cost.

    received : from the first frame that the recorder had received and that is missing, to the last one received
    frames : so many of them are missing
    sent : from the first datagram that had been sent and is missing, to the kill; also what the kernel still held
    """

    received: Span
    frames: int
    sent: Span


class Rig:
    """A session whose recorder is killed again and again.

    chance : decides about the moments; recorded : numbered messages in all files that were closed
    """

    def __init__(self, folder: Path, rate_hz: float, chance: Random, split_mb: float = 1024.0) -> None:
        self.chance = chance
        self.epoch_ns = choose_epoch_ns()
        self.session = SessionFolder.create(folder, "killed", self.epoch_ns)
        self._ring = Ring.create(RING_BYTES)
        self._reader = RingReader(self._ring)
        ports = free_ports(HOST, LINKS)
        self._child = Child("recorder", self._order(ports, split_mb), self._ring.fds)
        self._child.prepare()
        self._flood = Flood(HOST, rate_hz, ports)
        self._next_number = [0] * LINKS
        self.recorded = 0

    def _order(self, ports: list[int], split_mb: float) -> bytes:
        links = tuple(UdpLink(name=f"udp{n}", kind="udp", bind=f"{HOST}:{port}") for n, port in enumerate(ports))
        order = RecorderStartup(
            config=Config(session=Session(name="killed", split_mb=split_mb), link=links),
            folder=str(self.session.path),
            epoch_ns=self.epoch_ns,
            sending={},
            attachments={"config.toml": "text"},
            metadata={"name": "killed"},
        )
        return order.model_dump_json().encode()

    @property
    def channel(self) -> ControlChannel:
        """To the recorder that runs."""
        assert self._child.channel
        return self._child.channel

    @property
    def files(self) -> list[Path]:
        """The raw files that there are."""
        return self.session.files("raw")

    def kill(self, moment: Moment) -> Loss:
        """Let a recorder record, kill it when the moment has come, and look at what it has left."""
        finished = len(self.files)
        first = self._ring.next_seq
        self._child.start()
        self._child.prepare()
        until(lambda: self._ring.next_seq > first + SETTLED_FRAMES, 30, "recorded frames")
        self.wait_random(3.0 if self.chance.random() < LONG_RUNS else 0.3)
        copies = {path: path.read_bytes() for path in self.files[finished:]}
        moment(self)
        killed_ns, sent = time.monotonic_ns() + self.epoch_ns, self._flood.sent_now()
        self._child.kill()
        until(lambda: self._child.poll_exit() is not None, 20, "its end")
        self._child.close()
        return self._measure_loss(self.files[finished:], copies, killed_ns, sent)

    def wait_random(self, max_s: float) -> None:
        """Let a random time go by."""
        time.sleep(self.chance.uniform(0, max_s))

    def _measure_loss(self, files: list[Path], copies: dict[Path, bytes], killed_ns: int, sent: int) -> Loss:
        received = self._received()
        lying = _merge(read_as_it_lies(path) for path in files)
        _assert_same(lying, received)
        for path in files:
            close_unfinished(path)
            assert_unchanged(copies.get(path, b""), path.read_bytes())
        closed = _merge(read_finished(path) for path in files)
        _assert_same(closed, received)
        assert lying.keys() <= closed.keys()
        self._assert_in_order(closed)
        self.recorded += len(closed)
        missing = [t_ns for seq, (_, t_ns, _) in received.items() if seq not in lying]
        last_ns = max(t_ns for _, t_ns, _ in received.values())
        unsaved = Span(self._unsaved_since_ns(lying, sent, killed_ns), killed_ns)
        return Loss(Span(min(missing, default=last_ns), last_ns), len(missing), unsaved)

    def _unsaved_since_ns(self, recorded: Frames, sent: int, killed_ns: int) -> int:
        """When the first datagram was sent that is behind the last one of its link in the file."""
        newest = [0] * LINKS
        for topic, _, data in recorded.values():
            if topic.startswith("/raw/"):
                link, number = parse(data)
                newest[link] = max(newest[link], number + 1)
        began_ns = self._flood.began_ns(newest, sent)
        return killed_ns if began_ns is None else min(began_ns + self.epoch_ns, killed_ns)

    def _received(self) -> Frames:
        """What the recorder had received since the last kill."""
        frames: Frames = {}
        while batch := self._reader.read(100_000):
            for kind, link, seq, t_rx_ns, data in batch:
                frames[seq] = ("/fti/tick" if kind is EntryKind.TICK else f"/raw/udp{link}", t_rx_ns, data)
        self._reader.commit()
        assert not self._reader.lost_frames
        return frames

    def _assert_in_order(self, recorded: Frames) -> None:
        """Each link's datagrams are the ones that were sent, in their order, none twice."""
        for seq in sorted(recorded):
            topic, _, data = recorded[seq]
            if topic.startswith("/raw/"):
                link, number = parse(data)
                assert topic == f"/raw/udp{link}"
                assert number >= self._next_number[link]
                self._next_number[link] = number + 1

    def close(self) -> None:
        """End everything."""
        self._child.kill()
        self._child.dismiss()
        self._flood.stop()
        self._ring.close()


# ---------------------------------------------------------------------------------------------------------- reading


def read_as_it_lies(path: Path) -> Frames:
    """The numbered messages of a file that may have no end, with the official reader of streams."""
    frames: Frames = {}
    topics: dict[int, str] = {}
    if path.stat().st_size < len(records.MAGIC):
        return frames  # killed before it had written the first bytes
    with path.open("rb") as stream:
        try:
            for record in StreamReader(stream, validate_crcs=True).records:
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Message):
                    _take(frames, topics[record.channel_id], record)
        except (EndOfFile, struct.error):  # the latter where it breaks off within the head of a record
            pass
    return frames


def read_finished(path: Path) -> Frames:
    """The numbered messages of a finished file, with the official reader."""
    frames: Frames = {}
    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False):
            _take(frames, channel.topic, message)
    return frames


def _take(frames: Frames, topic: str, message: Message) -> None:
    if topic.startswith("/raw/") or topic == "/fti/tick":
        assert message.sequence not in frames
        frames[message.sequence] = topic, message.log_time, message.data


def _merge(parts: Iterable[Frames]) -> Frames:
    merged: Frames = {}
    for part in parts:
        assert not merged.keys() & part.keys()
        merged |= part
    return merged


def _assert_same(recorded: Frames, received: Frames) -> None:
    """Nothing is in the file that was not received as it stands there."""
    for seq, frame in recorded.items():
        assert received.get(seq) == frame, seq


def assert_unchanged(before: bytes, after: bytes) -> None:
    """What lay in a file is still there; only checkpoints, and the head of the chunk that was open, may be others."""
    head = _last_chunk(before)
    assert _without_checkpoints(after[:head]) == _without_checkpoints(before[:head])
    body = head + records.CHUNK.size
    whole = _whole_records(before, body) if head < len(before) else head
    assert after[body:whole] == before[body:whole]


def _without_checkpoints(data: bytes) -> bytes:
    """Whole records from the begin of a file, those of checkpoints zeroed: the recorder writes them again and again."""
    found, at = bytearray(data), len(records.MAGIC)
    while at + records.HEAD.size <= len(data):
        op, length = records.HEAD.unpack_from(data, at)
        at += records.HEAD.size
        if op == records.Op.CHECKPOINTS:
            found[at : at + length] = bytes(length)
        at += length
    return bytes(found)


def _last_chunk(data: bytes) -> int:
    """Where the last chunk of a file begins; its end when there is none."""
    at, found = len(records.MAGIC), len(data)
    while at + records.HEAD.size <= len(data):
        op, length = records.HEAD.unpack_from(data, at)
        found = at if op == records.Op.CHUNK else found
        at += records.HEAD.size + length
    return found


def _whole_records(data: bytes, at: int) -> int:
    """End of the last whole record, from the first one of a chunk on."""
    while at + records.HEAD.size <= len(data):
        _, length = records.HEAD.unpack_from(data, at)
        if at + records.HEAD.size + length > len(data):
            break
        at += records.HEAD.size + length
    return at


def describe(losses: list[Loss], late_kills: int) -> str:
    """What the kills have cost."""
    spans = sorted(loss.received.ns / 1e6 for loss in losses)
    unsaved = sorted(loss.sent.ns / 1e6 for loss in losses)
    return (
        f"{len(losses)} kills; of what was sent until then, this is not in the file: median "
        f"{unsaved[len(unsaved) // 2]:.1f} ms, most {unsaved[-1]:.1f} ms; of what the recorder had received: median "
        f"{spans[len(spans) // 2]:.1f} ms, most {spans[-1]:.1f} ms, at most {max(loss.frames for loss in losses)} "
        f"frames; over 50 ms: {late_kills}"
    )
