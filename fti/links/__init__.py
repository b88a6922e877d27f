"""Links: serial, UDP, CAN.  The only code that touches a port.

``open_link`` creates the link of a configuration; its task is ``run``.  A port that is absent, denied, busy or lost is
retried until the task is cancelled; ``status`` holds the state of the link with a hint, and its counters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from fti import config
from fti.clock import Clock
from fti.links._beat_scheduler import add_beat_callbacks, remove_beat_callbacks
from fti.links.base import LinkStatus, Sink, per_frame_sink

__all__ = ["Link", "LinkStatus", "Sink", "add_beat_callbacks", "open_link", "per_frame_sink", "remove_beat_callbacks"]


class Link(Protocol):
    """One link; ``fti.links.base.BaseLink`` documents the details."""

    name: str
    status: LinkStatus
    on_sent: Sink | None
    urgent: bool

    async def run(self) -> None:
        """Open, read, reconnect after a loss; cancellation closes everything."""

    async def send(self, data: bytes, timeout_s: float = 1.0) -> int:
        """Send.  Raises LinkError when sending is not possible now, ValueError when this link may not send."""

    async def drain(self) -> None:
        """Read the remaining data of the kernel before ``run`` is cancelled; sending is refused from now on."""


def open_link(link: config.Link, clock: Clock, sink: Sink, *, on_connect: Sequence[bytes] = ()) -> Link:
    """The link of a configuration; nothing is opened before ``run``.

    sink       : receives reads, datagrams or CAN frames (little-endian ``can_frame``) and arrival times [ns]: ``Sink``
    on_connect : sent after every connect, when the link may send
    Raises ConfigError when the configuration is invalid for this kind of link.
    """
    # Libraries are imported only for the kinds of links that are configured: the recorder starts faster.
    if isinstance(link, config.SerialLink):
        if link.half_duplex or link.echo:
            from fti.links.half_duplex import HalfDuplexLink  # noqa: PLC0415

            return HalfDuplexLink(link, clock, sink, on_connect)
        from fti.links.serial import SerialPortLink  # noqa: PLC0415

        return SerialPortLink(link, clock, sink, on_connect)
    if isinstance(link, config.UdpLink):
        from fti.links.udp import UdpSocketLink  # noqa: PLC0415

        return UdpSocketLink(link, clock, sink, on_connect)
    if link.interface == "slcan":
        from fti.links.slcan import SlcanLink  # noqa: PLC0415

        return SlcanLink(link, clock, sink, on_connect)
    from fti.links.can import CanBusLink  # noqa: PLC0415

    return CanBusLink(link, clock, sink, on_connect)
