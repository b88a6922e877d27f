"""The real publish process on a hub of the bus, as the supervisor starts it."""

from __future__ import annotations

import json
import select
import socket
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

from fti.config import Publish
from fti.messages.control import FromChild, PublishReport, Stop
from fti.messages.health import SinkHealth
from fti.messages.outputs import Event
from fti.service.control_channel import ControlChannel
from tests.bus.running_hub import DEADLINE_S, RunningHub, wait_for
from tests.helpers import fail

AIRCRAFT, SESSION = "D-TEST", "test_1"


class RunningPublisher:
    """Until ``close``, or as a context.

    events : that it has reported; sinks : its last report
    """

    def __init__(self, hub: RunningHub, publish: Publish, aircraft: str = AIRCRAFT, session: str = SESSION) -> None:
        self._hub = hub
        ours, theirs = socket.socketpair()
        where = ("--bus", str(hub.hub.path), "--session", session, "--aircraft", aircraft, "--epoch-ns", "0")
        command = [sys.executable, "-m", "fti.service.publish", *where, "--control-fd", str(theirs.fileno())]
        self.process = subprocess.Popen([*command, "--table", publish.model_dump_json()], pass_fds=[theirs.fileno()])
        theirs.close()
        self.events: list[Event] = []
        self.sinks: dict[str, SinkHealth] = {}
        self._channel = ControlChannel(ours, FromChild)
        self._thread = threading.Thread(target=self._receive)
        self._thread.start()
        hub.wait_for_subscribers(1)

    def __enter__(self) -> RunningPublisher:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _receive(self) -> None:
        while not self._channel.has_ended:
            select.select([self._channel], [], [], 0.1)
            for message in self._channel.receive(fail):
                if isinstance(message, PublishReport):
                    self.sinks = message.sinks
                elif isinstance(message, Event):
                    self.events.append(message)

    def publish(self, topic: str, **fields: Any) -> None:
        """Publish a message on the bus."""
        self._hub.hub.publish(topic, json.dumps(fields).encode())

    def publish_event(self, number: int) -> None:
        """Publish an event that has its number as text."""
        self.publish("/event", t_ns=number, level="info", source="test", text=f"event {number}")

    def wait_for_state(self, sink: str, state: str) -> None:
        """Until a sink has reported a state."""
        wait_for(lambda: sink in self.sinks and self.sinks[sink].state == state, f"{sink} {state}")

    def resident_mb(self) -> float:
        """Memory of the process [MB]."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1024

    def processor_s(self) -> float:
        """Processor time of the process so far [s]."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(") ")[2].split()
        return (int(fields[11]) + int(fields[12])) / 100

    def close(self) -> None:
        """End it as the supervisor does."""
        self._channel.send(Stop())
        try:
            assert self.process.wait(DEADLINE_S) == 0
        finally:
            self.process.kill()
            self.process.wait()
            self._thread.join()
            self._channel.close()
