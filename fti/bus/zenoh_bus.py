"""Outputs, health and events on zenoh, at one explicit endpoint on loopback.

The supervisor hosts the hub, because it survives a crash of navigation and of the display; the other processes are
clients of it and reconnect by themselves, also when the hub comes back.  No scouting, no gossip: nothing leaves the
machine and nothing is found by chance.

    key        ``fti/<session name><topic>``, topics as in the files (``/nav/glide_slope``, ``/health``, ``/event``)
    liveliness ``fti/<session name>/@alive/<process>``: goes at once when a process ends, however it ends

Publishing never waits for a reader: where a queue is full, the message is dropped after at most 1 ms (congestion
control DROP).  The bus is for showing; the record is in the files.  One ``put`` costs 6 us and zenoh joins what is in
the queue into one write, so there is no batching here.
"""

from __future__ import annotations

import json
import socket
from collections.abc import Callable
from typing import Any

import zenoh

from fti.errors import MissingError

LOOPBACK = "127.0.0.1"
ALIVE = "@alive"
CONNECT_TIMEOUT_MS = 3000
PORT_ATTEMPTS = 5

Callback = Callable[[str, bytes], None]
AliveCallback = Callable[[str, bool], None]


def _config(mode: str, *, listen: str | None = None, connect: str | None = None) -> zenoh.Config:
    table: dict[str, Any] = {
        "mode": mode,
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "listen": {"endpoints": [listen] if listen else []},
        "transport": {"shared_memory": {"enabled": False}},  # pays from 1 MiB; a killed process would leave files
        "connect": {
            "endpoints": [connect] if connect else [],
            "timeout_ms": CONNECT_TIMEOUT_MS if connect else 0,
            "retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 2},
        },
    }
    return zenoh.Config.from_json5(json.dumps(table))


def _open_client(endpoint: str) -> zenoh.Session:
    try:
        return zenoh.open(_config("client", connect=endpoint))
    except zenoh.ZError:
        raise MissingError(f"no bus at {endpoint}; is the daemon running?") from None


def _free_port() -> int:
    with socket.create_server((LOOPBACK, 0)) as server:
        port: int = server.getsockname()[1]
        return port


class _Sender:
    """Publishes under one session name through a zenoh session that it owns."""

    def __init__(self, session: zenoh.Session, session_name: str) -> None:
        self._session = session
        self._prefix = f"fti/{session_name}"
        self._tokens: list[zenoh.LivelinessToken] = []

    def publish(self, topic: str, payload: bytes) -> None:
        """Send one message to whoever listens; topic begins with ``/``.  Drops when the queue is full."""
        self._session.put(self._prefix + topic, payload, congestion_control=zenoh.CongestionControl.DROP)

    def alive(self, process: str) -> None:
        """Declare this process alive, under this name, until it closes or ends in any other way."""
        self._tokens.append(self._session.liveliness().declare_token(f"{self._prefix}/{ALIVE}/{process}"))

    def close(self) -> None:
        """Leave the bus; what is queued is sent."""
        self._session.close()  # type: ignore[no-untyped-call]


class Hub(_Sender):
    """The meeting point of one daemon.  ``endpoint`` is what the clients connect to."""

    def __init__(self, session: zenoh.Session, session_name: str, port: int) -> None:
        super().__init__(session, session_name)
        self.port = port
        self.endpoint = f"tcp/{LOOPBACK}:{port}"

    @classmethod
    def open(cls, port: int, session_name: str) -> Hub:
        """Listen on a port of loopback; 0 takes a free one.  Raises MissingError when the port is in use."""
        for _ in range(PORT_ATTEMPTS):  # another program may take a free port before we do
            number = port or _free_port()
            try:
                session = zenoh.open(_config("router", listen=f"tcp/{LOOPBACK}:{number}"))
            except zenoh.ZError:
                if port:
                    break
            else:
                return cls(session, session_name, number)
        raise MissingError(f"bus.port = {port}: the port is in use on {LOOPBACK}; 0 takes a free one")


class Publisher(_Sender):
    """A process that publishes through the hub."""

    @classmethod
    def connect(cls, endpoint: str, session_name: str) -> Publisher:
        """Join the bus at the hub's endpoint.  Raises MissingError when nothing answers within 3 s."""
        return cls(_open_client(endpoint), session_name)


class Subscriber:
    """A process that listens to every topic of one session."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session

    @classmethod
    def connect(
        cls, endpoint: str, session_name: str, callback: Callback, on_alive: AliveCallback | None = None
    ) -> Subscriber:
        """Join the bus at the hub's endpoint.

        callback(topic, payload)    : called for every message, in a thread of zenoh's
        on_alive(process, is_alive) : called when a process appears or ends, and for those that are there already

        Raises MissingError when nothing answers within 3 s.
        """
        session = _open_client(endpoint)
        prefix = f"fti/{session_name}"

        def on_sample(sample: zenoh.Sample) -> None:
            callback(str(sample.key_expr)[len(prefix) :], sample.payload.to_bytes())

        session.declare_subscriber(f"{prefix}/**", on_sample)
        if on_alive is not None:
            _watch_liveliness(session, f"{prefix}/{ALIVE}/", on_alive)
        return cls(session)

    def close(self) -> None:
        """Leave the bus."""
        self._session.close()  # type: ignore[no-untyped-call]


def _watch_liveliness(session: zenoh.Session, prefix: str, on_alive: AliveCallback) -> None:
    def on_token(sample: zenoh.Sample) -> None:
        on_alive(str(sample.key_expr)[len(prefix) :], sample.kind == zenoh.SampleKind.PUT)

    session.liveliness().declare_subscriber(f"{prefix}*", on_token, history=True)
