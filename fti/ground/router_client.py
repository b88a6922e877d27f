"""A zenoh client that feeds a fleet from a router: messages, newest values, liveliness, missing events."""

from __future__ import annotations

import json
import queue
import threading
from contextlib import suppress

import zenoh

from fti.clock import Clock
from fti.config import ZenohTable
from fti.errors import MissingError
from fti.ground.fleet import Fleet, MissingEvents
from fti.publish.sink import SinkError
from fti.publish.sinks.zenoh import describe_error, make_config

#: Pattern of the keys of all aircraft, and of their liveliness.
KEYS, ALIVE_KEYS = "fti/**", "fti/*/*/@alive/*"
QUERY_TIMEOUT_S = 5.0
#: Requests for missing events that may wait.
MAX_REQUESTS = 64


class RouterClient:
    """Feeds the fleet until ``close``.

    table : endpoint of the router, and login;  clock : CLOCK_MONOTONIC
    Raises MissingError when the router cannot be reached, or refuses.
    """

    def __init__(self, table: ZenohTable, fleet: Fleet, clock: Clock) -> None:
        self._fleet, self._clock = fleet, clock
        self._requests: queue.Queue[str | None] = queue.Queue(MAX_REQUESTS)
        try:
            self._session = zenoh.open(zenoh.Config.from_json5(json.dumps(make_config(table))))
            self._session.declare_subscriber(KEYS, self._on_sample)
            self._session.liveliness().declare_subscriber(ALIVE_KEYS, self._on_alive, history=True)
        except zenoh.ZError as error:
            raise MissingError(f"{table.connect}: {describe_error(error)}") from None
        except SinkError as error:
            raise MissingError(f"{table.connect}: {error}") from None
        self._thread = threading.Thread(target=self._query, name="fti-ground-queries", daemon=True)
        self._thread.start()

    def _on_sample(self, sample: zenoh.Sample) -> None:
        missing = self._fleet.update(str(sample.key_expr), sample.payload.to_bytes(), self._clock.now_ns())
        if missing:
            self._request(missing)

    def _on_alive(self, sample: zenoh.Sample) -> None:
        is_alive = sample.kind == zenoh.SampleKind.PUT
        key = str(sample.key_expr)
        self._fleet.set_alive(key, is_alive)
        if is_alive:
            with suppress(queue.Full):
                self._requests.put_nowait(f"{key.partition('/@')[0]}/**")

    def _request(self, missing: MissingEvents) -> None:
        with suppress(queue.Full):  # the display shows the newest events only
            prefix = f"fti/{missing.aircraft}/{missing.session}/event"
            self._requests.put_nowait(f"{prefix}/*?from={missing.first};to={missing.last}")

    def _query(self) -> None:
        """Send the requests; a callback of zenoh must not wait for answers."""
        while (selector := self._requests.get()) is not None:
            with suppress(zenoh.ZError):
                for reply in self._session.get(selector, timeout=QUERY_TIMEOUT_S):
                    if reply.ok is not None:
                        self._on_sample(reply.ok)

    def close(self) -> None:
        """Disconnect."""
        with suppress(queue.Full):
            self._requests.put_nowait(None)
        with suppress(zenoh.ZError):
            self._session.close()  # type: ignore[no-untyped-call]
        self._thread.join(QUERY_TIMEOUT_S)
