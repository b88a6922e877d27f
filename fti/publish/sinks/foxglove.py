"""Live server for Foxglove on this computer, with the WebSocket server of the Foxglove SDK.

topics   as in MCAP files (``fti.publish.foxglove_topics``), and position, pose, transform and track for map and 3D
         panels (``fti.publish.foxglove_scene``)
late     an output that has not come for its maximum age is sent once more with ``late`` true and ``valid`` false
clients  no capability: they cannot publish, set parameters or call services; the SDK answers with an error.  When one
         subscribes to a topic, the newest value of the topic is sent again, but no event.
limits   a client that reads slowly loses the oldest of BACKLOG_MESSAGES messages, without a count by the SDK.  One that
         does not read the answers to its own requests is disconnected.
access   the SDK has TLS, but neither login nor a check of the origin: the server listens on loopback only
"""

from __future__ import annotations

import logging
import threading
import time
from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import foxglove as sdk
from foxglove.websocket import ChannelView, Client, ServerListener

from fti.bus.message import MessageError, decode, encode
from fti.config import FoxgloveTable
from fti.logger.schemas import Schema, encode_note, foxglove_schema
from fti.messages.outputs import NavSolution
from fti.messages.tables import from_table
from fti.messages.topics import BUS_EVENT, EVENT_TOPIC, measurement_topic
from fti.publish.foxglove_scene import PRESENT_TOPICS, SCENE_SCHEMAS, Scene
from fti.publish.foxglove_topics import fixed_topics, live_topic
from fti.publish.message import MAX_AGE_MS, PublishedMessage, SessionIdentity
from fti.publish.sink import SinkError

HOST = "127.0.0.1"
#: Of one client, values and answers each.
BACKLOG_MESSAGES = 256
NS_PER_MS, MS_PER_S = 1_000_000, 1000.0
SOLUTION = measurement_topic("nav", NavSolution)
AGE_FIELDS = frozenset({"age_ms", "max_age_ms", "late"})
#: The SDK logs each mistake of a client, as often as it makes it.
logging.getLogger("foxglove").setLevel(logging.CRITICAL + 1)


class FoxgloveSink:
    """See the module, and ``Sink``."""

    def __init__(self, table: FoxgloveTable, identity: SessionIdentity) -> None:
        self.topics: Sequence[str] = ("*",)
        self._table, self._identity = table, identity
        self._server: sdk.websocket.WebSocketServer | None = None
        self._subscribers = Subscribers()
        self._channels = LiveChannels()
        self._outputs: dict[str, _Output] = {}
        self._scene = Scene()
        self._newest_ns = 0

    def open(self) -> None:
        """See ``Sink``."""
        self._subscribers, self._channels = Subscribers(), LiveChannels()
        self._offer_fixed_topics()
        try:
            self._server = sdk.start_server(
                name=f"fti {self._identity.aircraft} {self._identity.session}",
                host=HOST,
                port=self._table.port,
                server_listener=self._subscribers,
                context=self._channels.context,
                session_id=f"{self._identity.session}/{self._identity.boot}",
                message_backlog_size=BACKLOG_MESSAGES,
            )
        except RuntimeError as error:
            raise SinkError(f"publish.foxglove.port: {HOST}:{self._table.port}: {error}") from None

    def _offer_fixed_topics(self) -> None:
        """Before clients connect: the SDK announces a new channel before it accepts subscriptions to it."""
        for topic in fixed_topics():
            self._channels.offer(topic.name, topic.schema)
        for name, schema in SCENE_SCHEMAS.items():
            self._channels.offer(name, foxglove_schema(schema))

    def send(self, messages: Sequence[PublishedMessage]) -> None:
        """See ``Sink``."""
        for message in messages:
            with suppress(MessageError):  # of another version
                self._send_one(message)
        now_s = time.monotonic()
        for topic, output in self._outputs.items():  # a panel would show the last valid value for ever
            if output.has_become_late(now_s):
                self._send_output(topic, output)
        for topic in self._subscribers.take_requested():
            self._channels.repeat(topic)

    def count_peers(self) -> int | None:
        """See ``Sink``: clients that have subscribed to a topic."""
        return self._subscribers.count()

    def close(self) -> None:
        """See ``Sink``."""
        if self._server is not None:
            self._server.stop()
            self._server = None
        self._channels.close()

    def _send_one(self, message: PublishedMessage) -> None:
        topic, live = message.topic, live_topic(message.topic)
        if live is None:
            return
        fields = decode(topic, message.payload)
        t_ns = fields.get("t_ns", self._newest_ns)
        self._newest_ns = max(self._newest_ns, t_ns)
        if topic == BUS_EVENT:
            self._channels.log(EVENT_TOPIC, live.schema, encode_note(EVENT_TOPIC, fields), t_ns, keep=False)
        elif fields.keys() >= AGE_FIELDS:
            begin_s = message.received_s - fields["age_ms"] / MS_PER_S
            output = self._outputs[topic] = _Output(fields, message.payload, t_ns, begin_s)
            output.has_become_late(time.monotonic())  # it may have waited for a connection
            self._send_output(topic, output)
        else:
            self._channels.log(live.name, live.schema, message.payload, t_ns)

    def _send_output(self, topic: str, output: _Output) -> None:
        live = live_topic(topic)
        assert live is not None
        self._channels.log(live.name, live.schema, output.payload, output.log_ns)
        if topic == SOLUTION:
            self._send_scene(output)

    def _send_scene(self, output: _Output) -> None:
        known = {name: value for name, value in output.fields.items() if name not in AGE_FIELDS}
        sent = dict(self._scene.messages(from_table(NavSolution, known)))
        for topic, content in sent.items():
            self._channels.log(topic, foxglove_schema(SCENE_SCHEMAS[topic]), encode(content), output.log_ns)
        for topic in PRESENT_TOPICS:
            if topic not in sent:
                self._channels.forget(topic)


@dataclass(slots=True)
class _Output:
    """The newest message of an output.

    log_ns : its time; since it is late, the time at which it became so;  begin_s : its time (``time.monotonic``) [s]
    """

    fields: dict[str, Any]
    payload: bytes
    log_ns: int
    begin_s: float

    def has_become_late(self, now_s: float) -> bool:
        """Is it late at now_s [s], and was it not before?  Then its fields state that, and it is not valid."""
        age_ms = min((now_s - self.begin_s) * MS_PER_S, MAX_AGE_MS)
        if self.fields["late"] or age_ms <= self.fields["max_age_ms"]:
            return False
        self.fields.update(age_ms=round(age_ms, 3), late=True, valid=False)
        self.payload = encode(self.fields)
        self.log_ns += round(age_ms * NS_PER_MS)
        return True


class LiveChannels:
    """The channels of one server, and the newest message of each."""

    def __init__(self) -> None:
        self.context = sdk.Context()
        self._channels: dict[str, sdk.Channel] = {}
        self._newest: dict[str, tuple[bytes, int]] = {}

    def log(self, topic: str, schema: Schema, payload: bytes, t_ns: int, *, keep: bool = True) -> None:
        """Send a message to the subscribers of a topic; keep : for those who subscribe later."""
        self.offer(topic, schema).log(payload, log_time=t_ns)
        if keep:
            self._newest[topic] = payload, t_ns

    def offer(self, topic: str, schema: Schema) -> sdk.Channel:
        """The channel of a topic, to which clients can subscribe from now on."""
        if topic not in self._channels:
            known = sdk.Schema(name=schema.name, encoding=schema.encoding, data=schema.data)
            channel = sdk.Channel(topic, schema=known, message_encoding="json", context=self.context)
            self._channels[topic] = channel
        return self._channels[topic]

    def repeat(self, topic: str) -> None:
        """Send the newest message of a topic again."""
        if topic in self._newest:
            payload, t_ns = self._newest[topic]
            self._channels[topic].log(payload, log_time=t_ns)

    def forget(self, topic: str) -> None:
        """Send the newest message of a topic to no later subscriber."""
        self._newest.pop(topic, None)

    def close(self) -> None:
        """End all channels."""
        for channel in self._channels.values():
            channel.close()


class Subscribers(ServerListener):
    """Which clients have subscribed to which topics; threads of the SDK call its methods."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._topics_of: dict[int, set[str]] = defaultdict(set)
        self._requested: set[str] = set()

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """A client has subscribed to a topic."""
        with self._lock:
            self._topics_of[client.id].add(channel.topic)
            self._requested.add(channel.topic)

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        """A client has unsubscribed or disconnected."""
        with self._lock:
            self._topics_of[client.id].discard(channel.topic)
            if not self._topics_of[client.id]:
                del self._topics_of[client.id]

    def take_requested(self) -> set[str]:
        """Topics to which a client has subscribed since the last call."""
        with self._lock:
            requested, self._requested = self._requested, set()
        return requested

    def count(self) -> int:
        """Number of clients with a subscription."""
        return len(self._topics_of)
