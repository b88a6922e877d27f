"""A flight sent to an MQTT broker live, and again from its recording: the same outputs."""

from __future__ import annotations

import json
import signal
import subprocess
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from fti.bus.loopback import choose_port
from tests.e2e.harness import FTI, fti
from tests.helpers import ROOT, until
from tests.publish.broker import Broker, MqttReader, Received

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(600)]
CONFIGS = ROOT / "configs"
#: Fields that depend on the moment of publication.
OF_PUBLICATION = ("boot", "number", "age_ms", "late", "max_age_ms")


def write_configuration(folder: Path, port: int) -> tuple[Path, Path]:
    """A scenario of a short approach, and its configuration with a broker."""
    text = (CONFIGS / "demo.toml").read_text().replace('"profiles/', f'"{CONFIGS}/profiles/')
    config = folder / "demo.toml"
    config.write_text(f'{text}\n[publish]\naircraft = "D-EFTI"\n[publish.mqtt]\nport = {port}\nmax_rate_hz = 1000.0\n')
    approach = (CONFIGS / "scenarios" / "nominal.toml").read_text().replace("../demo.toml", str(config))
    scenario = folder / "short.toml"
    scenario.write_text(approach + '\n[flight]\nkind = "approach"\nduration_s = 12\n')
    return scenario, config


def outputs(messages: list[Received]) -> dict[tuple[str, int], dict[str, Any]]:
    """The outputs by topic and time, without what depends on the moment of publication."""
    return {
        ("/nav/" + message.topic.partition("/nav/")[2], message.fields["t_ns"]): {
            key: value for key, value in message.fields.items() if key not in OF_PUBLICATION
        }
        for message in messages
        if "/nav/" in message.topic
    }


def events(messages: list[Received]) -> list[dict[str, Any]]:
    return [
        {key: message.fields[key] for key in ("t_ns", "level", "source", "text")}
        for message in messages
        if message.topic.endswith("/event")
    ]


def test_the_recording_is_sent_as_the_flight_was(tmp_path: Path) -> None:
    broker = Broker(tmp_path)
    scenario, config = write_configuration(tmp_path, broker.port)
    try:
        with closing(MqttReader(broker)) as live:
            out = ("--out", str(tmp_path / "out"), "--run-dir", str(tmp_path / "run"))
            done = fti("demo", "--headless", "--scenario", str(scenario), "--duration", "10", *out)
            assert done.returncode == 0, done.stdout + done.stderr
            until(lambda: any(s["state"] == "ended" for s in live.of("/state")), what="the end")
        (session,) = (tmp_path / "out").glob("demo_*")
        with closing(MqttReader(broker)) as again:
            done = fti("publish", str(session), "--config", str(config), "--speed", "3", "--json")
            assert done.returncode == 0, done.stdout + done.stderr
            until(lambda: any(s["number"] and s["state"] == "ended" for s in again.of("/state")[1:]), what="the end")
    finally:
        broker.kill()
    counts = json.loads(done.stdout)["sinks"]["mqtt"]
    assert counts["lost_events"] == 0
    compare_outputs(outputs(live.messages), outputs(again.messages))
    sent_live = events(live.messages)
    assert len(sent_live) > 3
    assert [event for event in sent_live if event not in events(again.messages)] == []
    assert again.of("/health")[-1]["session"]["origin"] == "replay"
    live_alarms = {alarm["id"] for alarm in live.of("/alarms")[-1]["alarms"]}
    assert {alarm["id"] for alarm in again.of("/alarms")[-1]["alarms"]} == live_alarms


def compare_outputs(live: dict[tuple[str, int], Any], again: dict[tuple[str, int], Any]) -> None:
    """What was received both times is equal; of values that came together only the newest was sent."""
    common = live.keys() & again.keys()
    assert len(common) > 0.5 * len(live) > 150
    assert {topic for topic, _ in live} == {topic for topic, _ in again}
    late = {key for key in common if live[key]["valid"] != again[key]["valid"]}  # late when it was published
    assert len(late) < 0.02 * len(common)
    for key in common - late:
        assert again[key] == live[key]


def test_ctrl_c_ends_it_and_says_what_was_sent(tmp_path: Path) -> None:
    broker = Broker(tmp_path)
    _, config = write_configuration(tmp_path, broker.port)
    session = next((ROOT / "tests/sessions/0.1.0/demonstration").iterdir())
    command = [*FTI, "publish", str(session), "--config", str(config), "--loop"]
    try:
        with closing(MqttReader(broker)) as reader:
            process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            until(lambda: reader.of("/nav/nav_solution"), what="an output")
            process.send_signal(signal.SIGINT)
            out, _ = process.communicate(timeout=30.0)
            assert process.returncode == 130
            assert out.startswith("mqtt: ")
            until(lambda: reader.of("/state")[-1]["state"] == "ended", what="the end")
    finally:
        broker.kill()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('[session]\nname = "x"\n', "publish: is missing; fti publish needs [publish] with at least one sink"),
        ('[session]\nname = "x"\n[publish]\n', "publish: has no sink; fti publish needs at least one"),
        ('[session]\nname = "x"\n[publish.mqtt]\nhost = "h"\nuser = "a"\npassword_file = "p"\n', "needs tls = true"),
    ],
)
def test_a_configuration_without_a_usable_sink_is_an_error(tmp_path: Path, text: str, expected: str) -> None:
    config = tmp_path / "x.toml"
    config.write_text(text)
    session = next((ROOT / "tests/sessions/0.1.0/demonstration").iterdir())
    done = fti("publish", str(session), "--config", str(config))
    assert done.returncode == 2
    assert expected in done.stderr and str(config) in done.stderr


def test_a_time_after_the_end_is_an_error(tmp_path: Path) -> None:
    """Repeated for ever, it would send nothing, without a pause."""
    config = tmp_path / "x.toml"
    config.write_text(f'[session]\nname = "x"\n[publish.nmea]\ntcp_port = {choose_port(0)}\n')
    session = next((ROOT / "tests/sessions/0.1.0/demonstration").iterdir())
    done = fti("publish", str(session), "--config", str(config), "--from", "1000", "--loop")
    assert done.returncode == 2
    assert f"{session}: has no messages after --from 1000 s" in done.stderr
