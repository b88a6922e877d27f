"""A command to a running daemon, over its control socket."""

from __future__ import annotations

import json
import socket
from typing import Any

from fti.errors import FtiError, MissingError
from fti.service.rundir import find_daemon

ANSWER_S = 5.0


def ask(command: dict[str, Any], run_dir: str | None = None, answer_s: float = ANSWER_S) -> dict[str, Any]:
    """Send a command and return the answer, which comes within answer_s [s].

    Raises MissingError (no daemon) or FtiError (it refuses).
    """
    info = find_daemon(run_dir)
    with socket.socket(socket.AF_UNIX) as sock:
        sock.settimeout(answer_s)
        try:
            sock.connect(info.sock)
            sock.sendall(json.dumps(command).encode() + b"\n")
            line = sock.makefile("rb").readline()
        except OSError as error:
            raise MissingError(f"{info.sock}: the daemon does not answer: {error}") from None
    if not line.endswith(b"\n"):
        raise MissingError(f"{info.sock}: the daemon has gone before it had answered")
    answer: dict[str, Any] = json.loads(line)
    if "fault" in answer:
        raise FtiError(f"the daemon refuses: {answer['fault']}")
    return answer
