"""Feeds the links of a small daemon with bytes that can be told apart, and remembers them."""

from __future__ import annotations

import socket
import threading
import time
from pathlib import Path

from tests.e2e.harness import Line, free_udp_port

CONFIG = """
[session]
name = "small"
directory = "unused"
min_free_mb = 10

[[link]]
name = "line"
kind = "serial"
port = "/dev/unused"

[[link]]
name = "eth"
kind = "udp"
bind = "127.0.0.1:{port}"

[[device]]
name = "altimeter"
link = "line"
driver = "freeflight_ra4500"
max_age_ms = 500

[device.altimeter]
kind = "radar"
range_m = [0.5, 762]

[nav]
altimeters = ["altimeter"]

[display]
port = 0
"""
PERIOD_S = 0.01


class Feeder:
    """Sends a numbered line of text on a serial line and on UDP every 10 ms, from a thread, until stopped."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.links = folder
        self.port = free_udp_port()
        self.config = folder / "small.toml"
        self.config.write_text(CONFIG.format(port=self.port))
        self.line = Line(folder / "line")
        self.sent_lines: list[bytes] = []
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="feeder")

    def __enter__(self) -> Feeder:
        return self

    def start(self) -> None:
        """Begin to feed."""
        self._thread.start()

    def stop(self) -> None:
        """End feeding; what was sent stays on its way."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def __exit__(self, *_: object) -> None:
        self.stop()
        self.line.close()
        self._socket.close()

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stop.is_set():
            data = b"%09d\n" % len(self.sent_lines)
            self.line.write(data)
            self._socket.sendto(data, ("127.0.0.1", self.port))
            self.sent_lines.append(data)
            due += PERIOD_S
            time.sleep(max(0.0, due - time.monotonic()))
