"""A zenoh router as a process of its own, and a client of it; the router may run in a network namespace.

``python -m tests.publish.zenoh_router CONFIG``: a session in router mode until the end of its input.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from typing import Any

import zenoh

from tests.helpers import ROOT

NO_SCOUTING = {"multicast": {"enabled": False}, "gossip": {"enabled": False}}


class Router:
    """endpoint : of it;  prefix : command before the interpreter;  config : the whole configuration, in JSON5;
    more : further tables of it"""

    def __init__(self, endpoint: str, prefix: Sequence[str] = (), config: str = "", **more: Any) -> None:
        self.endpoint = endpoint
        table = {"mode": "router", "scouting": NO_SCOUTING, "listen": {"endpoints": [endpoint]}, **more}
        config = config or json.dumps(table)
        self._command = [*prefix, sys.executable, "-m", "tests.publish.zenoh_router", config]
        self.start()

    def start(self) -> None:
        """Start it, and wait until it listens."""
        self._process = subprocess.Popen(
            self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT
        )
        assert self._process.stdout
        assert self._process.stdout.readline() == "listening\n"

    def kill(self) -> None:
        """Kill it."""
        self._process.kill()
        self._process.communicate()

    def pause(self) -> None:
        """Stop it; its connections stay open."""
        self._process.send_signal(signal.SIGSTOP)

    def resume(self) -> None:
        """Continue after ``pause``."""
        self._process.send_signal(signal.SIGCONT)


class ZenohReader:
    """A plain zenoh client.  messages : all that it has received below ``fti``;  alive : liveliness tokens"""

    def __init__(self, endpoint: str, **transport: Any) -> None:
        connect = {"endpoints": [endpoint], "timeout_ms": 20_000}
        table = {"mode": "client", "scouting": NO_SCOUTING, "connect": connect, "transport": transport}
        self.session = zenoh.open(zenoh.Config.from_json5(json.dumps(table)))
        self.messages: list[tuple[str, dict[str, Any]]] = []
        self.alive: dict[str, bool] = {}
        self._lock = threading.Lock()
        self.session.declare_subscriber("fti/**", self._on_sample)
        self.session.liveliness().declare_subscriber("fti/*/*/@alive/*", self._on_alive, history=True)

    def _on_sample(self, sample: zenoh.Sample) -> None:
        with self._lock:
            self.messages.append((str(sample.key_expr), json.loads(sample.payload.to_bytes())))

    def _on_alive(self, sample: zenoh.Sample) -> None:
        self.alive[str(sample.key_expr)] = sample.kind == zenoh.SampleKind.PUT

    def of(self, ending: str) -> list[dict[str, Any]]:
        """Contents of the messages whose key has an ending."""
        with self._lock:
            return [fields for key, fields in self.messages if key.endswith(ending)]

    def get(self, selector: str) -> dict[str, dict[str, Any]]:
        """Answers to a query by their keys."""
        answers = {}
        for reply in self.session.get(selector, timeout=10.0):
            if reply.ok is not None:
                answers[str(reply.ok.key_expr)] = json.loads(reply.ok.payload.to_bytes())
        return answers

    def close(self) -> None:
        """Disconnect."""
        self.session.close()  # type: ignore[no-untyped-call]


def main(config: str) -> None:
    """See the module."""
    with zenoh.open(zenoh.Config.from_json5(config)):
        print("listening", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main(sys.argv[1])
