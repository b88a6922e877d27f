"""The control socket of a daemon: one JSON command a line, one JSON answer a line; for the owner alone (0600)."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import pwd
import socket
import struct
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from fti.errors import MissingError
from fti.service.guard import Report, guarded

Answer = dict[str, Any]
#: Does what a command of somebody says; answers with ``{"fault": ...}`` when it cannot.
Obey = Callable[[dict[str, Any], str], Awaitable[Answer]]
LONGEST_LINE = 65536
NO_COMMAND = {"fault": f"a command is one line of JSON of at most {LONGEST_LINE} bytes"}
_CREDENTIALS = struct.Struct("3i")  # pid, uid, gid: struct ucred


async def serve_commands(path: Path, obey: Obey, report: Report) -> asyncio.Server:
    """Listen; a client that fails disturbs nobody.  One connection is answered in order.

    report : told of what failed here; the client is told too
    """

    async def attend(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        who = _describe_peer(writer.get_extra_info("socket"))
        gone = contextlib.suppress(ConnectionError, asyncio.CancelledError)  # a client may go at any time, and we too
        with guarded("control socket", report), gone:
            try:
                while line := await reader.readline():
                    await _say(writer, await _answer(line, obey, who, report))
            except ValueError:  # too long; what follows is the rest of it
                await _say(writer, NO_COMMAND)
        writer.close()

    return await asyncio.start_unix_server(attend, sock=_bind(path), limit=LONGEST_LINE)


async def _say(writer: asyncio.StreamWriter, answer: Answer) -> None:
    writer.write(json.dumps(answer).encode() + b"\n")
    await writer.drain()


def _describe_peer(sock: socket.socket) -> str:
    """Who is at the other end, as the kernel says."""
    found = sock.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    pid, uid, _ = _CREDENTIALS.unpack(found)
    try:
        name = pwd.getpwuid(uid).pw_name
    except KeyError:
        name = f"user {uid}"
    return f"{name} (process {pid})"


def _bind(path: Path) -> socket.socket:
    """A socket that nobody else can open at any moment.  Raises MissingError when the path cannot be one."""
    path.unlink(missing_ok=True)
    sock = socket.socket(socket.AF_UNIX)
    before = os.umask(0o177)
    try:
        sock.bind(str(path))
    except OSError as error:
        sock.close()
        raise MissingError(f"{path}: cannot be the control socket: {error}; choose a short --run-dir") from None
    finally:
        os.umask(before)
    return sock


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
