"""The bus between real processes: for the owner alone, not slowed by a client; it survives the end of each process."""

from __future__ import annotations

import contextlib
import os
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from fti.bus import frame, hub
from fti.bus.client import Publisher, Subscriber
from fti.errors import MissingError
from fti.peer_credentials import Peer
from tests.bus.running_hub import DEADLINE_S, RunningHub, wait_for

COUNT = "/nav/count"
PUBLISHER = """
import itertools, sys, time
from pathlib import Path
from fti.bus.client import Publisher
publisher = Publisher(Path(sys.argv[1]), "navigation")
for i in itertools.count():
    publisher.publish("/nav/count", b"%d" % i)
    time.sleep(0.005)
"""
SUBSCRIBER = """
import sys
from pathlib import Path
from fti.bus.client import Subscriber
subscriber = Subscriber(Path(sys.argv[1]), "test", lambda topic, payload, sent_ns: print(topic, flush=True))
sys.stdin.read()
"""


class Listener:
    """The messages of a subscriber of this process."""

    def __init__(self, path: Path) -> None:
        self.messages: list[tuple[str, bytes]] = []
        self.sent_ns: list[int] = []
        self.alive: dict[str, bool] = {}
        self.subscriber = Subscriber(path, "test", self._take, self.alive.__setitem__)

    def _take(self, topic: str, payload: bytes, sent_ns: int) -> None:
        self.messages.append((topic, payload))
        self.sent_ns.append(sent_ns)

    def expect_news(self, what: str) -> None:
        self.messages.clear()
        wait_for(lambda: self.messages, what)

    def payloads(self, topic: str) -> list[bytes]:
        return [payload for found, payload in self.messages if found == topic]


@pytest.fixture
def running() -> Iterator[RunningHub]:
    with RunningHub() as made:
        yield made


@pytest.fixture
def path(running: RunningHub) -> Path:
    return running.hub.path


@pytest.fixture
def listener(path: Path) -> Iterator[Listener]:
    result = Listener(path)
    wait_for(lambda: result.alive.get("supervisor"), "the connection")
    yield result
    result.subscriber.close()


def start(script: str, path: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", script, str(path)], text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )


def kill(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.communicate()


def barrier(running: RunningHub, listener: Listener) -> None:
    """Until everything that was published before has arrived."""
    running.hub.publish("/event", b"barrier")
    wait_for(lambda: ("/event", b"barrier") in listener.messages, "the message behind")


def test_hub_and_publishers_reach_a_subscriber_in_order(running: RunningHub, path: Path, listener: Listener) -> None:
    navigation, emulator = Publisher(path, "navigation"), Publisher(path, "emulator")
    for i in range(500):
        navigation.publish(COUNT, b"%d" % i)
        while i - len(listener.messages) > 50:  # a publisher drops what the hub has not accepted 0.2 s after its end
            time.sleep(0.001)
    emulator.publish("/hil", b"flies")
    running.hub.publish("/health", b"well")
    navigation.close()
    emulator.close()
    wait_for(lambda: len(listener.messages) == 502, "all messages")
    assert listener.payloads(COUNT) == [b"%d" % i for i in range(500)]
    assert (listener.payloads("/hil"), listener.payloads("/health")) == ([b"flies"], [b"well"])
    assert all(sent <= time.monotonic_ns() for sent in listener.sent_ns)
    assert running.warnings == []


def test_a_message_of_the_largest_size_arrives_whole(running: RunningHub, listener: Listener) -> None:
    large = os.urandom(frame.MAX_BYTES["/health"])
    running.hub.publish("/health", large)
    running.hub.publish("/health", large + b"x")
    barrier(running, listener)
    assert listener.payloads("/health") == [large]
    assert len(running.warnings) == 1
    assert "the limit is 4194304" in running.warnings[0]


def test_the_socket_is_its_owners_alone(path: Path) -> None:
    assert path.stat().st_mode & 0o777 == 0o600


class ForeignPeer:
    """In place of ``Peer``: every other end belongs to another user."""

    @staticmethod
    def from_socket(sock: socket.socket) -> Peer:
        return Peer(pid=1, uid=os.getuid() + 1)


def test_another_user_is_refused_whatever_the_mode_of_the_socket(
    running: RunningHub, path: Path, listener: Listener, monkeypatch: pytest.MonkeyPatch
) -> None:
    running.wait_for_subscribers(1)
    monkeypatch.setattr(hub, "Peer", ForeignPeer)
    with socket.socket(socket.AF_UNIX) as sock:
        sock.connect(str(path))
        sock.settimeout(DEADLINE_S)
        assert sock.recv(1) == b""
    assert running.warnings == [f"a connection of user {os.getuid() + 1} is refused (1 are open)"]


def test_a_hub_of_another_user_is_none(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frame, "Peer", ForeignPeer)
    with pytest.raises(MissingError, match="no bus of this user"):
        Subscriber(path, "test", lambda topic, payload, sent_ns: None)


def test_nobody_publishes_for_others(running: RunningHub, path: Path, listener: Listener) -> None:
    emulator, unknown = Publisher(path, "emulator"), Publisher(path, "unknown")
    emulator.publish("/nav/clearance_integrity", b"ok")
    emulator.publish("/health", b"stopped")
    emulator.publish("@alive/navigation", b"0")
    unknown.publish("/nav/clearance_integrity", b"ok")
    emulator.publish("/hil", b"last")
    wait_for(lambda: listener.messages, "the message that is allowed")
    assert listener.messages == [("/hil", b"last")]
    assert set(listener.alive) == {"supervisor", "emulator"}
    wait_for(lambda: len(running.warnings) == 2, "two sentences")
    assert "emulator: may not publish on '/nav/clearance_integrity'; such messages are discarded" in running.warnings
    assert "a client: 'unknown' may not publish or subscribe; the connection is closed" in running.warnings
    emulator.close()
    unknown.close()


@pytest.mark.parametrize(
    "nonsense",
    [
        b"\xff" * 1000,
        struct.pack("<IHq", 2**32 - 1, 5, 0),
        struct.pack("<IHq", 0, 65535, 0),
        struct.pack("<IHq", 0, 2, 0) + b"\xff\xfe",
        frame.make_frame("@subscribe", b"").raw,
        frame.make_frame("/nav/count", b"1").raw,
        frame.make_frame("@publish", b"navigation").raw + struct.pack("<IHq", 2**21, 4, 0) + b"/nav" + bytes(2**21),
    ],
    ids=range(7),
)
def test_nonsense_ends_its_own_connection_alone(
    nonsense: bytes, running: RunningHub, path: Path, listener: Listener
) -> None:
    with socket.socket(socket.AF_UNIX) as sock:
        sock.settimeout(DEADLINE_S)
        sock.connect(str(path))
        with contextlib.suppress(ConnectionError):  # closed before it had taken everything
            sock.sendall(nonsense)
            assert sock.recv(1) == b""
    barrier(running, listener)
    assert len(running.warnings) == 1
    assert "the connection is closed" in running.warnings[0]


def test_a_client_that_does_wrong_very_often_is_reported_of_a_few_times(
    running: RunningHub, path: Path, listener: Listener
) -> None:
    for _ in range(50):
        with socket.socket(socket.AF_UNIX) as sock:
            sock.settimeout(DEADLINE_S)
            sock.connect(str(path))
            sock.sendall(b"\xff" * 100)
            with contextlib.suppress(ConnectionError):
                assert sock.recv(1) == b""
    barrier(running, listener)
    assert len(running.warnings) == hub.MAX_WARNINGS
    assert running.warnings[-1].endswith("further warnings are suppressed for 10 s")


def test_connections_are_bounded(running: RunningHub, path: Path, listener: Listener) -> None:
    with contextlib.ExitStack() as all_of_them:
        sockets = [all_of_them.enter_context(socket.socket(socket.AF_UNIX)) for _ in range(hub.MAX_CONNECTIONS)]
        for sock in sockets:
            sock.connect(str(path))
        sockets[-1].settimeout(DEADLINE_S)
        assert sockets[-1].recv(1) == b""
        barrier(running, listener)
    assert running.warnings == [f"a connection of user {os.getuid()} is refused ({hub.MAX_CONNECTIONS} are open)"]


def test_a_stopped_subscriber_slows_nobody_and_gets_the_newest(running: RunningHub, path: Path) -> None:
    """One that never reads, one that stops and goes on, one that keeps up."""
    goes_on, standing = threading.Event(), threading.Event()
    slow: list[tuple[str, bytes]] = []

    def read_slowly(topic: str, payload: bytes, sent_ns: int) -> None:
        standing.set()
        goes_on.wait(DEADLINE_S)
        slow.append((topic, payload))

    deaf = frame.connect(path, frame.SUBSCRIBE, "deaf")
    stopped, quick = Subscriber(path, "stopped", read_slowly), Listener(path)
    wait_for(lambda: quick.alive.get("supervisor"), "the connection")
    navigation = Publisher(path, "navigation")
    text = b"%06d" + b"x" * 4000
    for i in range(6000):  # 24 MB, many times what queues and sockets hold
        navigation.publish(COUNT, text % i)
        if i % 20 == 19:  # what the hub's socket takes at once
            wait_for(lambda: quick.messages and quick.messages[-1][1][:6] == b"%06d" % i, "the quick one")  # noqa: B023
    running.hub.publish("/event", b"seen by all")
    wait_for(lambda: ("/event", b"seen by all") in quick.messages, "the event")
    assert quick.payloads(COUNT) == [text % i for i in range(6000)]
    assert standing.is_set()
    goes_on.set()
    wait_for(lambda: ("/event", b"seen by all") in slow, "the event, late")
    values = [payload for topic, payload in slow if topic == COUNT]
    assert len(values) < 5000
    assert values[-1] == quick.payloads(COUNT)[-1], "the newest is not lost"
    navigation.close()
    stopped.close()
    quick.subscriber.close()
    assert deaf is not None
    deaf.close()


def test_events_are_kept_as_long_as_the_queue_lasts_and_losses_are_reported(running: RunningHub, path: Path) -> None:
    deaf = frame.connect(path, frame.SUBSCRIBE, "deaf")
    assert deaf is not None
    reader = frame.FrameReader()
    events: list[int] = []
    listener = Listener(path)
    running.wait_for_subscribers(2)
    for i in range(400):
        running.hub.publish("/event", b"%d" % i + b" " * 60000)
        if i % 20 == 19:  # the hub's own queue is bounded, too
            wait_for(lambda: len(listener.messages) > i, "what keeps up")  # noqa: B023
    deaf.setblocking(True)
    deaf.settimeout(DEADLINE_S)
    while not events or events[-1] != 399:
        events += [int(f.payload) for f in reader.feed(deaf.recv(2**20)) if f.topic == "/event"]
    assert events == sorted(events)
    lost = 400 - len(events)
    assert lost > 0
    wait_for(lambda: running.warnings, "the sentence")
    assert running.warnings == [f"deaf reads too slowly: {lost} messages are lost"]
    deaf.close()
    listener.subscriber.close()


def test_killed_publisher_is_noticed_and_its_successor_received(path: Path, listener: Listener) -> None:
    for _ in range(2):
        process = start(PUBLISHER, path)
        wait_for(lambda: listener.alive.get("navigation"), "navigation appears")
        listener.expect_news("its messages")
        kill(process)
        wait_for(lambda: listener.alive.get("navigation") is False, "navigation's end is noticed")


def test_a_later_subscriber_knows_who_is_alive(path: Path) -> None:
    navigation = Publisher(path, "navigation")
    later = Listener(path)
    wait_for(lambda: later.alive.get("navigation"), "navigation is known")
    navigation.close()
    wait_for(lambda: later.alive.get("navigation") is False, "navigation's end is noticed")
    later.subscriber.close()


def test_killed_subscriber_harms_nobody(path: Path, listener: Listener) -> None:
    publisher = start(PUBLISHER, path)
    subscriber = start(SUBSCRIBER, path)
    assert subscriber.stdout is not None
    assert subscriber.stdout.readline() == "/nav/count\n"
    kill(subscriber)
    listener.expect_news("messages after the other subscriber was killed")
    kill(publisher)


def test_everyone_returns_to_a_restarted_hub(tmp_path: Path) -> None:
    path = tmp_path / "bus.sock"
    first = RunningHub(path)
    publisher = start(PUBLISHER, path)
    listener = Listener(path)
    listener.expect_news("messages through the first hub")
    first.close()
    wait_for(lambda: listener.alive.get("navigation") is False, "the hub's end is noticed")
    assert listener.alive["supervisor"] is False
    with RunningHub(path):
        wait_for(lambda: listener.alive.get("navigation"), "navigation is back")
        listener.expect_news("messages through the second hub")
        kill(publisher)
        listener.subscriber.close()


def test_without_a_hub_publishing_returns_and_subscribing_raises(tmp_path: Path) -> None:
    path = tmp_path / "bus.sock"
    publisher = Publisher(path, "navigation")
    for _ in range(1000):
        publisher.publish("/nav/glide_slope", b"x" * 400)
    assert publisher.lost == 1000
    with pytest.raises(MissingError, match=f"{path}: no bus of this user found; is the daemon running"):
        Subscriber(path, "test", lambda topic, payload, sent_ns: None)


def test_a_failure_of_the_hub_is_reported_and_it_works_on(
    running: RunningHub, path: Path, listener: Listener, monkeypatch: pytest.MonkeyPatch
) -> None:
    spread, failed = hub.Hub._broadcast, threading.Event()

    def fail_once(self: hub.Hub, message: frame.BusFrame) -> None:
        if not failed.is_set():
            failed.set()
            raise RuntimeError("sick")
        spread(self, message)

    monkeypatch.setattr(hub.Hub, "_broadcast", fail_once)
    running.hub.publish("/health", b"lost")
    wait_for(failed.is_set, "the failure")
    barrier(running, listener)
    assert running.warnings == ["RuntimeError: sick"]
