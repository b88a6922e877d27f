"""Outputs, health and events for zenoh clients, read-only, at one explicit endpoint on loopback.

    key        ``fti/<session name><topic>``, topics as in the files (``/nav/glide_slope``, ``/health``, ``/event``)
    liveliness ``fti/<session name>/@alive/<process>``: removed when a process ends

This session subscribes to nothing, and its access control rejects messages of clients, so that clients cannot send to
each other.  Scouting and gossip are off: nothing leaves the machine.  Publishing never blocks: with a full queue the
message is dropped (congestion control DROP).
"""

from __future__ import annotations

import json
from typing import Any

import zenoh

from fti.bus.loopback import LOOPBACK, describe_endpoint
from fti.errors import MissingError

ALIVE = "@alive"
#: Key expressions of the access rules; "**" does not match a chunk that begins with "@".
KEYS = ["**", f"**/{ALIVE}/**"]
#: Messages that a client may send and receive; all others are denied.
INGRESS_MESSAGES = ["declare_subscriber", "declare_liveliness_subscriber", "liveliness_query"]
EGRESS_MESSAGES = ["put", "delete", "liveliness_token"]


def make_config(port: int) -> zenoh.Config:
    """Configuration of a router for read-only clients of this machine."""
    table: dict[str, Any] = {
        "mode": "router",
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "listen": {"endpoints": [describe_endpoint(port)]},
        "transport": {"shared_memory": {"enabled": False}},  # pays from 1 MiB; a killed process would leave files
        "connect": {"endpoints": [], "timeout_ms": 0},
        "access_control": {
            "enabled": True,
            "default_permission": "deny",
            "rules": [
                _allow("ask", "ingress", INGRESS_MESSAGES),
                _allow("answer", "egress", EGRESS_MESSAGES),
            ],
            "subjects": [{"id": "everybody"}],
            "policies": [{"rules": ["ask", "answer"], "subjects": ["everybody"]}],
        },
    }
    return zenoh.Config.from_json5(json.dumps(table))


def _allow(name: str, flow: str, messages: list[str]) -> dict[str, Any]:
    return {"id": name, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": KEYS}


class ZenohEndpoint:
    """Publishes under one session name.  ``endpoint`` : address for clients"""

    def __init__(self, session: zenoh.Session, session_name: str, port: int) -> None:
        self._session = session
        self._prefix = f"fti/{session_name}"
        self._tokens: dict[str, zenoh.LivelinessToken] = {}
        self.endpoint = describe_endpoint(port)

    @classmethod
    def open(cls, port: int, session_name: str) -> ZenohEndpoint:
        """Listen on a port of loopback.  Raises MissingError when zenoh cannot."""
        try:
            return cls(zenoh.open(make_config(port)), session_name, port)
        except zenoh.ZError as error:
            raise MissingError(f"bus.port = {port}: zenoh cannot listen on {LOOPBACK}: {error}") from None

    def publish(self, topic: str, payload: bytes) -> None:
        """Send a message; topic begins with ``/``.  It is dropped when the queue is full."""
        self._session.put(self._prefix + topic, payload, congestion_control=zenoh.CongestionControl.DROP)

    def set_alive(self, process: str, is_alive: bool) -> None:
        """Declare that a process is alive, or has ended."""
        if is_alive and process not in self._tokens:
            self._tokens[process] = self._session.liveliness().declare_token(f"{self._prefix}/{ALIVE}/{process}")
        elif not is_alive and process in self._tokens:
            self._tokens.pop(process).undeclare()  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """Send queued messages and close the session."""
        self._session.close()  # type: ignore[no-untyped-call]
