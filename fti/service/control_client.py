"""A command to a running daemon, over its control socket."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from fti.errors import FtiError, MissingError
from fti.run_directory import connect, find_daemon

ANSWER_TIMEOUT_S = 5.0


def send_command(
    command: dict[str, Any], run_dir: str | None = None, answer_s: float = ANSWER_TIMEOUT_S
) -> dict[str, Any]:
    """Send a command and return the answer, waiting at most answer_s [s].

    Raises MissingError (no daemon, or a daemon of another user) or FtiError (the daemon refuses the command).
    """
    info = find_daemon(run_dir)
    try:
        with connect(Path(info.sock), answer_s) as sock:
            sock.sendall(json.dumps(command).encode() + b"\n")
            line = sock.makefile("rb").readline()
    except OSError as error:
        raise MissingError(f"{info.sock}: the daemon does not answer: {error}") from None
    if not line.endswith(b"\n"):
        raise MissingError(f"{info.sock}: the daemon ended before it answered")
    answer: dict[str, Any] = json.loads(line)
    if "fault" in answer:
        raise FtiError(f"the daemon refuses: {answer['fault']}")
    return answer
