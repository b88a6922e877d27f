"""Real ports, by which emulated devices send to other equipment: serial ports, CAN adapters, network addresses.

``[port.LINK]`` of a scenario replaces the pty, loopback address or local bus of a link of the configuration, so that
other equipment, such as the daemon on another computer, receives the emulated devices.
"""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import struct
import termios
from typing import Annotated

from fti.config import CanLink, Link, SerialLink, StrictModel, UdpLink
from fti.config.endpoints import Endpoint as Address
from fti.config.keys import NO_UNIT, key
from fti.errors import ConfigError, LinkError, MissingError
from fti.hil.ports.serial_base import Notifier, Responder, SerialEndpoint
from fti.links.serial import open_port

POLL_S = 0.02


class RealPort(StrictModel):
    """``[port.NAME]``: the real port of the link NAME, for external equipment.

    A serial link needs device, a CAN link device and interface, a UDP link to; no other key is allowed.
    """

    device: Annotated[
        str | None,
        key(
            "of a serial link: device file of the emulator's end of the cable; of a CAN link: channel of its adapter",
            NO_UNIT,
            "/dev/ttyUSB3",
        ),
    ] = None
    interface: Annotated[str | None, key("of a CAN link: interface of python-can", NO_UNIT, instead="socketcan")] = None
    to: Annotated[
        Address | None, key("of a UDP link: address and port of the receiver", NO_UNIT, instead="192.168.10.1:4000")
    ] = None

    def check(self, link: Link, where: str) -> None:
        """Raises ConfigError unless it has exactly the keys for this kind of link."""
        needed = {SerialLink: {"device"}, CanLink: {"device", "interface"}, UdpLink: {"to"}}[type(link)]
        if set(self.model_dump(exclude_none=True)) != needed:
            keys = " and ".join(sorted(needed))
            raise ConfigError(f"{where}: a {link.kind} link needs {keys}; no other key is allowed")


class TtyEndpoint(SerialEndpoint):
    """The emulator's end of a cable: a serial port with the settings of the link.  Its UART limits the rate."""

    def __init__(self, link: SerialLink, device: str, respond: Responder, notify: Notifier) -> None:
        super().__init__(link.name, respond, 0.0, "", notify)
        self._settings = link.model_copy(update={"port": device})

    async def open(self) -> None:
        """Open the port."""
        try:
            self._port = open_port(self._settings)
        except LinkError as error:
            raise MissingError(f"link {self._name!r}: {error}") from None
        self._fd = self._port.fileno()
        self._start_reading()

    async def wait_for_reader(self) -> None:
        """Return at once: a reader at a cable is not visible."""

    async def drain(self) -> None:
        """Wait until the UART has sent everything."""
        while self._pacer or _unsent_bytes(self._fd):  # noqa: ASYNC110  the driver does not signal it
            await asyncio.sleep(POLL_S)

    def close(self) -> None:
        """Close the port and discard unsent bytes, so that a stopped line does not block."""
        if self._fd < 0:
            return
        self._unregister()
        with contextlib.suppress(termios.error):  # a removed port
            termios.tcflush(self._fd, termios.TCOFLUSH)
        self._port.close()
        self._fd = -1


def _unsent_bytes(descriptor: int) -> int:
    try:
        count: int = struct.unpack("i", fcntl.ioctl(descriptor, termios.TIOCOUTQ, bytes(4)))[0]
    except OSError:  # a removed port
        return 0
    return count
