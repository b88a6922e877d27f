"""The MQTT sink with a real broker and a real client."""

from __future__ import annotations

import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from fti.config import MqttTable, Publish
from tests.bus.running_hub import RunningHub, wait_for
from tests.publish.broker import Broker, MqttReader
from tests.publish.certificates import make_certificates
from tests.publish.running_publisher import AIRCRAFT, SESSION, RunningPublisher

PREFIX = f"fti/{AIRCRAFT}/{SESSION}"
GLIDE_SLOPE = {"t_ns": 1, "valid": False, "reasons": ["no_profile"], "deviation": None}


@pytest.fixture
def hub() -> Iterator[RunningHub]:
    with RunningHub() as running:
        yield running


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    running = Broker(tmp_path)
    yield running
    running.kill()


def publisher(hub: RunningHub, broker: Broker, **keys: object) -> RunningPublisher:
    return RunningPublisher(hub, Publish(mqtt=MqttTable.model_validate({"port": broker.port, **keys})))


def event_numbers(reader: MqttReader) -> list[int]:
    return [fields["t_ns"] for fields in reader.of("/event")]


def test_a_client_receives_every_topic_with_boot_and_number(hub: RunningHub, broker: Broker) -> None:
    with closing(MqttReader(broker)) as reader, publisher(hub, broker) as running:
        running.wait_for_state("mqtt", "connected")
        running.publish("/nav/glide_slope", **GLIDE_SLOPE)
        running.publish_event(1)
        running.publish_event(2)
        wait_for(lambda: len(reader.of("/event")) == 2 and reader.of("/nav/glide_slope"), "three messages")
        (value,) = reader.of(f"{PREFIX}/nav/glide_slope")
        boot = value.pop("boot")
        assert value == {"number": 1, **GLIDE_SLOPE}
        assert [(e["boot"], e["number"], e["text"]) for e in reader.of(f"{PREFIX}/event")] == [
            (boot, 1, "event 1"),
            (boot, 2, "event 2"),
        ]
        assert reader.of(f"{PREFIX}/state") == [{"boot": boot, "number": 1, "state": "online"}]
    wait_for(lambda: len(reader.of("/state")) == 2, "the end")
    assert reader.of("/state")[-1] == {"boot": boot, "number": 1, "state": "ended"}


def test_a_late_client_gets_the_newest_values_and_no_old_event(hub: RunningHub, broker: Broker) -> None:
    with publisher(hub, broker) as running:
        running.wait_for_state("mqtt", "connected")
        running.publish_event(1)
        for number in (1, 2, 3):
            running.publish("/nav/glide_slope", **{**GLIDE_SLOPE, "t_ns": number})
        wait_for(lambda: running.sinks["mqtt"].sent >= 2, "sent")
        with closing(MqttReader(broker)) as reader:
            wait_for(lambda: [v["t_ns"] for v in reader.of("/nav/glide_slope")][-1:] == [3], "the newest value")
            assert next(m for m in reader.messages if m.topic.endswith("/nav/glide_slope")).is_retained
            assert reader.of("/state")[0]["state"] == "online"
            assert reader.of("/event") == []


def test_no_event_and_no_retained_state_is_lost_while_the_broker_is_gone(
    hub: RunningHub, broker: Broker, scale: int
) -> None:
    """The broker is killed for 3 s, with --scale full for a minute, and forgets what it has retained."""
    with publisher(hub, broker) as running:
        running.wait_for_state("mqtt", "connected")
        running.publish("/alarms", t_ns=1, alarms=[])
        running.publish("/nav/glide_slope", **GLIDE_SLOPE)
        running.publish_event(1)
        wait_for(lambda: running.sinks["mqtt"].sent == 3, "three messages")
        broker.kill()
        end_s, number = time.monotonic() + 3.0 * scale, 1
        while time.monotonic() < end_s:
            number += 1
            running.publish_event(number)
            running.publish("/nav/glide_slope", **{**GLIDE_SLOPE, "t_ns": number})
            time.sleep(0.05)
        running.wait_for_state("mqtt", "retrying")
        assert running.sinks["mqtt"].waiting_events > 0
        running.process.send_signal(signal.SIGSTOP)  # until the client has subscribed
        broker.start()
        with closing(MqttReader(broker)) as reader:
            running.process.send_signal(signal.SIGCONT)
            wait_for(lambda: number in event_numbers(reader), "the last event")
            wait_for(lambda: reader.of("/alarms") and reader.of("/nav/glide_slope"), "retained values")
            assert sorted(set(event_numbers(reader)) | {1}) == [*range(1, number + 1)]
            assert event_numbers(reader) == sorted(event_numbers(reader))
            assert reader.of("/nav/glide_slope")[-1]["t_ns"] == number
            assert reader.of("/alarms")[-1]["number"] == 1
            assert reader.of("/state")[-1]["state"] == "online"
            assert reader.of("/state")[-1]["number"] > 1
            assert reader.of("/state")[-1]["boot"] == reader.of("/alarms")[-1]["boot"]
        running.wait_for_state("mqtt", "connected")
        health = running.sinks["mqtt"]
        assert health.lost_events == 0
        assert health.replaced > 0
    *failures, success = running.events
    assert {event.level for event in failures} == {"warning"}
    assert (success.level, success.text.partition(";")[0]) == ("info", "connected again")
    assert "publish.mqtt: 127.0.0.1" in failures[0].text


def test_a_stopped_broker_delays_nothing_and_loses_no_event(hub: RunningHub, broker: Broker, scale: int) -> None:
    with closing(MqttReader(broker)) as reader, publisher(hub, broker, max_rate_hz=1000) as running:
        running.wait_for_state("mqtt", "connected")
        broker.pause()
        end_s, number = time.monotonic() + 7.0 * scale, 0
        while time.monotonic() < end_s:
            number += 1
            running.publish_event(number)
            running.publish("/nav/glide_slope", **{**GLIDE_SLOPE, "text": "x" * 20_000})
            time.sleep(0.05)
        assert hub.warnings == []
        broker.resume()
        wait_for(lambda: number in event_numbers(reader), "the last event")
        assert set(event_numbers(reader)) == {*range(1, number + 1)}
    assert running.sinks["mqtt"].lost_events == 0


def test_a_killed_publisher_is_reported_by_the_last_will(hub: RunningHub, broker: Broker) -> None:
    with closing(MqttReader(broker)) as reader:
        running = publisher(hub, broker)
        running.wait_for_state("mqtt", "connected")
        running.process.kill()
        wait_for(lambda: [s["state"] for s in reader.of("/state")] == ["online", "lost"], "the last will")
        online, lost = reader.of("/state")
        assert (lost["boot"], lost["number"]) == (online["boot"], online["number"])
        with pytest.raises(AssertionError):
            running.close()


def test_a_wrong_password_is_reported_and_the_right_one_is_used_without_a_restart(
    hub: RunningHub, tmp_path: Path
) -> None:
    broker = Broker(tmp_path, login=("aircraft", "right"))
    password = tmp_path / "mqtt.password"
    password.write_text("wrong\n")
    password.chmod(0o600)
    try:
        with publisher(hub, broker, user="aircraft", password_file=str(password)) as running:
            running.publish_event(1)
            wait_for(lambda: running.events, "a report")
            assert "authori" in running.events[0].text.lower()
            password.write_text("right\n")
            running.wait_for_state("mqtt", "connected")
            wait_for(lambda: running.sinks["mqtt"].sent == 1, "the event")
        assert "wrong" not in running.events[0].text
    finally:
        broker.kill()


@pytest.mark.parametrize(
    ("content", "mode", "expected"),
    [
        (None, 0o600, "cannot be read: No such file"),
        (b"secret\n", 0o644, "other users can read it (mode 0644); chmod 600"),
        (b"\nsecret\n", 0o600, "the first line is empty"),
        (b"\xff\xfe\n", 0o600, "is not UTF-8 text"),
    ],
)
def test_an_unusable_password_file_is_an_error_that_names_it(
    hub: RunningHub, broker: Broker, tmp_path: Path, content: bytes | None, mode: int, expected: str
) -> None:
    password = tmp_path / "mqtt.password"
    if content is not None:
        password.write_bytes(content)
        password.chmod(mode)
    with publisher(hub, broker, user="aircraft", password_file=str(password)) as running:
        wait_for(lambda: running.events, "a report")
    assert f"publish.mqtt.password_file = {password}: {expected}" in running.events[0].text
    assert "secret" not in running.events[0].text


# ------------------------------------------------------------------------------------------------------------- TLS


def test_tls_with_certificates_on_both_sides(hub: RunningHub, tmp_path: Path) -> None:
    ca, certificate, key = make_certificates(tmp_path, "ground")
    settings = f"cafile {ca}\ncertfile {certificate}\nkeyfile {key}\nrequire_certificate true\n"
    broker = Broker(tmp_path, settings)
    files = {"ca_file": str(ca), "certificate": str(certificate), "private_key": str(key)}
    options = ("--cafile", str(ca), "--cert", str(certificate), "--key", str(key))
    try:
        with (
            closing(MqttReader(broker, options=options)) as reader,
            publisher(hub, broker, tls=True, **files) as running,
        ):
            running.publish_event(1)
            wait_for(lambda: event_numbers(reader) == [1], "the event")
        with publisher(hub, broker, tls=True, ca_file=str(ca)) as running:
            wait_for(lambda: running.events, "a refusal without a certificate")
    finally:
        broker.kill()


def test_a_broker_with_a_wrong_certificate_gets_nothing(hub: RunningHub, tmp_path: Path) -> None:
    impostor_ca, certificate, key = make_certificates(tmp_path, "impostor")
    ca, *_ = make_certificates(tmp_path, "ground")
    broker = Broker(tmp_path, f"certfile {certificate}\nkeyfile {key}\n")
    try:
        with closing(MqttReader(broker, options=("--insecure", "--cafile", str(impostor_ca)))) as reader:
            with publisher(hub, broker, tls=True, ca_file=str(ca)) as running:
                running.publish_event(1)
                wait_for(lambda: running.events, "a refusal")
            assert "certificate verify failed" in running.events[0].text
            assert reader.messages == []
    finally:
        broker.kill()


def test_a_certificate_file_without_a_certificate_is_named(hub: RunningHub, broker: Broker, tmp_path: Path) -> None:
    (tmp_path / "ca.pem").write_text("nothing")
    with publisher(hub, broker, tls=True, ca_file=str(tmp_path / "ca.pem")) as running:
        wait_for(lambda: running.events, "a report")
    assert f"{tmp_path / 'ca.pem'}" in running.events[0].text


# --------------------------------------------------------------------------------------------------------- hostile


def test_a_peer_that_is_no_broker_is_reported(hub: RunningHub) -> None:
    """It accepts, answers garbage, and floods."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(20.0)
        with RunningPublisher(hub, Publish(mqtt=MqttTable(port=server.getsockname()[1]))) as running:
            connection, _ = server.accept()
            with connection:
                connection.settimeout(1.0)
                try:
                    for _ in range(100):
                        connection.sendall(b"\xff" * 65536)
                except OSError:
                    pass
                wait_for(lambda: running.events, "a report")
            assert running.resident_mb() < 300.0


def test_messages_of_clients_have_no_effect(hub: RunningHub, broker: Broker) -> None:
    with closing(MqttReader(broker)) as reader, publisher(hub, broker) as running:
        running.wait_for_state("mqtt", "connected")
        for topic in ("/event", "/command", "/nav/glide_slope"):
            subprocess.run(
                [
                    "mosquitto_pub",
                    "-p",
                    str(broker.port),
                    "-t",
                    PREFIX + topic,
                    "-m",
                    '{"boot":"x","number":1,"t_ns":7}',
                ],
                check=True,
            )
        running.publish_event(1)
        wait_for(lambda: 1 in event_numbers(reader), "the event")
        assert running.process.poll() is None
    assert running.events == []
