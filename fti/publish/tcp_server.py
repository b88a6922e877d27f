"""TCP server at 127.0.0.1 that sends the same bytes to every client and ignores what a client sends."""

from __future__ import annotations

import socket
from contextlib import suppress

from fti.publish.notices import Notices, Notify
from fti.publish.sink import SinkError

HOST = "127.0.0.1"
#: Further clients are disconnected at once.
MAX_CLIENTS = 128
#: A client is disconnected when so many bytes wait for it in our kernel, beside those in its own: seconds of sentences.
SEND_BYTES = 16384
#: A client that floods fills a small buffer of the kernel; of it so much is discarded at a time.
RECEIVE_BYTES = 4096


class TcpServer:
    """Serves its clients whenever it is called, and never waits for one.

    key : of the configuration, for errors; notify : reports an event
    """

    def __init__(self, port: int, key: str, notify: Notify) -> None:
        self._port, self._key, self._notices = port, key, Notices(key, notify)
        self._listener: socket.socket | None = None
        self._clients: list[socket.socket] = []

    def open(self) -> None:
        """Listen.  Raises SinkError."""
        listener = socket.socket()
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)  # inherited by the connections
            listener.bind((HOST, self._port))
            listener.listen(MAX_CLIENTS)
            listener.setblocking(False)
        except OSError as error:
            listener.close()
            raise SinkError(f"{self._key}: {HOST}:{self._port}: {error.strerror}") from None
        self._listener = listener

    def send(self, data: bytes = b"") -> None:
        """Accept new clients, discard what clients sent, and send to all.  A client that does not read is dropped."""
        self._accept()
        for client in self._clients.copy():
            is_connected = _is_connected(client)
            if is_connected and not _is_taken(client, data):
                self._notices.count("a client does not read; it was disconnected")
                is_connected = False
            if not is_connected:
                client.close()
                self._clients.remove(client)
        self._notices.report()

    def count_clients(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

    def close(self) -> None:
        """Disconnect all clients, and end listening."""
        for client in self._clients:
            client.close()
        self._clients.clear()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def _accept(self) -> None:
        assert self._listener is not None
        for _ in range(MAX_CLIENTS):
            try:
                client, _address = self._listener.accept()
            except OSError:  # no more, or already gone
                return
            if len(self._clients) >= MAX_CLIENTS:
                self._notices.count(f"a client was refused: {MAX_CLIENTS} are connected")
                client.close()
                continue
            client.setblocking(False)
            with suppress(OSError):
                client.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BYTES)
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._clients.append(client)


def _is_connected(client: socket.socket) -> bool:
    """Discard what a client has sent; is it still there?"""
    try:
        return bool(client.recv(RECEIVE_BYTES))
    except BlockingIOError:
        return True
    except OSError:
        return False


def _is_taken(client: socket.socket, data: bytes) -> bool:
    """Has the kernel taken all the data for a client?"""
    try:
        return client.send(data) == len(data)
    except OSError:
        return False
