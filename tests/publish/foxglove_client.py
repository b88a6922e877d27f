"""A client of Foxglove's WebSocket protocol, written from its specification.

https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md, with the subprotocol of today's servers.  Started as a
program it subscribes to everything and prints a line for each message.
"""

from __future__ import annotations

import asyncio
import json
import struct
import sys
from typing import Any, NamedTuple

import aiohttp

SUBPROTOCOL = "foxglove.sdk.v1"
MESSAGE_DATA = 1
#: Opcode, id of the subscription, log time [ns].
HEAD = struct.Struct("<BIQ")
RETRY_S = 0.05
CLIENT_MESSAGE_HEAD = struct.Struct("<BI")

Json = dict[str, Any]


class Message(NamedTuple):
    """A message of a topic."""

    topic: str
    log_ns: int
    content: Json


class FoxgloveClient:
    """A connection.  Everything that arrives is kept: ``info``, ``channels`` by topic, ``messages``, ``statuses``."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self._socket = socket
        self.info: Json = {}
        self.channels: dict[str, Json] = {}
        self.messages: list[Message] = []
        self.statuses: list[Json] = []
        self._topics: dict[int, str] = {}

    @property
    def has_ended(self) -> bool:
        """Has the server closed the connection?"""
        return self._socket.closed

    def newest(self, topic: str) -> Message | None:
        """The last message of a topic."""
        return next((message for message in reversed(self.messages) if message.topic == topic), None)

    def of(self, topic: str) -> list[Message]:
        """All messages of a topic."""
        return [message for message in self.messages if message.topic == topic]

    async def send(self, **message: Any) -> None:
        """Send a JSON message."""
        await self._socket.send_str(json.dumps(message))

    async def publish(self, channel: int, data: bytes) -> None:
        """Send a message of a channel of the client, which a server that only publishes must refuse."""
        await self._socket.send_bytes(CLIENT_MESSAGE_HEAD.pack(MESSAGE_DATA, channel) + data)

    async def run(self) -> None:
        """Receive until the end, and subscribe to every channel."""
        async for frame in self._socket:
            if frame.type == aiohttp.WSMsgType.TEXT:
                await self._take(json.loads(frame.data))
            elif frame.type == aiohttp.WSMsgType.BINARY and frame.data[0] == MESSAGE_DATA:
                _, subscription, log_ns = HEAD.unpack_from(frame.data)
                content = json.loads(frame.data[HEAD.size :])
                self.messages.append(Message(self._topics[subscription], log_ns, content))

    async def _take(self, message: Json) -> None:
        if message["op"] == "serverInfo":
            self.info = message
        elif message["op"] == "status":
            self.statuses.append(message)
            await self._subscribe_again(message["message"])
        elif message["op"] == "advertise":
            for channel in message["channels"]:
                self.channels[channel["topic"]] = channel
                self._topics[channel["id"]] = channel["topic"]
            wanted = [{"id": channel["id"], "channelId": channel["id"]} for channel in message["channels"]]
            await self.send(op="subscribe", subscriptions=wanted)

    async def _subscribe_again(self, text: str) -> None:
        """The SDK advertises a channel before it accepts a subscription to it."""
        if (channel := text.removeprefix("Unknown channel ID: ")) in map(str, self._topics):
            await asyncio.sleep(RETRY_S)
            await self.send(op="subscribe", subscriptions=[{"id": int(channel), "channelId": int(channel)}])


class Connection:
    """``async with Connection(port) as client``: a client that receives in the background."""

    client: FoxgloveClient

    def __init__(self, port: int, session: aiohttp.ClientSession | None = None) -> None:
        self._port, self._shared = port, session

    async def open(self) -> None:
        """Connect."""
        self._session = self._shared or aiohttp.ClientSession()
        try:
            url = f"http://127.0.0.1:{self._port}"
            self._socket = await self._session.ws_connect(url, protocols=[SUBPROTOCOL], max_msg_size=0)
        except BaseException:
            await self._end_session()
            raise
        self.client = FoxgloveClient(self._socket)
        self._task = asyncio.create_task(self.client.run())

    async def close(self) -> None:
        """Disconnect."""
        await self._socket.close()
        await self._task
        await self._end_session()

    async def __aenter__(self) -> FoxgloveClient:
        await self.open()
        return self.client

    async def __aexit__(self, *exception: object) -> None:
        await self.close()

    async def _end_session(self) -> None:
        if self._shared is None:
            await self._session.close()


async def _print_messages(port: int) -> None:
    async with Connection(port) as client:
        shown = 0
        while True:
            for message in client.messages[shown:]:
                print(message.topic, message.log_ns, flush=True)
            shown = len(client.messages)
            await asyncio.sleep(0.05)


if __name__ == "__main__":
    asyncio.run(_print_messages(int(sys.argv[1])))
