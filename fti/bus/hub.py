"""The hub of the bus inside the daemon: forwards the messages of publishers to subscribers.

It listens on a Unix socket in the run directory, for the owner alone: the file has mode 0600 and the kernel reports
the user of each connection.  The supervisor hosts it in a separate thread, because the supervisor survives navigation
and display.  The hub reads only the header of a message.  No client blocks another one (see ``fti.bus.outbox``).

A publisher sends its name when it connects and may only use the topics of that name.  The process counts as alive
while its connection lasts; the kernel closes the connection when the process ends.
"""

from __future__ import annotations

import os
import selectors
import socket
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from fti.bus.frame import ALIVE, PUBLISH, RECEIVE_BYTES, SUBSCRIBE, BusFrame, FrameError, FrameReader, make_frame
from fti.bus.outbox import Outbox
from fti.errors import MissingError
from fti.messages.topics import BUS_EMULATOR
from fti.peer_credentials import Peer

#: Publishers, and the prefix of their topics.
PUBLISHERS = {"navigation": "/nav/", "emulator": BUS_EMULATOR}
MAX_CONNECTIONS = 64
#: Maximum number of warnings in a period.
MAX_WARNINGS, WARNING_PERIOD_S = 5, 10.0
ACCEPT_PAUSE_S = 0.05
#: Receives a warning about refused or lost messages; called by the thread of the hub.
Warn = Callable[[str], None]


@dataclass(slots=True, eq=False)
class _Client:
    """A connection.  outbox : of a subscriber; name : set by its first frame"""

    sock: socket.socket
    reader: FrameReader = field(default_factory=FrameReader)
    name: str = ""
    outbox: Outbox | None = None
    reported: bool = False


class Hub:
    """Listens from its creation on; ``serve`` forwards messages.  warn : see ``Warn``"""

    def __init__(self, path: Path, warn: Warn) -> None:
        self.path = path
        self._warn = warn
        self._listener = _bind(path)
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._own: deque[BusFrame] = deque(maxlen=1024)
        self._clients: set[_Client] = set()
        self._alive: Counter[str] = Counter()
        self._too_large: set[str] = set()
        self._warnings, self._period_end_s = 0, 0.0
        self.is_ending = False
        self._selector = selectors.EpollSelector()
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._selector.register(self._wake, selectors.EVENT_READ)

    def publish(self, topic: str, payload: bytes) -> None:
        """Publish a message of the supervisor, from any thread; never blocks.  Warns if it is too large."""
        if self.is_ending:
            return
        try:
            self._own.append(make_frame(topic, payload))
        except FrameError as error:
            if topic not in self._too_large:
                self._too_large.add(topic)
                self._warn(str(error))
        os.eventfd_write(self._wake, 1)

    def end(self) -> None:
        """Make ``serve`` return after the queued messages."""
        self.is_ending = True
        os.eventfd_write(self._wake, 1)

    def close(self) -> None:
        """Close every connection; after ``serve`` has returned."""
        for client in self._clients:
            client.sock.close()
        self._clients.clear()
        self._selector.close()
        self._listener.close()
        os.close(self._wake)
        self.path.unlink(missing_ok=True)

    def serve(self) -> None:
        """Forward messages until ``end``; may be called again after an exception."""
        while True:
            ending = self.is_ending  # messages published before are still sent
            for key, events in self._selector.select(timeout=0 if ending else None):
                if isinstance(key.data, _Client):
                    self._handle_client(key.data, events)
                elif key.fileobj is self._listener:
                    self._accept()
                else:
                    os.eventfd_read(self._wake)
            while self._own:
                self._broadcast(self._own.popleft())
            self._flush()
            if ending:
                return

    # -------------------------------------------------------------------------------------------------- connections

    def _accept(self) -> None:
        try:
            sock, _ = self._listener.accept()
        except OSError:  # already closed, or no descriptor is free
            time.sleep(ACCEPT_PAUSE_S)  # the connection waits; it is accepted later
            return
        peer = Peer.from_socket(sock)
        if peer.uid != os.getuid() or len(self._clients) >= MAX_CONNECTIONS:
            self._warn_limited(f"a connection of user {peer.uid} is refused ({len(self._clients)} are open)")
            sock.close()
            return
        sock.setblocking(False)
        client = _Client(sock)
        self._clients.add(client)
        self._selector.register(sock, selectors.EVENT_READ, client)

    def _handle_client(self, client: _Client, events: int) -> None:
        """Receive from a client; any failure disconnects only this client."""
        healthy = False
        try:
            healthy = not events & selectors.EVENT_READ or self._receive(client)
        except FrameError as error:
            self._warn_limited(f"{client.name or 'a client'}: {error}; the connection is closed")
        finally:
            if not healthy:
                self._drop(client)

    def _receive(self, client: _Client) -> bool:
        """Receive frames; is the client still connected?"""
        try:
            data = client.sock.recv(RECEIVE_BYTES)
        except BlockingIOError:
            return True
        except OSError:
            return False
        for frame in client.reader.feed(data):
            if client.name:
                self._handle_frame(client, frame)
            else:
                self._register(client, frame)
        return bool(data)

    def _register(self, client: _Client, frame: BusFrame) -> None:
        """Register a client by its first frame.  Raises FrameError if it is not permitted."""
        name = frame.payload.decode(errors="replace")
        if frame.topic == SUBSCRIBE and name:
            client.outbox = Outbox()
            for process in self._alive:
                client.outbox.add(make_frame(ALIVE + process, b"1"))
        elif frame.topic == PUBLISH and name in PUBLISHERS:
            self._alive[name] += 1
            self._broadcast(make_frame(ALIVE + name, b"1"))
        else:
            raise FrameError(f"{name[:80]!a} may not publish or subscribe")
        client.name = name

    def _handle_frame(self, client: _Client, frame: BusFrame) -> None:
        if client.outbox is None and frame.topic.startswith(PUBLISHERS[client.name]):
            self._broadcast(frame)
        elif not client.reported:
            client.reported = True
            self._warn_limited(f"{client.name}: may not publish on {frame.topic!a}; such messages are discarded")

    def _warn_limited(self, text: str) -> None:
        """Warn, at most ``MAX_WARNINGS`` times in a period."""
        now = time.monotonic()
        if now >= self._period_end_s:
            self._warnings, self._period_end_s = 0, now + WARNING_PERIOD_S
        self._warnings += 1
        if self._warnings <= MAX_WARNINGS:
            self._warn(
                text
                if self._warnings < MAX_WARNINGS
                else f"{text}; further warnings are suppressed for {WARNING_PERIOD_S:g} s"
            )

    def _drop(self, client: _Client) -> None:
        if client not in self._clients:
            return
        self._clients.discard(client)
        self._selector.unregister(client.sock)
        client.sock.close()
        if client.outbox is None and client.name:
            self._alive[client.name] -= 1
            if not self._alive[client.name]:
                del self._alive[client.name]
                self._broadcast(make_frame(ALIVE + client.name, b"0"))

    # ----------------------------------------------------------------------------------------------------- messages

    def _broadcast(self, frame: BusFrame) -> None:
        for client in self._clients:
            if client.outbox is not None:
                client.outbox.add(frame)

    def _flush(self) -> None:
        """Send queued messages, as far as the subscribers accept them now."""
        for client in [*self._clients]:
            if client.outbox and not self._send(client, client.outbox):
                self._drop(client)

    def _send(self, client: _Client, outbox: Outbox) -> bool:
        """Send queued messages; is the client still connected?"""
        while outbox:
            data = outbox.next_bytes()
            try:
                sent = client.sock.send(data)
            except BlockingIOError:
                sent = 0
            except OSError:
                return False
            outbox.keep_unsent(data[sent:])
            if sent < len(data):
                break
        waits = selectors.EVENT_WRITE if outbox else 0
        if self._selector.get_key(client.sock).events != selectors.EVENT_READ | waits:
            self._selector.modify(client.sock, selectors.EVENT_READ | waits, client)
        if outbox.lost and not waits:
            self._warn_limited(f"{client.name} reads too slowly: {outbox.lost} messages are lost")
            outbox.lost = 0
        return True


def _bind(path: Path) -> socket.socket:
    """Create a socket for the owner alone.  Raises MissingError if that fails."""
    path.unlink(missing_ok=True)
    sock = socket.socket(socket.AF_UNIX)
    before = os.umask(0o177)
    try:
        sock.bind(str(path))
        sock.listen(MAX_CONNECTIONS)
    except OSError as error:
        sock.close()
        raise MissingError(
            f"{path}: cannot create the socket of the bus: {error.strerror}; choose another --run-dir"
        ) from None
    finally:
        os.umask(before)
    sock.setblocking(False)
    return sock
