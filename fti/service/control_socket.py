"""The control socket of a daemon: one JSON command a line, one JSON answer a line; for the owner alone (0600)."""

from __future__ import annotations

import asyncio
import json
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fti.errors import MissingError
from fti.service.guard import Report, guarded

Answer = dict[str, Any]
#: Does what a command says; answers with ``{"fault": ...}`` when it cannot.
Obey = Callable[[dict[str, Any]], Answer]


async def serve_commands(path: Path, obey: Obey, report: Report) -> asyncio.Server:
    """Listen; a client that fails is reported and disturbs nobody."""

    async def attend(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with guarded("control socket", report):
            while line := await reader.readline():
                writer.write(json.dumps(_answer(line, obey)).encode() + b"\n")
                await writer.drain()
        writer.close()

    return await asyncio.start_unix_server(attend, sock=_bind(path))


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


def _answer(line: bytes, obey: Obey) -> Answer:
    try:
        command = json.loads(line)
    except ValueError:
        return {"fault": "a command is one line of JSON"}
    return obey(command) if isinstance(command, dict) else {"fault": "a command is a JSON object"}
