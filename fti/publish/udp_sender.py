"""Datagrams to configured receivers.  What a receiver sends back is never read."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Sequence
from contextlib import suppress

from fti.config.endpoints import split_endpoint
from fti.publish.notices import Notices, Notify
from fti.publish.sink import SinkError

#: A receive buffer that the kernel fills once and then drops everything: the smallest that it allows.
RECEIVE_BYTES = 1


class UdpSender:
    """Sends each datagram to every receiver, without waiting.

    endpoints : of the receivers, ``1.2.3.4:5``; key : of the configuration, for errors; notify : reports an event

    A receiver that is not there (the datagram is refused), or has no route, is reported and tried again with each
    datagram.  It is an error only when none has a route.
    """

    def __init__(self, endpoints: Sequence[str], key: str, notify: Notify) -> None:
        self._key, self._notices = key, Notices(key, notify)
        self._receivers = [_Receiver(endpoint) for endpoint in endpoints]

    def open(self) -> None:
        """Raises SinkError when there is no route to any receiver."""
        for receiver in self._receivers:
            receiver.connect()
        self._check()

    def send(self, datagram: bytes) -> None:
        """Send to all receivers; a full send buffer loses it.  Raises SinkError when none has a route."""
        for receiver in self._receivers:
            receiver.send(datagram)
        self._check()
        for receiver in self._receivers:
            self._notices.set_fault(receiver.endpoint, receiver.fault)
        self._notices.report()

    def count_reachable(self) -> int:
        """Number of receivers whose last datagram was neither refused nor without a route."""
        return sum(not receiver.fault for receiver in self._receivers)

    def close(self) -> None:
        """Close all sockets."""
        for receiver in self._receivers:
            receiver.close()

    def _check(self) -> None:
        if self._receivers and all(receiver.fault not in ("", _REFUSED) for receiver in self._receivers):
            faults = "; ".join(f"{receiver.endpoint}: {receiver.fault}" for receiver in self._receivers)
            raise SinkError(f"{self._key}: {faults}")


_REFUSED = os.strerror(errno.ECONNREFUSED)


class _Receiver:
    """One receiver.  fault : of its last datagram, or empty"""

    def __init__(self, endpoint: str) -> None:
        self.endpoint, self.fault = endpoint, ""
        self._address = split_endpoint(endpoint)
        self._socket: socket.socket | None = None

    def connect(self) -> None:
        """Choose the route; there may be none."""
        self.close()
        family = socket.AF_INET6 if ":" in self._address[0] else socket.AF_INET
        new = socket.socket(family, socket.SOCK_DGRAM)
        try:
            new.setblocking(False)
            new.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
            new.connect(self._address)
        except OSError as error:
            new.close()
            self.fault = _describe(error)
        else:
            self._socket, self.fault = new, ""

    def send(self, datagram: bytes) -> None:
        """Send; the result is in ``fault``."""
        if self._socket is None:
            self.connect()
        if self._socket is None:
            return
        try:
            self._send_again_if_refused(self._socket, datagram)
        except BlockingIOError:
            pass
        except ConnectionRefusedError as error:
            self.fault = _describe(error)
        except OSError as error:
            self.close()
            self.fault = _describe(error)

    def _send_again_if_refused(self, connected: socket.socket, datagram: bytes) -> None:
        """The kernel reports the refusal of the last datagram instead of sending this one."""
        try:
            connected.send(datagram)
            self.fault = ""
        except ConnectionRefusedError as error:
            self.fault = _describe(error)
            connected.send(datagram)

    def close(self) -> None:
        if self._socket is not None:
            with suppress(OSError):
                self._socket.close()
            self._socket = None


def _describe(error: OSError) -> str:
    return error.strerror or str(error)
