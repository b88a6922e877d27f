"""Outputs to a zenoh router, usually on the ground.

key        ``fti/<aircraft>/<session>/nav/glide_slope``: topics of the bus; payload as there, with ``boot`` and
           ``number``
events     ``fti/<aircraft>/<session>/event``.  With a full queue zenoh drops messages (congestion control DROP; BLOCK
           would stall this sink while one receiver is slow).  ``number`` shows a loss.
queries    ``get`` of a key, or of a pattern such as ``fti/**``: the newest message of each topic.
           ``get`` of ``.../event/*?from=12;to=20``: events by their numbers, keys ``.../event/12``; without ``to`` all
           that are kept, 4096 at most
liveliness ``fti/<aircraft>/<session>/@alive/publish``

It is a client of one router and never listens.  It subscribes to nothing.
"""

from __future__ import annotations

import json
import re
import sys
import threading
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import zenoh

from fti.clock import describe_wrong_time
from fti.config import ZenohTable
from fti.messages.topics import BUS_EVENT
from fti.publish.files import read_password
from fti.publish.message import PublishedMessage, SessionIdentity
from fti.publish.query_budget import QueryBudget
from fti.publish.sink import SinkError
from fti.publish.sink_queue import MAX_EVENTS

ALIVE = "@alive/publish"
CONNECT_TIMEOUT_MS = 5000


class ZenohSink:
    """See the module, and ``Sink``."""

    def __init__(self, table: ZenohTable, identity: SessionIdentity) -> None:
        self.topics: Sequence[str] = table.topics
        self._table, self._boot = table, identity.boot
        self._prefix = f"fti/{identity.aircraft}/{identity.session}"
        self._session: zenoh.Session | None = None
        self._kept = KeptMessages()
        self._budget = QueryBudget()

    def open(self) -> None:
        """See ``Sink``."""
        if fault := describe_wrong_time():
            raise SinkError(f"publish.zenoh: needs a real-time clock between 1970 and 2106: {fault}")
        try:
            self._session = zenoh.open(zenoh.Config.from_json5(json.dumps(make_config(self._table))))
            self._token = self._session.liveliness().declare_token(f"{self._prefix}/{ALIVE}")
            self._queryable = self._session.declare_queryable(f"{self._prefix}/**", self._answer)
        except zenoh.ZError as error:
            raise SinkError(f"publish.zenoh: {self._table.connect}: {describe_error(error)}") from None

    def send(self, messages: Sequence[PublishedMessage]) -> None:
        """See ``Sink``."""
        assert self._session is not None
        if not self._session.info.routers_zid():
            raise SinkError(f"publish.zenoh: {self._table.connect}: the router has ended the connection")
        now_s = time.monotonic()
        for message in messages:
            payload = message.numbered_json(self._boot, now_s)
            self._kept.add(message)
            is_event = message.topic == BUS_EVENT
            self._session.put(
                self._prefix + message.topic,
                payload,
                encoding=zenoh.Encoding.APPLICATION_JSON,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.INTERACTIVE_HIGH if is_event else zenoh.Priority.DATA,
            )

    def _answer(self, query: zenoh.Query) -> None:
        """Answer a query with what its key expression matches; called by a thread of zenoh."""
        with query, suppress(zenoh.ZError):
            if not self._budget.take():
                query.reply_err(b"too many queries")
                return
            first, last = (_number(query.parameters.get(name)) for name in ("from", "to"))
            now_s = time.monotonic()
            for topic, message in self._kept.select(first, last):
                key = zenoh.KeyExpr(self._prefix + topic)
                if query.key_expr.intersects(key):
                    payload = message.numbered_json(self._boot, now_s)
                    query.reply(key, payload, encoding=zenoh.Encoding.APPLICATION_JSON)

    def count_peers(self) -> int | None:
        """See ``Sink``: the number of routers."""
        session = self._session
        return len(session.info.routers_zid()) if session else 0

    def close(self) -> None:
        """See ``Sink``."""
        session, self._session = self._session, None
        if session is not None:
            with suppress(zenoh.ZError):
                session.close()  # type: ignore[no-untyped-call]


class KeptMessages:
    """The newest message of each topic, and the newest events, for queries; used by several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._values: dict[str, PublishedMessage] = {}
        self._events: deque[PublishedMessage] = deque(maxlen=MAX_EVENTS)

    def add(self, message: PublishedMessage) -> None:
        """Keep a message; an event that is sent again is kept once."""
        with self._lock:
            self._values[message.topic] = message
            is_new = not self._events or message.number > self._events[-1].number
            if message.topic == BUS_EVENT and is_new:
                self._events.append(message)

    def select(self, first: int | None, last: int | None) -> list[tuple[str, PublishedMessage]]:
        """Topics and messages: the newest ones, then the events with numbers from ``first`` to ``last``.

        The topic of an event has its number appended.  Without ``first`` no events, without ``last`` all newer ones.
        """
        with self._lock:
            values, events = [*self._values.items()], [*self._events]
        if first is None:
            return values
        is_wanted = range(first, sys.maxsize if last is None else last + 1)
        return values + [(f"{BUS_EVENT}/{event.number}", event) for event in events if event.number in is_wanted]


def _number(text: str | None) -> int | None:
    """A parameter of a query; None if it is not a number."""
    return int(text) if text and re.fullmatch("[0-9]{1,18}", text) else None


def describe_error(error: zenoh.ZError) -> str:
    """What is wrong, without the lines of zenoh's source that have found it."""
    return re.sub(r" at \S+\.rs:\d+\.?", "", str(error))


def make_config(table: ZenohTable) -> dict[str, Any]:
    """Configuration of a client of one router: no scouting, no listener, no messages of other clients.

    Raises SinkError when the password file is unusable.
    """
    config: dict[str, Any] = {
        "mode": "client",
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "connect": {"endpoints": [table.connect], "timeout_ms": CONNECT_TIMEOUT_MS, "exit_on_failure": True},
        "transport": {
            "shared_memory": {"enabled": False},
            "link": {"tls": {"root_ca_certificate": table.ca_file, "verify_name_on_connect": True}},
        },
    }
    if table.certificate:
        config["transport"]["link"]["tls"] |= {
            "enable_mtls": True,
            "connect_certificate": table.certificate,
            "connect_private_key": table.private_key,
        }
    if table.user:
        assert table.password_file is not None
        password = read_password(table.password_file, "publish.zenoh.password_file")
        config["transport"]["auth"] = {"usrpwd": {"user": table.user, "password": password}}
    return config
