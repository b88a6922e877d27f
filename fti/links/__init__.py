"""Links: serial, UDP, CAN.  The only code that touches a port.

``open_link`` makes the link of a configuration; its task is ``run``.  A port that is absent, denied, busy or lost is
tried again until the task is cancelled; ``status`` says in which state the link is, with a hint, and counts.
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
    """One link; see ``fti.links.base.BaseLink`` for what each does exactly."""

    name: str
    status: LinkStatus
    on_sent: Sink | None
    urgent: bool

    async def run(self) -> None:
        """Open, read, come back when lost; until cancelled, then everything is closed."""

    async def send(self, data: bytes, timeout_s: float = 1.0) -> int:
        """Send; LinkError when it cannot be done now, ValueError when this link may not send."""

    async def drain(self) -> None:
        """Read what the kernel still holds, before ``run`` is cancelled; nothing is sent from now on."""


def open_link(link: config.Link, clock: Clock, sink: Sink, *, on_connect: Sequence[bytes] = ()) -> Link:
    """The link of a configuration; nothing is opened before ``run``.

    sink       : gets reads, datagrams or CAN frames (little-endian ``can_frame``) and their arrivals [ns]; see ``Sink``
    on_connect : sent after every connect, when the link may send
    Raises ConfigError when the configuration can never work.
    """
    # The libraries of a kind of link are loaded when there is such a link: the recorder starts in less time.
    if isinstance(link, config.SerialLink):
        if link.half_duplex or link.echo:
            from fti.links.half_duplex import HalfDuplexLink  # noqa: PLC0415

            return HalfDuplexLink(link, clock, sink, on_connect)
        from fti.links.serial import SerialPortLink  # noqa: PLC0415

        return SerialPortLink(link, clock, sink, on_connect)
    if isinstance(link, config.UdpLink):
        from fti.links.udp import UdpLink  # noqa: PLC0415

        return UdpLink(link, clock, sink, on_connect)
    if link.interface == "slcan":
        from fti.links.slcan import SlcanLink  # noqa: PLC0415

        return SlcanLink(link, clock, sink, on_connect)
    from fti.links.can import CanBusLink  # noqa: PLC0415

    return CanBusLink(link, clock, sink, on_connect)
