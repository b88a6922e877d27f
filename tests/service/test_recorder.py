"""The recorder process alone: sending, what is recorded of it, and the end."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest

from fti.buffers.ring import EntryKind, Ring
from fti.buffers.ring_reader import RingFrame, RingReader
from fti.clock import choose_epoch_ns
from fti.config import Altimeter, Config, Device, Nav, SerialLink, Session, UdpLink
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.messages.control import FileNumber, Ready, RecorderEnd, SendBytes, SendResult, Stop
from fti.messages.frames import TICK_PERIOD_NS
from fti.service.children import Child
from fti.service.startup import LinkStartup, RecorderStartup
from tests.e2e.harness import Line, free_udp_port
from tests.helpers import fail, until

T = TypeVar("T")
pytestmark = pytest.mark.timeout(900)


def _with_altimeter(link: str | None) -> dict[str, Any]:
    """Tables of a configuration with a radar altimeter on that link."""
    if link is None:
        return {}
    device = Device(
        name="radar",
        link=link,
        driver="freeflight_ra4500",
        max_age_ms=500,
        altimeter=Altimeter(kind="radar", range_m=(0.5, 762.0)),
    )
    return {"device": (device,), "nav": Nav(altimeters=("radar",))}


class Rig:
    """A recorder with a serial line that it may send on, and a datagram link that it may not.

    altimeter : the link of one
    """

    def __init__(self, folder: Path, altimeter: str | None = None, **more: Any) -> None:
        self.line = Line(folder / "line")
        self.port = free_udp_port()
        self.session = SessionFolder.create(folder / "out", "rig", 0)
        self.ring = Ring.create(2**20)
        links = (
            SerialLink(name="line", kind="serial", port=str(folder / "line"), transmit=True),
            UdpLink(name="eth", kind="udp", bind=f"127.0.0.1:{self.port}"),
        )
        startup = RecorderStartup(
            config=Config(session=Session(name="rig"), link=links, **_with_altimeter(altimeter)),
            folder=str(self.session.path),
            epoch_ns=choose_epoch_ns(),
            sending={"line": LinkStartup(on_connect=(b"hello\r".hex(),), polls=((0.2, b"ask\r".hex()),))},
            attachments={"config.toml": "text"},
            metadata={"name": "rig"},
            **more,
        )
        self.child = Child("recorder", startup.model_dump_json().encode(), self.ring.fds)
        self.channel = self.child.start()
        self.messages: list[Any] = []
        self._line_output = bytearray()

    def line_output(self) -> bytes:
        """Everything that was sent to the device."""
        self._line_output += self.line.read()
        return bytes(self._line_output)

    def find_message(self, kind: type[T]) -> T | None:
        """The first message of that class, once it has come."""
        self.messages += self.channel.receive(fail)
        return next((m for m in self.messages if isinstance(m, kind)), None)

    def close(self) -> None:
        self.child.dismiss()
        self.line.close()
        self.ring.close()


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    result = Rig(tmp_path)
    yield result
    result.close()


@pytest.mark.parametrize("link", ["line", "eth"])
def test_what_an_altimeter_sends_does_not_wait_for_the_beat(tmp_path: Path, link: str) -> None:
    """With the beat, a tick comes with it; so it does when it is sent while one is due, which is seldom."""
    alone, numbers = 0, range(100)
    with (
        contextlib.closing(Rig(tmp_path, altimeter=link)) as rig,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        until(lambda: rig.find_message(Ready), what="ready")
        until(lambda: rig.line_output().startswith(b"hello\r"), what="the line is open")
        reader, index = RingReader(rig.ring), ("line", "eth").index(link)
        for number in numbers:
            data = b"%d" % number
            if link == "eth":
                sender.sendto(data, ("127.0.0.1", rig.port))
            else:
                rig.line.write(data)
            alone += [record[:2] for record in _read_with(reader, data)] == [(EntryKind.RECEIVED, index)]
            _read_with(reader, b"")  # a tick: a link has one early look between two beats
    assert alone > 0.7 * len(numbers)


def _read_with(reader: RingReader, data: bytes) -> list[RingFrame]:
    """The frames that the recorder has put into the ring together with these bytes."""
    while True:
        ring_frames = reader.read(1)
        if any(record.data == data for record in ring_frames):
            return ring_frames
        if not ring_frames:
            reader.wait(30)


def test_it_sends_its_startup_data_and_records_them(rig: Rig) -> None:
    until(lambda: rig.find_message(Ready), what="ready")
    until(lambda: rig.line_output().count(b"ask\r") >= 2, what="two questions")
    assert rig.line_output().startswith(b"hello\rask\r")
    rig.channel.send(SendBytes(7, "line", b"set\r".hex()))
    answer = until(lambda: rig.find_message(SendResult), what="an answer")
    assert (answer.id, answer.fault) == (7, None)
    until(lambda: b"set\r" in rig.line_output(), what="the command")
    rig.line.write(b"answer")
    until(lambda: _received(rig), what="the answer in the ring")
    rig.channel.send(Stop())
    until(lambda: rig.find_message(RecorderEnd), what="stopped")
    sent = b"".join(f.data for f in Recording.open(rig.session.path).sent_frames())
    assert sent.startswith(rig.line_output()[:20])
    assert sent.count(b"set\r") == 1


def _received(rig: Rig) -> bool:
    return any(record.data == b"answer" for record in RingReader(rig.ring).read(10_000))


def test_numbers_are_reported_and_those_given_up_before_stand_in_the_file(tmp_path: Path) -> None:
    rig = Rig(tmp_path, first_number=5, skipped_numbers=(2, 4))
    until(lambda: rig.find_message(Ready), what="ready")
    rig.channel.send(Stop())
    until(lambda: rig.find_message(RecorderEnd), what="stopped")
    rig.close()
    reports = [message for message in rig.messages if isinstance(message, FileNumber)]
    assert reports == [FileNumber(5, False), FileNumber(5, True)]
    (path,) = rig.session.files("raw")
    assert path.name.endswith("_005.mcap")
    assert Recording.open(path).metadata["fti.file"]["given_up_numbers"] == "2 4"


def test_recorded_times_are_utc_to_half_a_tick(rig: Rig) -> None:
    """Datagrams contain their time of sending by the real-time clock; the quickest one counts."""
    until(lambda: rig.find_message(Ready), what="ready")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for _ in range(100):
            sender.sendto(b"%d" % time.time_ns(), ("127.0.0.1", rig.port))
    until(lambda: rig.ring.next_seq > 100, what="the datagrams")
    rig.channel.send(Stop())
    until(lambda: rig.find_message(RecorderEnd), what="stopped")
    recording = Recording.open(rig.session.path)
    ages = [frame.t_rx_ns - int(frame.data) for frame in recording.frames() if frame.link == "eth"]
    assert ages
    assert abs(min(ages, key=abs)) <= TICK_PERIOD_NS // 2 + 1_000_000


@pytest.mark.parametrize(("link", "line_output"), [("eth", "transmit is false"), ("none", "unknown link 'none'")])
def test_a_command_that_cannot_be_sent_is_refused_once(rig: Rig, link: str, line_output: str) -> None:
    until(lambda: rig.find_message(Ready), what="ready")
    rig.channel.send(SendBytes(1, link, "00"))
    answer = until(lambda: rig.find_message(SendResult), what="an answer")
    assert answer.id == 1
    assert line_output in (answer.fault or "")


def test_it_finishes_when_the_supervisor_is_gone(rig: Rig) -> None:
    until(lambda: rig.find_message(Ready), what="ready")
    rig.line.write(b"last words")
    until(lambda: any(r.data == b"last words" for r in RingReader(rig.ring).read(10_000)), what="the words")
    rig.child.close()
    process = rig.child.process
    assert process
    assert process.wait(timeout=120) == 0
    assert rig.ring.has_ended
    recording = Recording.open(rig.session.path)
    assert not recording.find_unfinished_files()
    assert b"last words" in b"".join(f.data for f in recording.frames())


def test_a_child_without_an_order_ends_when_it_is_let_go() -> None:
    child = Child("recorder")
    child.prepare()
    assert child._waiting
    process = child._waiting.process
    child.dismiss()
    assert process.returncode == 0


def test_linear_algebra_of_a_child_has_one_thread() -> None:
    child = Child("recorder")
    child.prepare()
    assert child._waiting
    environ = Path(f"/proc/{child._waiting.process.pid}/environ")
    until(lambda: b"OPENBLAS_NUM_THREADS=1" in environ.read_bytes().split(b"\0"), what="its environment")
    child.dismiss()


def test_a_stand_in_that_died_is_replaced(tmp_path: Path) -> None:
    ring = Ring.create(2**16)
    child = Child("recorder", b"{}", ring.fds)
    child.prepare()
    assert child._waiting
    killed = child._waiting.process
    killed.kill()
    killed.wait()
    child.start()
    assert child.process is not killed
    child.dismiss()
    ring.close()
