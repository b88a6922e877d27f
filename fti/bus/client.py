"""Publisher and subscriber of the bus inside the daemon (see ``fti.bus.hub``).

Both reconnect automatically after the hub has been restarted.
"""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path

from fti.bus.frame import ALIVE, PUBLISH, RECEIVE_BYTES, SUBSCRIBE, FrameError, FrameReader, connect, make_frame
from fti.bus.outbox import Outbox
from fti.errors import MissingError

RETRY_S = 0.5
#: Timeout for the last messages of a publisher.
END_S = 0.2
#: Name of the process that hosts the hub.
HOST = "supervisor"

#: Topic, payload, time of publication (CLOCK_MONOTONIC [ns], never later than now).
Callback = Callable[[str, bytes, int], None]
AliveCallback = Callable[[str, bool], None]


class Publisher:
    """Publishes for a process, from one thread.  The process counts as alive while this is open.

    Messages that the hub does not accept at once are queued until the next message; with a full queue only the newest
    of each topic is kept.

    path : of the hub; process : one of ``PUBLISHERS``
    """

    def __init__(self, path: Path, process: str) -> None:
        self._path, self._process = path, process
        self._retry_at = 0.0
        self._outbox = Outbox()
        self._sock = connect(path, PUBLISH, process)
        self._lost = 0

    @property
    def lost(self) -> int:
        """Number of lost messages, without those replaced by a newer one of their topic."""
        return self._lost + self._outbox.lost

    def publish(self, topic: str, payload: bytes) -> None:
        """Send a message; never blocks.  A message that is too large is lost."""
        try:
            frame = make_frame(topic, payload)
        except FrameError:
            self._lost += 1
            return
        self._connect()
        if self._sock is None:
            self._lost += 1
            return
        self._outbox.add(frame)
        self._send(self._sock)

    def close(self) -> None:
        """Disconnect; queued messages are sent if the hub accepts them now."""
        if self._sock:
            self._sock.settimeout(END_S)
            self._send(self._sock)
            self._leave()

    def _connect(self) -> None:
        """Connect if necessary, with a retry every ``RETRY_S``."""
        if self._sock is None and time.monotonic() >= self._retry_at:
            self._retry_at = time.monotonic() + RETRY_S
            self._sock = connect(self._path, PUBLISH, self._process)

    def _send(self, sock: socket.socket) -> None:
        while self._outbox:
            data = self._outbox.next_bytes()
            try:
                sent = sock.send(data)
            except (BlockingIOError, TimeoutError):
                sent = 0
            except OSError:  # the hub has ended
                self._leave()
                return
            self._outbox.keep_unsent(data[sent:])
            if not sent:
                return

    def _leave(self) -> None:
        if self._sock:
            self._sock.close()
        self._lost += self._outbox.lost + len(self._outbox)
        self._sock, self._outbox = None, Outbox()


class Subscriber:
    """Receives every message in a separate thread until it is closed.

    callback(topic, payload, sent_ns) : called for every message
    on_alive(process, is_alive)       : called when a publisher or the supervisor appears or ends, and for those
                                        already present
    Raises MissingError when there is no bus.
    """

    def __init__(self, path: Path, process: str, callback: Callback, on_alive: AliveCallback | None = None) -> None:
        self._path, self._process = path, process
        self._callback, self._on_alive = callback, on_alive or (lambda process, is_alive: None)
        self._ending = threading.Event()
        self._alive: set[str] = set()
        self._sock = connect(path, SUBSCRIBE, process)
        if self._sock is None:
            raise MissingError(f"{path}: no bus of this user found; is the daemon running?")
        self._thread = threading.Thread(target=self._run, name="fti-bus-subscriber", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Disconnect."""
        self._ending.set()
        if sock := self._sock:
            _wake(sock)
        self._thread.join()

    def _run(self) -> None:
        while not self._ending.is_set():
            if self._sock is not None:
                self._set_alive(HOST, True)
                self._receive(self._sock)
                self._sock.close()
                for process in [*self._alive]:
                    self._set_alive(process, False)
            if not self._ending.wait(RETRY_S):
                self._sock = connect(self._path, SUBSCRIBE, self._process)
        if self._sock is not None:
            self._sock.close()

    def _receive(self, sock: socket.socket) -> None:
        """Receive until the connection ends."""
        sock.setblocking(True)
        reader = FrameReader()
        while not self._ending.is_set():
            try:
                data = sock.recv(RECEIVE_BYTES)
                frames = list(reader.feed(data))
            except (OSError, FrameError):
                return
            for frame in frames:
                if frame.topic.startswith(ALIVE):
                    self._set_alive(frame.topic.removeprefix(ALIVE), frame.payload == b"1")
                else:
                    self._callback(frame.topic, frame.payload, min(frame.sent_ns, time.monotonic_ns()))
            if not data:
                return

    def _set_alive(self, process: str, is_alive: bool) -> None:
        (self._alive.add if is_alive else self._alive.discard)(process)
        self._on_alive(process, is_alive)


def _wake(sock: socket.socket) -> None:
    """Unblock another thread that receives on the socket."""
    try:
        sock.shutdown(socket.SHUT_RDWR)
    except OSError:  # it has ended already
        return
