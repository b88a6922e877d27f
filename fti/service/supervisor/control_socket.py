"""The control socket of a daemon: one JSON command per line, one JSON answer per line.

It is for the owner alone: the socket has mode 0600, and a process of another user (except root) is refused by its
credentials.
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
#: Executes a command of a user; returns the answer, or ``{"fault": ...}``.
CommandHandler = Callable[[dict[str, Any], str], Awaitable[Answer]]
MAX_LINE_BYTES = 65536
INVALID_COMMAND = {"fault": f"a command must be one line of JSON of at most {MAX_LINE_BYTES} bytes"}
UNTRUSTED_PEER = {"fault": "only root and the user who started the daemon may send commands"}


async def serve_commands(sock: socket.socket, handle_command: CommandHandler, report: FailureHandler) -> asyncio.Server:
    """Serve clients; a failing client does not affect others.  Each connection is answered in order.

    sock   : bound, see ``RunDirectory.bind``
    report : receives internal errors; the client gets an answer, too
    """

    async def serve_client(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        peer = Peer.from_socket(writer.get_extra_info("socket"))
        disconnect = contextlib.suppress(ConnectionError, asyncio.CancelledError)  # at any time, by either side
        with catch_failures("control socket", report), disconnect:
            try:
                while line := await reader.readline():
                    answer = (
                        await _answer(line, handle_command, str(peer), report) if peer.is_trusted else UNTRUSTED_PEER
                    )
                    await _write_answer(writer, answer)
            except ValueError:  # too long; the remaining bytes are not a command
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
        return {"fault": "a command must be a JSON object"}
    with catch_failures("control socket", report):
        return await handle_command(command, who)
    return {"fault": "internal error, see the event log"}
