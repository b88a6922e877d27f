"""The control socket of a daemon: one JSON command a line, one JSON answer a line.

It is for the owner alone: the socket is 0600, and a process of another user (root excepted) is refused by its
credentials, however it came by the socket.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
from collections.abc import Awaitable, Callable
from typing import Any

from fti.peer_credentials import Peer
from fti.service.guard import Report, guarded

Answer = dict[str, Any]
#: Does what a command of somebody says; answers with ``{"fault": ...}`` when it cannot.
Obey = Callable[[dict[str, Any], str], Awaitable[Answer]]
LONGEST_LINE = 65536
NO_COMMAND = {"fault": f"a command is one line of JSON of at most {LONGEST_LINE} bytes"}
STRANGER = {"fault": "only the user who started the daemon, and root, may ask it for something"}


async def serve_commands(sock: socket.socket, obey: Obey, report: Report) -> asyncio.Server:
    """Listen; a client that fails disturbs nobody.  One connection is answered in order.

    sock   : bound, see ``RunDir.bind``
    report : told of what failed here; the client is told too
    """

    async def attend(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        peer = Peer.of(writer.get_extra_info("socket"))
        gone = contextlib.suppress(ConnectionError, asyncio.CancelledError)  # a client may go at any time, and we too
        with guarded("control socket", report), gone:
            try:
                while line := await reader.readline():
                    answer = await _answer(line, obey, str(peer), report) if peer.is_trusted else STRANGER
                    await _say(writer, answer)
            except ValueError:  # too long; what follows is the rest of it
                await _say(writer, NO_COMMAND)
        writer.close()

    return await asyncio.start_unix_server(attend, sock=sock, limit=LONGEST_LINE)


async def _say(writer: asyncio.StreamWriter, answer: Answer) -> None:
    writer.write(json.dumps(answer).encode() + b"\n")
    await writer.drain()


async def _answer(line: bytes, obey: Obey, who: str, report: Report) -> Answer:
    try:
        command = json.loads(line)
    except (ValueError, RecursionError):
        return NO_COMMAND
    if not isinstance(command, dict):
        return {"fault": "a command is a JSON object"}
    with guarded("control socket", report):
        return await obey(command, who)
    return {"fault": "the daemon failed at it: see the events"}
