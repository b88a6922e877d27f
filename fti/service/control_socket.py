"""The control socket of a daemon: one JSON command a line, one JSON answer a line; for the owner alone (0600)."""

from __future__ import annotations

import asyncio
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
_CREDENTIALS = struct.Struct("3i")  # pid, uid, gid: struct ucred


async def serve_commands(path: Path, obey: Obey, report: Report) -> asyncio.Server:
    """Listen; a client that fails is reported and disturbs nobody.  One connection is answered in order."""

    async def attend(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with guarded("control socket", report):
            who = _describe_peer(writer.get_extra_info("socket"))
            while line := await reader.readline():
                writer.write(json.dumps(await _answer(line, obey, who)).encode() + b"\n")
                await writer.drain()
        writer.close()

    return await asyncio.start_unix_server(attend, sock=_bind(path))


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


async def _answer(line: bytes, obey: Obey, who: str) -> Answer:
    try:
        command = json.loads(line)
    except ValueError:
        return {"fault": "a command is one line of JSON"}
    return await obey(command, who) if isinstance(command, dict) else {"fault": "a command is a JSON object"}
