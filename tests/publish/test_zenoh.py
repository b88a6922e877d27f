"""The zenoh sink through a router, with a plain zenoh client behind it."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path

import pytest

from fti.bus.loopback import choose_port
from fti.config import Publish, ZenohTable
from fti.publish.message import PublishedMessage
from fti.publish.sinks.zenoh import KeptMessages
from tests.bus.running_hub import RunningHub, wait_for
from tests.helpers import ROOT
from tests.publish.certificates import make_certificates
from tests.publish.running_publisher import AIRCRAFT, SESSION, RunningPublisher
from tests.publish.zenoh_router import Router, ZenohReader

PREFIX = f"fti/{AIRCRAFT}/{SESSION}"


@pytest.fixture
def hub() -> Iterator[RunningHub]:
    with RunningHub() as running:
        yield running


@pytest.fixture
def router() -> Iterator[Router]:
    running = Router(f"tcp/127.0.0.1:{choose_port(0)}")
    yield running
    running.kill()


def publisher(hub: RunningHub, endpoint: str, **keys: object) -> RunningPublisher:
    return RunningPublisher(hub, Publish(zenoh=ZenohTable.model_validate({"connect": endpoint, **keys})))


def test_a_plain_client_sees_every_topic_behind_a_router(hub: RunningHub, router: Router) -> None:
    with closing(ZenohReader(router.endpoint)) as reader:
        with publisher(hub, router.endpoint) as running:
            running.wait_for_state("zenoh", "connected")
            wait_for(lambda: reader.alive.get(f"{PREFIX}/@alive/publish"), "liveliness")
            running.publish("/nav/glide_slope", t_ns=5, deviation=None)
            running.publish_event(1)
            wait_for(lambda: reader.of("/event") and reader.of("/nav/glide_slope"), "two messages")
            (value,) = reader.of(f"{PREFIX}/nav/glide_slope")
            boot = value["boot"]
            assert value == {"boot": boot, "number": 1, "t_ns": 5, "deviation": None}
            assert reader.of("/event")[0]["boot"] == boot
            wait_for(lambda: running.sinks["zenoh"].peers == 1, "one router")
        wait_for(lambda: reader.alive == {f"{PREFIX}/@alive/publish": False}, "the end of liveliness")


def test_the_newest_values_and_lost_events_are_queried(hub: RunningHub, router: Router) -> None:
    with publisher(hub, router.endpoint) as running:
        running.wait_for_state("zenoh", "connected")
        for number in range(1, 8):
            running.publish_event(number)
        running.publish("/nav/glide_slope", t_ns=5)
        wait_for(lambda: running.sinks["zenoh"].sent == 8, "eight messages")
        with closing(ZenohReader(router.endpoint)) as reader:
            answers = reader.get("fti/**")
            assert {key: fields["number"] for key, fields in answers.items()} == {
                f"{PREFIX}/nav/glide_slope": 1,
                f"{PREFIX}/event": 7,
            }
            events = reader.get(f"{PREFIX}/event/*?from=3;to=5")
            assert {key: fields["text"] for key, fields in events.items()} == {
                f"{PREFIX}/event/{number}": f"event {number}" for number in (3, 4, 5)
            }
            assert len(reader.get(f"{PREFIX}/event/*?from=1")) == 7
            assert reader.get(f"{PREFIX}/event/*?from=x") == {}
            assert reader.get("fti/other/**") == {}


def test_no_event_is_lost_while_the_router_is_gone(hub: RunningHub, router: Router, scale: int) -> None:
    """The router is killed for 3 s, with --scale full for a minute; the client gets what it missed by query."""
    with publisher(hub, router.endpoint) as running:
        running.wait_for_state("zenoh", "connected")
        running.publish("/alarms", t_ns=1, alarms=[])
        running.publish_event(1)
        wait_for(lambda: running.sinks["zenoh"].sent == 2, "two messages")
        router.kill()
        end_s, number = time.monotonic() + 3.0 * scale, 1
        while time.monotonic() < end_s:
            number += 1
            running.publish_event(number)
            time.sleep(0.05)
        running.wait_for_state("zenoh", "retrying")
        router.start()
        running.wait_for_state("zenoh", "connected")
        wait_for(lambda: running.sinks["zenoh"].waiting_events == 0, "an empty queue")
        with closing(ZenohReader(router.endpoint)) as reader:
            events = reader.get(f"{PREFIX}/event/*?from=1")
            assert {fields["t_ns"] for fields in events.values()} == {*range(1, number + 1)}
            assert reader.get(f"{PREFIX}/alarms")[f"{PREFIX}/alarms"]["t_ns"] == 1
        assert running.sinks["zenoh"].lost_events == 0


def test_a_stopped_router_delays_nothing(hub: RunningHub, router: Router, scale: int) -> None:
    with publisher(hub, router.endpoint, max_rate_hz=1000) as running:
        running.wait_for_state("zenoh", "connected")
        router.pause()
        end_s, number = time.monotonic() + 3.0 * scale, 0
        while time.monotonic() < end_s:
            number += 1
            running.publish_event(number)
            running.publish("/nav/glide_slope", t_ns=number, text="x" * 50_000)
            time.sleep(0.02)
        assert hub.warnings == []
        router.resume()
        running.wait_for_state("zenoh", "connected")
        wait_for(lambda: running.sinks["zenoh"].waiting_events == 0, "an empty queue")
        with closing(ZenohReader(router.endpoint)) as reader:
            events = reader.get(f"{PREFIX}/event/*?from=1")
        assert len(events) == number
        assert running.sinks["zenoh"].lost_events == 0


def test_messages_of_clients_have_no_effect_and_a_flood_of_queries_is_refused(hub: RunningHub, router: Router) -> None:
    with closing(ZenohReader(router.endpoint)) as reader, publisher(hub, router.endpoint) as running:
        running.wait_for_state("zenoh", "connected")
        running.publish_event(1)
        wait_for(lambda: reader.of("/event"), "the event")
        for topic in ("/event", "/command", "/nav/glide_slope"):
            reader.session.put(PREFIX + topic, '{"boot":"x","number":99,"t_ns":99}')
        answered = sum(bool(reader.get("fti/**")) for _ in range(300))
        assert 40 <= answered < 300
        assert reader.get(f"{PREFIX}/command") == {}
        wait_for(lambda: f"{PREFIX}/event" in (answer := reader.get("fti/**")) and answer, "an answer")
        running.publish_event(2)
        wait_for(lambda: reader.of("/event")[-1]["t_ns"] == 2, "the next event")
    assert running.events == []


def test_a_login_over_tls(hub: RunningHub, tmp_path: Path) -> None:
    ca, certificate, key = make_certificates(tmp_path, "ground")
    users = tmp_path / "users.txt"
    users.write_text("aircraft:right\n")
    password = tmp_path / "zenoh.password"
    password.write_text("wrong\n")
    password.chmod(0o600)
    transport = {
        "link": {"tls": {"listen_certificate": str(certificate), "listen_private_key": str(key)}},
        "auth": {"usrpwd": {"user": "router", "password": "x", "dictionary_file": str(users)}},
    }
    router = Router(f"tls/127.0.0.1:{choose_port(0)}", transport=transport)
    keys = {"user": "aircraft", "password_file": str(password)}
    try:
        with publisher(hub, router.endpoint, ca_file=str(ca), **keys) as running:
            wait_for(lambda: running.events, "a refusal")
            assert running.sinks == {} or running.sinks["zenoh"].connects == 0
            password.write_text("right\n")
            running.wait_for_state("zenoh", "connected")
    finally:
        router.kill()


def test_a_router_with_a_wrong_certificate_gets_nothing(hub: RunningHub, tmp_path: Path) -> None:
    _, certificate, key = make_certificates(tmp_path, "impostor")
    ca, *_ = make_certificates(tmp_path, "ground")
    tls = {"listen_certificate": str(certificate), "listen_private_key": str(key)}
    router = Router(f"tls/127.0.0.1:{choose_port(0)}", transport={"link": {"tls": tls}})
    try:
        with publisher(hub, router.endpoint, ca_file=str(ca)) as running:
            wait_for(lambda: running.events, "a refusal")
            assert f"publish.zenoh: {router.endpoint}" in running.events[0].text
            assert running.sinks == {} or running.sinks["zenoh"].connects == 0
    finally:
        router.kill()


def test_the_documented_router_lets_an_aircraft_write_its_own_keys_only(hub: RunningHub, tmp_path: Path) -> None:
    ca, certificate, key = make_certificates(tmp_path, "ground")
    users = tmp_path / "users.txt"
    users.write_text("aircraft:a\nground:g\nother:o\n")
    password = tmp_path / "zenoh.password"
    password.write_text("a\n")
    password.chmod(0o600)
    endpoint = f"tls/127.0.0.1:{choose_port(0)}"
    router = Router(endpoint, config=documented_router(endpoint, certificate, key, users))

    def client(user: str, word: str) -> ZenohReader:
        tls = {"root_ca_certificate": str(ca)}
        return ZenohReader(endpoint, link={"tls": tls}, auth={"usrpwd": {"user": user, "password": word}})

    keys = {"ca_file": str(ca), "user": "aircraft", "password_file": str(password)}
    try:
        with closing(client("ground", "g")) as ground, publisher(hub, endpoint, **keys) as running:
            running.wait_for_state("zenoh", "connected")
            running.publish_event(1)
            wait_for(lambda: ground.of("/event"), "the event on the ground")
            assert ground.alive == {f"{PREFIX}/@alive/publish": True}
            assert ground.get(f"{PREFIX}/event/*?from=1")[f"{PREFIX}/event/1"]["t_ns"] == 1
            for user, word in (("other", "o"), ("ground", "g")):
                with closing(client(user, word)) as writer:
                    writer.session.put(f"{PREFIX}/event", '{"t_ns":77}')
                    assert bool(writer.get("fti/**")) == (user == "ground")
            running.publish_event(2)
            wait_for(lambda: ground.of("/event")[-1]["t_ns"] == 2, "the next event on the ground")
            assert [event["t_ns"] for event in ground.of("/event")] == [1, 2]
    finally:
        router.kill()


def documented_router(endpoint: str, certificate: Path, key: Path, users: Path) -> str:
    """The configuration of a router in docs/publish.md with the files of this test."""
    text = (ROOT / "docs/publish.md").read_text().partition("```json5\n")[2].partition("```")[0]
    changes = {
        "tls/0.0.0.0:7447": endpoint,
        "ground.pem": str(certificate),
        "ground.key": str(key),
        "users.txt": str(users),
        "D-EFTI": AIRCRAFT,
    }
    for documented, used in changes.items():
        assert documented in text
        text = text.replace(documented, used)
    return text


def test_a_radio_link_of_9600_bit_per_s_carries_position_and_events(hub: RunningHub, router: Router) -> None:
    """A relay passes 1200 bytes a second; the position comes every few seconds and is not older than that."""
    with SlowRelay(int(router.endpoint.rpartition(":")[2]), bytes_per_s=1200.0) as relay:
        topics = ("/nav/nav_solution", "/event")
        with (
            closing(ZenohReader(router.endpoint)) as reader,
            publisher(hub, f"tcp/127.0.0.1:{relay.port}", topics=topics, max_rate_hz=0.5) as running,
        ):
            running.wait_for_state("zenoh", "connected")
            begin_s, number = time.monotonic(), 0
            while time.monotonic() - begin_s < 12.0:
                number += 1
                running.publish("/nav/nav_solution", t_ns=time.monotonic_ns(), text="x" * 700)
                running.publish("/health", t_ns=1, text="x" * 5000)
                if number % 100 == 0:
                    running.publish_event(number)
                time.sleep(0.04)
                if positions := reader.of("/nav/nav_solution"):
                    assert time.monotonic_ns() - positions[-1]["t_ns"] < 6e9
            assert 4 <= len(reader.of("/nav/nav_solution")) <= 8
            assert len(reader.of("/event")) >= number // 100 - 1
            assert running.sinks["zenoh"].connects == 1


class SlowRelay:
    """Passes TCP connections to a port, towards it at a limited rate."""

    def __init__(self, target: int, bytes_per_s: float) -> None:
        self._target, self._bytes_per_s = target, bytes_per_s
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self._sockets: list[socket.socket] = [self._server]
        self._threads = [threading.Thread(target=self._accept)]

    def __enter__(self) -> SlowRelay:
        self._threads[0].start()
        return self

    def __exit__(self, *_: object) -> None:
        for sock in self._sockets:
            with suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        for sock in self._sockets:
            sock.close()

    def _accept(self) -> None:
        while True:
            try:
                here, _ = self._server.accept()
            except OSError:
                return
            here.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            there = socket.create_connection(("127.0.0.1", self._target))
            self._sockets += [here, there]
            for pair in ((here, there, self._bytes_per_s), (there, here, 1e9)):
                thread = threading.Thread(target=self._pass, args=pair)
                self._threads.append(thread)
                thread.start()

    @staticmethod
    def _pass(source: socket.socket, target: socket.socket, bytes_per_s: float) -> None:
        with suppress(OSError):
            while data := source.recv(120):
                target.sendall(data)
                time.sleep(len(data) / bytes_per_s)


# ------------------------------------------------------------------------------------------------- kept messages


def test_kept_events_are_bounded_and_kept_once() -> None:
    kept = KeptMessages()
    for number in range(1, 5001):
        for _ in range(2):
            kept.add(PublishedMessage("/event", b"{}", number))
    numbers = [message.number for topic, message in kept.select(0, None) if topic.startswith("/event/")]
    assert numbers == [*range(905, 5001)]
    assert [topic for topic, _ in kept.select(None, None)] == ["/event"]
