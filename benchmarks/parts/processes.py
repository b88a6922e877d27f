"""Processes of benchmarks: the recorder alone, a plain reader, the generator."""

from __future__ import annotations

import contextlib
import json
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from fti.buffers.ring import Ring, ring_size
from fti.clock import choose_epoch_ns
from fti.config import Config, Link, RecorderTuning, Session, UdpLink
from fti.logger.session import SessionFolder
from fti.messages.control import RecorderReport, Stop
from fti.service.children import Child
from fti.service.startup import RecorderStartup

ROOT = Path(__file__).resolve().parent.parent.parent
READY_S = 30.0
POLL_S = 0.01


def udp_links(count: int) -> list[UdpLink]:
    """Links ``udp00``, ... on free ports of loopback."""
    with contextlib.ExitStack() as stack:
        found = []
        for i in range(count):
            sock = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            sock.bind(("127.0.0.1", 0))
            bind = f"127.0.0.1:{sock.getsockname()[1]}"
            found.append(UdpLink(name=f"udp{i:02}", kind="udp", bind=bind))
    return found


def port_of(link: UdpLink) -> int:
    """The port that a link is bound to."""
    return int(link.bind.rpartition(":")[2])


class RecorderRig:
    """A recorder process with its ring and session, as the supervisor starts it; nobody reads the ring."""

    def __init__(self, folder: Path, links: Sequence[Link], *, freeze_gc: bool = False) -> None:
        self.epoch_ns = choose_epoch_ns()
        self.session = SessionFolder.create(folder, "bench", 0)
        self.ring = Ring.create(ring_size(links))
        session = Session(name="bench")
        order = RecorderStartup(
            config=Config(session=session, link=tuple(links), recorder=RecorderTuning(freeze_gc=freeze_gc)),
            folder=str(self.session.path),
            epoch_ns=self.epoch_ns,
            sending={},
            attachments={},
            metadata={},
        )
        self._child = Child("recorder", order.model_dump_json().encode(), self.ring.fds)
        self._channel = self._child.start()
        self.health: RecorderReport | None = None
        self._wait(lambda: self.health and all(link.connects for link in self.health.links.values()))

    @property
    def pid(self) -> int:
        """Process number of the recorder."""
        assert self._child.pid
        return self._child.pid

    def listen(self) -> None:
        """Read the messages of the recorder, so that its queue stays empty."""
        for message in self._channel.receive(print):
            self.health = message if isinstance(message, RecorderReport) else self.health

    def _wait(self, condition: Any) -> None:
        deadline = time.monotonic() + READY_S
        while not condition():
            if time.monotonic() > deadline:
                raise TimeoutError(f"the recorder did not become ready; its last health: {self.health}")
            time.sleep(POLL_S)
            self.listen()

    def close(self) -> None:
        """End the recorder; all data are in the file afterwards."""
        self._channel.send(Stop())
        process = self._child.process
        while process and process.poll() is None:
            time.sleep(POLL_S)
            self.listen()
        self.listen()
        self._child.dismiss()
        self.ring.close()


def part(name: str, *arguments: object, **options: Any) -> subprocess.Popen[str]:
    """A process of ``benchmarks.parts``."""
    command = [sys.executable, "-m", f"benchmarks.parts.{name}", *map(str, arguments)]
    return subprocess.Popen(command, cwd=ROOT, text=True, **options)


@contextlib.contextmanager
def plain_reader(file: Path, ports: int, *arguments: str) -> Iterator[tuple[int, list[int]]]:
    """A plain reader; its process number and its ports."""
    pipe = subprocess.PIPE
    with part("plain_reader", file, ports, *arguments, stdin=pipe, stdout=pipe) as process:
        assert process.stdin and process.stdout
        try:
            yield process.pid, json.loads(process.stdout.readline())
        finally:
            process.stdin.close()


def start_generator(ports: Sequence[int], rate: float, seconds: float) -> subprocess.Popen[str]:
    """A generator process; its output has the numbers of sent datagrams."""
    return part("generator", "--rate", rate, "--seconds", seconds, *ports, stdout=subprocess.PIPE)
