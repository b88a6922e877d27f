"""Outputs as JSON to an MQTT broker.

topic    ``fti/<aircraft>/<session>/nav/glide_slope``: topics of the bus; payload as there, with ``boot`` and ``number``
         in front.  ``number`` counts the messages of a topic from 1; ``boot`` changes when it begins again.
values   QoS 0, retained: a client that connects gets the newest value of each topic at once
events   QoS 1, not retained: each is sent until the broker has acknowledged it, possibly twice with one ``number``
state    ``fti/<aircraft>/<session>/state``, retained: ``{"boot", "number", "state"}``.  ``online`` after each
         connection, with the number of the attempt to connect.  The last will has the same number and state ``lost``:
         a client ignores it if it has seen a higher number of that boot, because a broker may deliver it after the
         next ``online``.  ``ended`` at a regular end.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Coroutine, Sequence
from contextlib import suppress
from typing import Any

import aiomqtt
import orjson

from fti.config import MqttTable
from fti.messages.topics import BUS_EVENT
from fti.publish.files import make_tls_context, read_password
from fti.publish.message import PublishedMessage, SessionIdentity
from fti.publish.sink import SinkError

#: Limit of one answer of the broker [s]; at the end.
TIMEOUT_S, END_TIMEOUT_S = 5.0, 1.0
#: Number of messages that wait for the socket, or for an acknowledgement, at the same time.
MAX_PENDING = 10
#: The broker publishes the last will when it has received nothing for 1.5 times this [s].
KEEP_ALIVE_S = 10
#: aiomqtt logs each message that a broker sends without a subscription.
SILENT = logging.getLogger(__name__)
SILENT.disabled = True
#: Time in which the connection is served in each call of ``send`` [s].
SERVE_S = 0.001


class MqttSink:
    """See the module, and ``Sink``."""

    def __init__(self, table: MqttTable, identity: SessionIdentity) -> None:
        self.topics: Sequence[str] = table.topics
        self._table, self._identity = table, identity
        self._prefix = f"fti/{identity.aircraft}/{identity.session}"
        self._runner: asyncio.Runner | None = None
        self._client: aiomqtt.Client | None = None
        self._connects = 0

    def open(self) -> None:
        """See ``Sink``."""
        self._connects += 1
        self._runner = asyncio.Runner()
        self._run(self._connect())

    def send(self, messages: Sequence[PublishedMessage]) -> None:
        """See ``Sink``."""
        self._run(self._publish(messages))

    def count_peers(self) -> int | None:
        """See ``Sink``: the broker does not report its clients."""
        return None

    def close(self) -> None:
        """See ``Sink``."""
        if self._runner is None:
            return
        with suppress(SinkError):
            self._run(self._disconnect())
        self._runner.close()
        self._runner = None

    def _run(self, coroutine: Coroutine[Any, Any, None]) -> None:
        assert self._runner is not None
        try:
            self._runner.run(coroutine)
        except aiomqtt.MqttError as error:
            raise SinkError(f"publish.mqtt: {self._table.host}:{self._table.broker_port}: {error}") from None

    async def _connect(self) -> None:
        table, password = self._table, None
        if table.password_file:
            password = read_password(table.password_file, "publish.mqtt.password_file")
        client = aiomqtt.Client(
            table.host,
            table.broker_port,
            username=table.user,
            password=password,
            identifier=f"fti-{self._identity.aircraft}-{self._identity.boot}",
            will=aiomqtt.Will(f"{self._prefix}/state", self._state("lost"), qos=1, retain=True),
            keepalive=KEEP_ALIVE_S,
            timeout=TIMEOUT_S,
            max_concurrent_outgoing_calls=MAX_PENDING,
            max_queued_incoming_messages=1,
            logger=SILENT,
            tls_context=make_tls_context(table, "publish.mqtt") if table.tls else None,
        )
        await client.__aenter__()
        self._client = client
        await self._publish_state(client, "online")

    async def _publish(self, messages: Sequence[PublishedMessage]) -> None:
        assert self._client is not None
        await asyncio.gather(*(self._publish_one(self._client, message) for message in messages))
        try:  # nothing is subscribed: no message comes, but the end of the connection
            await asyncio.wait_for(anext(self._client.messages), SERVE_S)
        except TimeoutError:
            return
        except aiomqtt.MqttError as error:
            raise aiomqtt.MqttError(f"the connection has ended: {error.__cause__}") from None

    async def _publish_one(self, client: aiomqtt.Client, message: PublishedMessage) -> None:
        is_event = message.topic == BUS_EVENT
        payload = message.numbered_json(self._identity.boot, time.monotonic())
        await client.publish(self._prefix + message.topic, payload, qos=int(is_event), retain=not is_event)

    async def _publish_state(self, client: aiomqtt.Client, state: str) -> None:
        await client.publish(f"{self._prefix}/state", self._state(state), qos=1, retain=True)

    def _state(self, state: str) -> bytes:
        return orjson.dumps({"boot": self._identity.boot, "number": self._connects, "state": state})

    async def _disconnect(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.timeout = END_TIMEOUT_S
            with suppress(aiomqtt.MqttError):
                await self._publish_state(client, "ended")
            await client.__aexit__(None, None, None)
