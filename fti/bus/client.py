"""The processes on the bus inside the daemon: who publishes and who subscribes (see ``fti.bus.hub``).

Both come back by themselves when the hub has gone and is there again.
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
#: For the last messages of a publisher.
END_S = 0.2
#: The process that hosts the hub, as a subscriber sees it.
HOST = "supervisor"

#: Topic, payload, and when it was published (CLOCK_MONOTONIC [ns], never later than now).
Callback = Callable[[str, bytes, int], None]
AliveCallback = Callable[[str, bool], None]


class Publisher:
    """A process that publishes; for one thread.  It is alive for the others while this is open.

    What the hub does not take at once goes with the next message; of what waits then, the newest of each topic stays.

    path : of the hub; process : a name that the hub knows
    """

    def __init__(self, path: Path, process: str) -> None:
        self._path, self._process = path, process
        self._retry_at = 0.0
        self._outbox = Outbox()
        self._sock = connect(path, PUBLISH, process)
        self._lost = 0

    @property
    def lost(self) -> int:
        """Messages that nobody will get, other than those that a newer one of their topic displaced."""
        return self._lost + self._outbox.lost

    def publish(self, topic: str, payload: bytes) -> None:
        """Send one message to whoever listens; never waits.  One that is too large is lost."""
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
        """Leave the bus; what waits is sent, if the hub takes it now."""
        if self._sock:
            self._sock.settimeout(END_S)
            self._send(self._sock)
            self._leave()

    def _connect(self) -> None:
        """With another try from time to time."""
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
            except OSError:  # the hub has gone
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
    """A process that gets every message, in a thread of its own, until it is closed.

    callback(topic, payload, sent_ns) : called for every message
    on_alive(process, is_alive)       : called when a publisher or the supervisor appears or ends, and for those that
                                        are there already
    Raises MissingError when there is no bus.
    """

    def __init__(self, path: Path, process: str, callback: Callback, on_alive: AliveCallback | None = None) -> None:
        self._path, self._process = path, process
        self._callback, self._on_alive = callback, on_alive or (lambda process, is_alive: None)
        self._ending = threading.Event()
        self._alive: set[str] = set()
        self._sock = connect(path, SUBSCRIBE, process)
        if self._sock is None:
            raise MissingError(f"{path}: there is no bus of this user; is the daemon running?")
        self._thread = threading.Thread(target=self._run, name="fti-bus-subscriber", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave the bus."""
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
        """Until the connection ends."""
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
    """End the wait of another thread for what comes here."""
    try:
        sock.shutdown(socket.SHUT_RDWR)
    except OSError:  # it has ended already
        return
