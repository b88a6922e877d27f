"""A CAN bus through python-can: the emulator is one more node on the channel of the daemon."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable
from typing import ClassVar

import can

from fti.config import CanLink
from fti.errors import MissingError
from fti.hil.ports.datagram_base import DatagramEndpoint
from fti.hil.ports.serial_base import Notifier
from fti.links.can import pack_message, unpack_message

#: A bus that accepts no frames for this time is reported; a shorter time may be a full queue [s].
REFUSAL_TIMEOUT_S = 1.0


class CanBusEndpoint(DatagramEndpoint):
    """A node on a bus of python-can.  notify : called when the bus stops and resumes accepting frames"""

    is_stream: ClassVar[bool] = False

    def __init__(
        self, link: CanLink, respond: Callable[[bytes], list[bytes]], notify: Notifier = lambda _: None
    ) -> None:
        super().__init__()
        self._link = link
        self._respond, self._notify = respond, notify
        self._refused_since: float | None = None
        self._is_reported = False
        self._bus: can.BusABC | None = None
        self._own_frames: Counter[bytes] = Counter()  # frames that this bus will return to the sender

    async def open(self) -> None:
        """Open the channel."""
        settings = dict(self._link.settings)
        if self._link.interface == "udp_multicast":
            settings["hop_limit"] = 0
        elif self._link.bitrate and self._link.interface not in ("socketcan", "virtual"):
            settings["bitrate"] = self._link.bitrate
        try:
            self._bus = can.Bus(
                self._link.channel, self._link.interface, ignore_config=True, fd=self._link.fd, **settings
            )
        except (OSError, can.CanError) as error:
            raise MissingError(
                f"link {self._link.name!r}: {self._link.interface} channel {self._link.channel!r} "
                f"cannot be opened: {error}"
            ) from None
        if (descriptor := _descriptor(self._bus)) is not None:
            asyncio.get_running_loop().add_reader(descriptor, self._receive)

    async def wait_for_reader(self) -> None:
        """Return at once: readers of a bus are not visible."""

    async def drain(self) -> None:
        """Return at once: sent frames are on the bus."""

    def close(self) -> None:
        """Leave the bus."""
        if self._bus is None:
            return
        if (descriptor := _descriptor(self._bus)) is not None:
            asyncio.get_running_loop().remove_reader(descriptor)
        self._bus.shutdown()

    def _try_send(self, data: bytes) -> bool:
        assert self._bus is not None
        try:
            self._bus.send(unpack_message(data), timeout=0)
        except can.CanError as error:
            self._on_refused(error)
            return False
        self._on_accepted()
        if self._link.interface == "udp_multicast":
            self._own_frames[data] += 1
        self.counters.messages += 1
        self.counters.bytes += len(data)
        return True

    def _on_refused(self, error: can.CanError) -> None:
        now = asyncio.get_running_loop().time()
        self._refused_since = now if self._refused_since is None else self._refused_since
        if not self._is_reported and now - self._refused_since >= REFUSAL_TIMEOUT_S:
            self._is_reported = True
            self._notify(f"{self._link.name}: the bus accepts no frames: {error}; frames are dropped")

    def _on_accepted(self) -> None:
        self._refused_since = None
        if self._is_reported:
            self._is_reported = False
            self._notify(f"{self._link.name}: the bus accepts frames again")

    def _receive(self) -> None:
        assert self._bus is not None
        try:
            message = self._bus.recv(timeout=0)
        except can.CanError as error:  # the interface went down
            self._on_refused(error)
            return
        if message is None:
            return
        frame = pack_message(message)
        if self._own_frames[frame] > 0:
            self._own_frames[frame] -= 1
            return
        self.counters.received_bytes += len(frame)
        for answer in self._respond(frame):
            self.send(answer)


def _descriptor(bus: can.BusABC) -> int | None:
    """File descriptor for the event loop; None for interfaces without one, whose devices only send."""
    try:
        descriptor = int(bus.fileno())
    except (NotImplementedError, OSError):
        return None
    return descriptor if descriptor >= 0 else None
