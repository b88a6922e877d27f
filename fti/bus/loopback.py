"""The endpoint for zenoh clients; does not import zenoh."""

from __future__ import annotations

import os
import socket

from fti.errors import MissingError

LOOPBACK = "127.0.0.1"


def choose_port(port: int) -> int:
    """The port, or a free port for 0.  Raises MissingError when it is in use."""
    try:
        with socket.create_server((LOOPBACK, port)) as server:
            chosen: int = server.getsockname()[1]
    except OSError as error:
        why = f"cannot be used on {LOOPBACK}: {os.strerror(error.errno or 0)}"
        raise MissingError(f"bus.port = {port}: {why}; 0 chooses a free port") from None
    return chosen


def describe_endpoint(port: int) -> str:
    """The endpoint in zenoh notation."""
    return f"tcp/{LOOPBACK}:{port}"
