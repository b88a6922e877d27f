"""Joins the bus and what displays show: for the display process and for ``fti watch``."""

from __future__ import annotations

from fti.bus.message import decode
from fti.bus.zenoh_bus import Subscriber
from fti.clock import Clock
from fti.web.feed import Feed


def listen(feed: Feed, endpoint: str, session: str, clock: Clock) -> Subscriber:
    """Let the feed hear the bus until the subscriber is closed.  Raises MissingError when there is no bus."""

    def take(topic: str, payload: bytes) -> None:
        fields = decode(payload)
        if fields is not None:
            feed.take(topic, fields, clock.now_ns())

    return Subscriber.connect(endpoint, session, take, feed.take_alive)
