"""The wire format of the bus inside the daemon: frames on a Unix stream socket.

    payload length  u32   bytes of the payload
    topic length    u16   bytes of the topic
    sent            i64   time of publication [ns], CLOCK_MONOTONIC, which all processes of the machine share
    topic, payload        UTF-8 and bytes, all numbers little-endian

Topics that begin with ``@`` belong to the bus itself: ``@publish`` and ``@subscribe`` (payload: name of the process)
are the first frame of a client; ``@alive/<process>`` (payload ``1`` or ``0``): a publisher has connected or ended.
"""

from __future__ import annotations

import os
import socket
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from fti.messages.topics import BUS_ALARMS, BUS_EMULATOR, BUS_HEALTH
from fti.peer_credentials import Peer

#: Name of the socket in the run directory.
SOCKET_NAME = "bus.sock"
PUBLISH, SUBSCRIBE, ALIVE = "@publish", "@subscribe", "@alive/"
EVENT = "/event"
MAX_TOPIC_BYTES = 200
#: Largest payload by topic [B]; health has a table for each link, a display stores 256 outputs and 50 events.
MAX_BYTES = {BUS_HEALTH: 4 * 2**20, BUS_ALARMS: 4 * 2**20, BUS_EMULATOR: 2**20}
MAX_OTHER_BYTES = 2**16
RECEIVE_BYTES = 2**18
_HEAD = struct.Struct("<IHq")


class FrameError(ValueError):
    """The received data are not a frame, or too large."""


class BusFrame(NamedTuple):
    """A message and its raw bytes."""

    topic: str
    sent_ns: int
    raw: bytes

    @property
    def payload(self) -> bytes:
        """The content."""
        return self.raw[_HEAD.size + len(self.topic.encode()) :]


def max_bytes(topic: str) -> int:
    """Maximum payload of a topic [B]."""
    return MAX_BYTES.get(topic, MAX_OTHER_BYTES)


def make_frame(topic: str, payload: bytes) -> BusFrame:
    """A message with the present time.  Raises FrameError when topic or payload is too large."""
    name = topic.encode(errors="replace")
    _check_size(topic, len(name), len(payload))
    sent_ns = time.monotonic_ns()
    return BusFrame(name.decode(), sent_ns, _HEAD.pack(len(payload), len(name), sent_ns) + name + payload)


def _check_size(topic: str, topic_bytes: int, payload_bytes: int) -> None:
    if topic_bytes > MAX_TOPIC_BYTES:
        raise FrameError(f"a topic of {topic_bytes} bytes; the limit is {MAX_TOPIC_BYTES}")
    if payload_bytes > max_bytes(topic):
        raise FrameError(f"{topic!a}: a message of {payload_bytes} bytes; the limit is {max_bytes(topic)}")


class FrameReader:
    """Splits the data of a connection into frames."""

    def __init__(self) -> None:
        self._received = bytearray()

    def feed(self, data: bytes) -> Iterator[BusFrame]:
        """The complete frames.  Raises FrameError for invalid data; the reader is then unusable."""
        self._received += data
        begin = 0
        try:
            while (end := self._find_end(begin)) is not None:
                raw = bytes(self._received[begin:end])
                begin = end
                yield _parse(raw)
        finally:
            del self._received[:begin]

    def _find_end(self, begin: int) -> int | None:
        """End of the frame that begins here; None while it is incomplete."""
        if len(self._received) < begin + _HEAD.size:
            return None
        payload_bytes, topic_bytes, _ = _HEAD.unpack_from(self._received, begin)
        if topic_bytes > MAX_TOPIC_BYTES or payload_bytes > max(MAX_BYTES.values()):
            raise FrameError(f"a message of {payload_bytes} bytes on a topic of {topic_bytes} bytes")
        end: int = begin + _HEAD.size + topic_bytes + payload_bytes
        return end if len(self._received) >= end else None


def _parse(raw: bytes) -> BusFrame:
    payload_bytes, topic_bytes, sent_ns = _HEAD.unpack_from(raw)
    try:
        topic = raw[_HEAD.size : _HEAD.size + topic_bytes].decode()
    except UnicodeDecodeError:
        raise FrameError("a topic that is not UTF-8") from None
    _check_size(topic, topic_bytes, payload_bytes)
    return BusFrame(topic, sent_ns, raw)


def connect(path: Path, first_topic: str, process: str) -> socket.socket | None:
    """Connect to the hub of this user and send the first frame; None if there is no such hub."""
    sock = socket.socket(socket.AF_UNIX)
    try:
        sock.setblocking(False)  # a stopped hub with a full backlog refuses at once
        sock.connect(str(path))
        if Peer.from_socket(sock).uid == os.getuid():
            sock.send(make_frame(first_topic, process.encode()).raw)
            return sock
    except OSError:
        pass
    sock.close()
    return None
