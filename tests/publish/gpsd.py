"""gpsd as a client of a server of NMEA 0183 sentences."""

from __future__ import annotations

import json
import socket
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from tests.e2e.harness import free_udp_port
from tests.helpers import until
from tests.publish.broker import find_program

READ_S = 20.0


@contextmanager
def served_by_gpsd(port: int) -> Iterator[Callable[[], dict[str, Any]]]:
    """gpsd reads from a port of loopback; gives the next of its reports.  Skips without gpsd."""
    program = find_program("gpsd", "gpsd")
    own = free_udp_port()
    command = [program, "-N", "-n", "-b", "-S", str(own), f"tcp://127.0.0.1:{port}"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            with until(lambda: connected(own), what="gpsd") as client, client.makefile("rw") as talk:
                talk.write('?WATCH={"enable":true,"json":true};\n')
                talk.flush()
                client.settimeout(READ_S)
                yield lambda: json.loads(talk.readline())
        finally:
            process.terminate()


def connected(port: int) -> socket.socket | None:
    """A connection to a port of loopback, if anyone listens."""
    try:
        return socket.create_connection(("127.0.0.1", port), timeout=5.0)
    except OSError:
        return None
