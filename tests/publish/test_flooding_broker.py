"""An MQTT broker that sends messages to which nobody has subscribed, as fast as it can."""

from __future__ import annotations

import itertools
import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import pytest

from fti.config import MqttTable, Publish
from tests.bus.running_hub import RunningHub
from tests.publish.running_publisher import RunningPublisher

CONNECT, CONNACK, PUBLISH, PUBACK = 1, b"\x20\x02\x00\x00", 3, b"\x40\x02"
#: PUBLISH with QoS 0 of 1000 bytes to the topic "x"; its length is 1003.
UNWANTED = b"\x30\xeb\x07" + b"\x00\x01x" + bytes(1000)
#: The broker floods until the client has taken so much; what it keeps of it is less.
FLOOD_BYTES, MAX_GROWTH_MB = 30 * 10**6, 15.0


class FloodingBroker:
    """Accepts one client, acknowledges its messages, and floods it while ``is_flooding``."""

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._server.getsockname()[1]
        self.taken = 0
        self._sending = threading.Lock()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        with suppress(OSError):
            self._client, _ = self._server.accept()
            for kind, content in self._packets():
                if kind >> 4 == CONNECT:
                    self._send(CONNACK)
                elif kind >> 4 == PUBLISH and kind & 0x06:
                    end = 2 + int.from_bytes(content[:2], "big")
                    self._send(PUBACK + content[end : end + 2])

    def _packets(self) -> Iterator[tuple[int, bytes]]:
        """First byte and content of each packet."""
        stream = self._client.makefile("rb")
        while head := stream.read(1):
            length = 0
            for shift in itertools.count(0, 7):
                byte = stream.read(1)[0]
                length |= (byte & 0x7F) << shift
                if byte < 0x80:
                    break
            yield head[0], stream.read(length)

    def _send(self, data: bytes) -> None:
        with self._sending:
            self._client.sendall(data)

    def flood(self) -> None:
        """Send many messages; the client takes them while it waits for an acknowledgement, which comes behind them."""
        with suppress(OSError):  # it has disconnected
            for _ in range(FLOOD_BYTES // (100 * len(UNWANTED))):
                self._send(100 * UNWANTED)
                self.taken += 100 * len(UNWANTED)

    def close(self) -> None:
        """End it."""
        self._client.close()
        self._server.close()
        self._thread.join()


@pytest.mark.timeout(120)
def test_messages_without_a_subscription_are_not_kept(capfd: pytest.CaptureFixture[str]) -> None:
    broker = FloodingBroker()
    with RunningHub() as hub, RunningPublisher(hub, Publish(mqtt=MqttTable(port=broker.port))) as running:
        running.wait_for_state("mqtt", "connected")
        before_mb = running.resident_mb()
        with ThreadPoolExecutor(1) as pool:
            flood = pool.submit(broker.flood)
            while not flood.done():
                running.publish_event(1)
                time.sleep(0.05)
        growth_mb = running.resident_mb() - before_mb
        assert broker.taken > 5e6
        assert growth_mb < MAX_GROWTH_MB
        broker.close()
    assert "queue" not in capfd.readouterr().err
