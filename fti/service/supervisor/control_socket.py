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
from fti.service.fault_guard import FailureHandler, catch_failures

Answer = dict[str, Any]
#: Does what a command of somebody says; answers with ``{"fault": ...}`` when it cannot.
CommandHandler = Callable[[dict[str, Any], str], Awaitable[Answer]]
MAX_LINE_BYTES = 65536
INVALID_COMMAND = {"fault": f"a command is one line of JSON of at most {MAX_LINE_BYTES} bytes"}
UNTRUSTED_PEER = {"fault": "only the user who started the daemon, and root, may ask it for something"}


async def serve_commands(sock: socket.socket, handle_command: CommandHandler, report: FailureHandler) -> asyncio.Server:
    """Listen; a client that fails disturbs nobody.  One connection is answered in order.

    sock   : bound, see ``RunDirectory.bind``
    report : told of what failed here; the client is told too
    """

    async def serve_client(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        peer = Peer.of(writer.get_extra_info("socket"))
        gone = contextlib.suppress(ConnectionError, asyncio.CancelledError)  # a client may go at any time, and we too
        with catch_failures("control socket", report), gone:
            try:
                while line := await reader.readline():
                    answer = (
                        await _answer(line, handle_command, str(peer), report) if peer.is_trusted else UNTRUSTED_PEER
                    )
                    await _write_answer(writer, answer)
            except ValueError:  # too long; what follows is the rest of it
                await _write_answer(writer, INVALID_COMMAND)
        writer.close()

    return await asyncio.start_unix_server(serve_client, sock=sock, limit=MAX_LINE_BYTES)


async def _write_answer(writer: asyncio.StreamWriter, answer: Answer) -> None:
    writer.write(json.dumps(answer).encode() + b"\n")
    await writer.drain()


async def _answer(line: bytes, handle_command: CommandHandler, who: str, report: FailureHandler) -> Answer:
    try:
        command = json.loads(line)
    except (ValueError, RecursionError):
        return INVALID_COMMAND
    if not isinstance(command, dict):
        return {"fault": "a command is a JSON object"}
    with catch_failures("control socket", report):
        return await handle_command(command, who)
    return {"fault": "the daemon failed at it: see the events"}
