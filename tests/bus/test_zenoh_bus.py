"""The bus between real processes: it survives the death of every one of them."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from fti.bus.zenoh_bus import Hub, Publisher, Subscriber
from fti.errors import MissingError

NAME = "test_1"
DEADLINE_S = 20.0
PUBLISHER = """
import itertools, sys, time
from fti.bus.zenoh_bus import Publisher
publisher = Publisher.connect(sys.argv[1], sys.argv[2])
publisher.alive("navigation")
for i in itertools.count():
    publisher.publish("/nav/count", b"%d" % i)
    time.sleep(0.005)
"""
SUBSCRIBER = """
import sys, time
from fti.bus.zenoh_bus import Subscriber
subscriber = Subscriber.connect(sys.argv[1], sys.argv[2], lambda topic, payload: print(topic, flush=True))
sys.stdin.read()
"""


def wait_for(condition: Callable[[], object], what: str) -> None:
    end = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < end, f"{what}: not within {DEADLINE_S} s"
        time.sleep(0.01)


class Listener:
    """What a subscriber of this process has heard."""

    def __init__(self, endpoint: str) -> None:
        self.messages: list[tuple[str, bytes]] = []
        self.alive: dict[str, bool] = {}
        self.subscriber = Subscriber.connect(endpoint, NAME, self._take, self.alive.__setitem__)

    def _take(self, topic: str, payload: bytes) -> None:
        self.messages.append((topic, payload))

    def expect_news(self, what: str) -> None:
        self.messages.clear()
        wait_for(lambda: self.messages, what)


@pytest.fixture
def hub() -> Iterator[Hub]:
    opened = Hub.open(0, NAME)
    yield opened
    opened.close()


@pytest.fixture
def listener(hub: Hub) -> Iterator[Listener]:
    made = Listener(hub.endpoint)
    yield made
    made.subscriber.close()


def start(script: str, hub: Hub) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", script, hub.endpoint, NAME], text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )


def kill(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.communicate()


def publish_until_heard(publisher: Hub | Publisher, topic: str, listener: Listener) -> bytes:
    """A subscription takes a moment to become known: publish until something arrives."""

    def heard() -> bool:
        publisher.publish(topic, b"payload")
        return any(found == topic for found, _ in listener.messages)

    wait_for(heard, f"a message on {topic}")
    return next(payload for found, payload in listener.messages if found == topic)


def test_hub_and_publisher_reach_a_subscriber(hub: Hub, listener: Listener) -> None:
    publisher = Publisher.connect(hub.endpoint, NAME)
    assert publish_until_heard(hub, "/health", listener) == b"payload"
    assert publish_until_heard(publisher, "/nav/height_above_ground/ra", listener) == b"payload"
    publisher.close()


def test_sessions_do_not_hear_each_other(hub: Hub, listener: Listener) -> None:
    stranger = Publisher.connect(hub.endpoint, "other_1")
    stranger.publish("/nav/stranger", b"")
    publish_until_heard(hub, "/health", listener)
    stranger.close()
    assert all(topic == "/health" for topic, _ in listener.messages)


def test_killed_publisher_is_noticed_and_its_successor_heard(hub: Hub, listener: Listener) -> None:
    for _ in range(2):
        process = start(PUBLISHER, hub)
        wait_for(lambda: listener.alive.get("navigation"), "navigation appears")
        listener.expect_news("its messages")
        kill(process)
        wait_for(lambda: listener.alive.get("navigation") is False, "navigation's end is noticed")


def test_killed_subscriber_harms_nobody(hub: Hub, listener: Listener) -> None:
    publisher = start(PUBLISHER, hub)
    subscriber = start(SUBSCRIBER, hub)
    assert subscriber.stdout is not None
    assert subscriber.stdout.readline() == "/nav/count\n"
    kill(subscriber)
    listener.expect_news("messages after the other subscriber was killed")
    kill(publisher)


def test_everyone_returns_to_a_restarted_hub() -> None:
    hub = Hub.open(0, NAME)
    publisher = start(PUBLISHER, hub)
    listener = Listener(hub.endpoint)
    listener.expect_news("messages through the first hub")
    hub.close()
    wait_for(lambda: listener.alive.get("navigation") is False, "the hub's end is noticed")
    hub = Hub.open(hub.port, NAME)
    wait_for(lambda: listener.alive.get("navigation"), "navigation is back")
    listener.expect_news("messages through the second hub")
    kill(publisher)
    listener.subscriber.close()
    hub.close()


def test_without_a_hub_publishing_returns_and_connecting_says_so() -> None:
    hub = Hub.open(0, NAME)
    publisher = Publisher.connect(hub.endpoint, NAME)
    hub.close()
    finished = threading.Event()

    def publish() -> None:
        for _ in range(1000):
            publisher.publish("/nav/glide_slope", b"x" * 400)
        finished.set()

    threading.Thread(target=publish, daemon=True).start()
    assert finished.wait(DEADLINE_S)
    publisher.close()
    with pytest.raises(MissingError, match=f"no bus at {hub.endpoint}"):
        Publisher.connect(hub.endpoint, NAME)


def test_a_port_in_use_is_named(hub: Hub) -> None:
    with pytest.raises(MissingError, match=f"bus.port = {hub.port}: the port is in use"):
        Hub.open(hub.port, NAME)
