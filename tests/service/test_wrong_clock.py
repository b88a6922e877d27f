"""A real-time clock that no file can hold: one sentence, and everything goes on."""

from __future__ import annotations

import json
import os
import queue
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from fti.bus.client import Subscriber
from fti.bus.frame import SOCKET_NAME
from fti.logger.reading.recording import Recording
from fti.logger.verify.verification import verify

DEADLINE_S = 60.0
SENT = 5
#: Loaded by every interpreter that is started with it on the path.
FAKE = """
import os, time
offset_ns = int(os.environ["FAKE_OFFSET_NS"])
real, real_time, real_time_ns = time.clock_gettime_ns, time.time, time.time_ns
time.clock_gettime_ns = lambda clock: real(clock) + (offset_ns if clock == time.CLOCK_REALTIME else 0)
time.time = lambda: real_time() + offset_ns / 1e9
time.time_ns = lambda: real_time_ns() + offset_ns
"""
CONFIG = """
[session]
name = "clock"
[[link]]
name = "udp"
kind = "udp"
bind = "127.0.0.1:{port}"
[display]
port = 0
"""


def free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        port: int = sock.getsockname()[1]
        return port


class Daemon:
    """``fti run`` of one UDP link, whose real-time clock shows another date."""

    def __init__(self, folder: Path, date: datetime) -> None:
        (folder / "sitecustomize.py").write_text(FAKE)
        self.port, self.folder, self.run_dir = free_udp_port(), folder, folder / "run"
        (folder / "c.toml").write_text(CONFIG.format(port=self.port))
        offset_ns = round((date - datetime.now(UTC)).total_seconds() * 1e9)
        command = [sys.executable, "-m", "fti.cli.main", "run", str(folder / "c.toml"), "--out", str(folder / "out")]
        self.process = subprocess.Popen(
            [*command, "--run-dir", str(self.run_dir)],
            env={**os.environ, "PYTHONPATH": str(folder), "FAKE_OFFSET_NS": str(offset_ns)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert self.process.stdout
        self.lines = [self.process.stdout.readline()]
        while not self.lines[-1].startswith("display at"):
            assert self.lines[-1], self.lines
            self.lines.append(self.process.stdout.readline())

    @property
    def page(self) -> bytes:
        address = re.findall(r"http://\S+", self.lines[-1])[0].partition("#")[0]
        with urllib.request.urlopen(address, timeout=DEADLINE_S) as answer:
            content: bytes = answer.read()
            return content

    def stop(self) -> int:
        self.process.send_signal(signal.SIGINT)
        out, _ = self.process.communicate(timeout=DEADLINE_S)
        self.lines += out.splitlines()
        return self.process.returncode

    def wait_for_health(self, wanted: Any) -> dict[str, Any]:
        payloads = queue.SimpleQueue[bytes]()

        def receive(topic: str, payload: bytes, sent_ns: int) -> None:
            if topic == "/health":
                payloads.put(payload)

        with closing(Subscriber(self.run_dir / SOCKET_NAME, "test", receive)):
            end = time.monotonic() + DEADLINE_S
            while True:
                content: dict[str, Any] = json.loads(payloads.get(timeout=end - time.monotonic()))
                if wanted(content):
                    return content


#: The clock of the daemon is set wrong, that of the kernel is not: its timestamps do not fit.
REFUSED = "kernel timestamps were refused"


@pytest.mark.parametrize(
    ("date", "words"),
    [
        (datetime(1969, 7, 20, tzinfo=UTC), "before 1970"),
        (datetime(2106, 2, 7, 12, tzinfo=UTC), "after 2106"),
        (datetime(2261, 1, 1, tzinfo=UTC), "after 2106"),
    ],
)
def test_a_wrong_clock_is_one_sentence_and_everything_is_recorded(date: datetime, words: str, tmp_path: Path) -> None:
    daemon = Daemon(tmp_path, date)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for i in range(SENT):
            sender.sendto(b"%d" % i, ("127.0.0.1", daemon.port))
    health = daemon.wait_for_health(
        lambda health: health["links"]["udp"]["frames"] == SENT and health["navigation"].get("last_seq", 0) > 0
    )
    assert health["storage"]["state"] == "ok"
    assert b"<html" in daemon.page
    assert daemon.stop() == 130
    lines = [line for line in daemon.lines if "warning" in line or "error" in line]
    assert [line for line in lines if REFUSED not in line] == [
        f"warning: clock: the real-time clock is {words}; times of this session count from 2000-01-01T00:00:00Z "
        "instead; set the clock\n"
    ]
    session = next((tmp_path / "out").iterdir())
    assert session.name.startswith("clock_20000101T0000")
    findings = verify(Recording.open(session)).findings
    assert [text for text in findings if "the kernel's timestamps were refused" not in text] == []
    with next(session.glob("*_0_000.mcap")).open("rb") as file:
        messages = [(channel.topic, m.log_time, m.data) for _, channel, m in make_reader(file).iter_messages()]
    begin_ns = int(datetime(2000, 1, 1, tzinfo=UTC).timestamp()) * 10**9
    assert all(begin_ns <= log_time < begin_ns + 3600 * 10**9 for _, log_time, _ in messages)
    assert [data for topic, _, data in messages if topic == "/raw/udp"] == [b"%d" % i for i in range(SENT)]
    events = [json.loads(data) for topic, _, data in messages if topic == "/fti/event"]
    assert any(words in event["message"] for event in events)
