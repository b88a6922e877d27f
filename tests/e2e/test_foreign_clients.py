"""A daemon with an endpoint for zenoh clients: what they send is neither shown nor recorded."""

from __future__ import annotations

import json
import os
import signal
import socket
from contextlib import closing
from pathlib import Path

import pytest

from fti.logger.reading.recording import Recording
from tests.bus.test_zenoh_endpoint import ForeignClient
from tests.e2e.harness import START_S, daemon, fti
from tests.helpers import until

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(600)]

CONFIG = """
[session]
name = "guests"
min_free_mb = 10

[[link]]
name = "net"
kind = "udp"
bind = "127.0.0.1:0"

[display]
port = 0

[bus]
enabled = {enabled}
"""
SPOOFED = {
    "/event": {"t_ns": 1, "level": "error", "source": "recorder", "text": "spoofed"},
    "/nav/clearance_integrity": {"t_ns": 1, "t_valid_ns": 1, "state": "ok", "reasons": [], "valid": True},
    "/health": {"t_ns": 1, "session": {"name": "spoofed"}},
}


def write_config(folder: Path, enabled: bool) -> Path:
    path = folder / "guests.toml"
    path.write_text(CONFIG.format(enabled=str(enabled).lower()))
    return path


def receives(client: ForeignClient, topic: str) -> bool:
    return any(key == f"fti/guests{topic}" and b"spoofed" not in payload for key, payload in client.messages)


def test_what_a_zenoh_client_sends_is_neither_shown_nor_recorded(tmp_path: Path) -> None:
    with daemon(write_config(tmp_path, enabled=True), tmp_path / "out") as running:
        session = running.session
        client = ForeignClient(running.info["zenoh"])
        with closing(client):
            until(lambda: receives(client, "/health"), START_S, "health")
            until(lambda: client.alive.get("fti/guests/@alive/navigation"), START_S, "navigation alive")
            for topic, fields in SPOOFED.items():
                client.session.put(f"fti/guests{topic}", json.dumps(fields))
            assert fti("mark", "behind it", "--run-dir", str(running.run_dir)).returncode == 0
            until(lambda: receives(client, "/event"), START_S, "the mark")
            shown = running.watch()
            assert "spoofed" not in json.dumps(shown)
            assert shown["outputs"]["/nav/clearance_integrity"]["state"] == "no_profile"
        running.process.send_signal(signal.SIGINT)
        assert running.wait() == 130
    assert not [line for line in running.lines if "error" in line]
    recorded = [data for *_, data in Recording.open(session).messages("/fti/event", "raw")]
    assert any(b"behind it" in data for data in recorded)
    assert not any(b"spoofed" in data for data in recorded)


def test_without_it_nothing_listens_and_page_and_watch_work(tmp_path: Path) -> None:
    with daemon(write_config(tmp_path, enabled=False), tmp_path / "out") as running:
        assert running.display.startswith("http://127.0.0.1:")
        assert running.info["zenoh"] is None
        assert running.watch()["health"]["session"]["name"] == "guests"


def test_a_port_in_use_is_one_sentence(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        config = write_config(tmp_path, enabled=True)
        config.write_text(config.read_text() + f"port = {port}\n")
        done = fti("run", str(config), "--out", str(tmp_path / "out"), "--run-dir", str(tmp_path / "run"))
    assert done.returncode == 2
    expected = f"bus.port = {port}: cannot be used on 127.0.0.1: Address already in use; 0 chooses a free port"
    assert done.stderr.count("\n") == 1
    assert expected in done.stderr


def test_a_killed_zenoh_process_is_started_again_at_the_same_endpoint(tmp_path: Path) -> None:
    with daemon(write_config(tmp_path, enabled=True), tmp_path / "out") as running:
        endpoint, first = running.info["zenoh"], running.pid_of("zenoh")
        os.kill(first, signal.SIGKILL)
        until(lambda: running.pid_of("zenoh") != first, START_S, "another process")
        client = ForeignClient(endpoint)
        with closing(client):
            until(lambda: receives(client, "/health"), START_S, "health")
        assert running.health()["processes"]["navigation"]["restarts"] == 0
