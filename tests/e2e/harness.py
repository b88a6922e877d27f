"""Real daemons for the end-to-end tests: started as a user starts them, fed through real ptys and sockets."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import re
import signal
import socket
import subprocess
import sys
import time
import tty
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fti.bus.client import Subscriber
from fti.bus.frame import SOCKET_NAME
from tests.helpers import until
from tests.processes import children_of

FTI = [sys.executable, "-m", "fti.cli.main"]
#: Nobody waits as long on a free machine; the checks run on busy ones, and a wait that is met costs nothing.
START_S = 120.0
END_S = 120.0


def free_udp_port() -> int:
    """A port of loopback on which nobody listens."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        port: int = sock.getsockname()[1]
        return port


def with_free_ports(text: str) -> str:
    """A configuration with every port that it binds on loopback replaced by a free one."""
    return re.sub(r'(bind = "127\.0\.0\.1):\d+"', lambda m: f'{m[1]}:{free_udp_port()}"', text)


class Line:
    """The far end of a serial line: a pty with a stable name."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        draft = path.with_suffix(".new")
        draft.symlink_to(os.ttyname(self._slave))
        draft.replace(path)
        os.set_blocking(self._master, False)

    def write(self, data: bytes) -> None:
        """Send, waiting while the other side does not read."""
        view = memoryview(data)
        while view:
            try:
                view = view[os.write(self._master, view) :]
            except BlockingIOError:
                time.sleep(0.001)

    def read(self) -> bytes:
        """What the daemon has sent."""
        try:
            return os.read(self._master, 65536)
        except BlockingIOError:
            return b""

    def close(self) -> None:
        """Pull the plug."""
        os.close(self._master)
        os.close(self._slave)


@dataclass(slots=True)
class Daemon:
    """A running ``fti run`` (or another command that runs a daemon)."""

    process: subprocess.Popen[str]
    run_dir: Path
    lines: list[str] = field(default_factory=list)

    @property
    def info(self) -> dict[str, Any]:
        """What ``fti.json`` says; waits until the daemon records."""
        path = self.run_dir / "fti.json"
        until(lambda: path.exists() or self.process.poll() is not None, START_S, "fti.json")
        assert path.exists(), f"the daemon ended with {self.process.returncode}"
        content: dict[str, Any] = json.loads(path.read_text())
        return content

    @property
    def session(self) -> Path:
        """The session folder."""
        return Path(self.info["session"])

    @property
    def display(self) -> str:
        """Address of the page, once it is served."""
        return str(until(lambda: self.info["display"], START_S, "the display"))

    @property
    def page(self) -> str:
        """The same with the owner's key."""
        return str(until(lambda: self.info["page"], START_S, "the display"))

    def watch(self) -> dict[str, Any]:
        """What ``fti watch --once --json`` says now."""
        done = subprocess.run(
            [*FTI, "watch", "--once", "--json", "--run-dir", str(self.run_dir)],
            capture_output=True,
            text=True,
            timeout=START_S,
            check=True,
        )
        content: dict[str, Any] = json.loads(done.stdout)
        return content

    def health(self) -> dict[str, Any]:
        """The next health that the daemon publishes on the bus."""
        messages = queue.SimpleQueue[bytes]()

        def on_message(topic: str, payload: bytes, sent_ns: int) -> None:
            if topic == "/health":
                messages.put(payload)

        subscriber = Subscriber(Path(self.info["sock"]).with_name(SOCKET_NAME), "test", on_message)
        try:
            content: dict[str, Any] = json.loads(messages.get(timeout=START_S))
        finally:
            subscriber.close()
        return content

    def pid_of(self, process: str) -> int:
        """Process number of recorder, navigation or display."""
        pid = until(lambda: self._running_pid(process), START_S, f"{process} running")
        assert pid
        return pid

    def _running_pid(self, process: str) -> int | None:
        known = (self.health().get("processes") or {}).get(process, {})
        return known.get("pid") if known.get("state") == "running" else None

    def stop(self, number: int = signal.SIGINT) -> int:
        """End it in good order; returns the exit code."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.wait()

    def wait(self) -> int:
        """Wait for its end."""
        out, _ = self.process.communicate(timeout=END_S)
        self.lines = out.splitlines()
        return self.process.returncode

    def kill_all(self) -> None:
        """A power cut: the supervisor and its children at once."""
        for pid in [*children_of(self.process.pid), self.process.pid]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.wait()


@contextlib.contextmanager
def daemon(config: Path, out: Path, *arguments: str, command: str = "run") -> Iterator[Daemon]:
    """A daemon on a configuration, recording below ``out``; ended at the latest when the block ends."""
    run_dir = out / f"run_{time.monotonic_ns()}"
    out.mkdir(parents=True, exist_ok=True)
    process = subprocess.Popen(
        [*FTI, command, str(config), "--out", str(out), "--run-dir", str(run_dir), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    running = Daemon(process, run_dir)
    try:
        yield running
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
            try:
                running.wait()
            except subprocess.TimeoutExpired:
                running.kill_all()
        if process.stdout:
            process.stdout.close()


def fti(*arguments: str, timeout: float = 120.0) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run([*FTI, *arguments], capture_output=True, text=True, timeout=timeout, check=False)
