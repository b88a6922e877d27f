"""Show the data that arrive on a link or port, and which drivers can decode them.

  fti listen radalt_line --config configs/bench.toml
  fti listen /dev/ttyUSB0 --baud 57600 --duration 10
  fti listen 127.0.0.1:4000
  fti listen can0

Standard output: one line per 16 bytes, with the time since the start [s], as hexadecimal and text; a CAN frame as
identifier and data.  Standard error, every second and at the end: received frames and bytes, and each driver that
found frames, with its messages and the bytes that they cover.  Drivers with mandatory options are not tried.  Ends
after --duration, or with Ctrl-C.  Nothing is sent, except to an slcan adapter: commands that open it and read its
status.
"""

from __future__ import annotations

import argparse
import asyncio
from typing import TYPE_CHECKING

from fti.cli._arguments import seconds, whole_number
from fti.cli._printing import print_line

if TYPE_CHECKING:
    from fti.config import CanLink, SerialLink, UdpLink
    from fti.links import Link

REPORT_S = 1.0
POLL_S = 0.05
WIDTH = 16


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti listen``."""
    parser.add_argument(
        "target", metavar="LINK|PORT", help="link of the configuration, tty, address:port, CAN interface"
    )
    parser.add_argument("--config", metavar="CONFIG", help="configuration that defines LINK")
    parser.add_argument(
        "--baud", type=whole_number(50, 100_000_000), metavar="N", help="baud rate (default: configured, or 115200)"
    )
    parser.add_argument("--duration", type=seconds, metavar="S", help="end after S seconds")


def run(args: argparse.Namespace) -> int:
    """Listen until the duration ends."""
    link = find_link(args.target, args.config, args.baud)
    listener = LinkListener(link.kind)
    try:
        asyncio.run(_listen(link, listener, args.duration))
    except KeyboardInterrupt:
        listener.report()
        raise
    listener.report()
    return 0


def find_link(target: str, config: str | None, baud: int | None) -> SerialLink | UdpLink | CanLink:
    """The link of LINK|PORT; it never sends.  Raises ConfigError or MissingError."""
    from fti import config as configuration
    from fti.errors import MissingError

    if config:
        links = {link.name: link for link in configuration.load(config).link}
        if target not in links:
            raise MissingError(f"{config}: no link {target!r}; configured: {', '.join(links) or 'none'}")
        changes: dict[str, object] = {"transmit": False}
        if baud and links[target].kind == "serial":
            changes["baud"] = baud
        return links[target].model_copy(update=changes)
    return _port_link(target, baud)


def _port_link(target: str, baud: int | None) -> SerialLink | UdpLink | CanLink:
    """A link to a port that is given directly."""
    from fti import config as configuration
    from fti.errors import MissingError
    from fti.links.ports import can_interfaces, serial_names

    interfaces = [port.name for port in can_interfaces()]
    if "/" in target:
        table: dict[str, object] = {"kind": "serial", "port": target, **({"baud": baud} if baud else {})}
    elif target in interfaces:
        table = {"kind": "can", "interface": "socketcan", "channel": target}
    elif ":" in target:
        table = {"kind": "udp", "bind": target}
    else:
        ports = ", ".join([*serial_names(), *interfaces]) or "none"
        raise MissingError(f"{target}: not a port and not address:port; for a link give --config; ports: {ports}")
    session = {"session": {"name": "listen"}, "link": [{"name": "port", **table}]}
    return configuration.bind(configuration.Config, session, "fti listen").link[0]


async def _listen(config: SerialLink | UdpLink | CanLink, listener: LinkListener, duration: float | None) -> None:
    from fti.clock import SystemClock, choose_epoch_ns
    from fti.links import open_link, per_frame_sink

    clock = SystemClock(choose_epoch_ns())
    listener.start_ns = clock.now_ns()
    link = open_link(config, clock, per_frame_sink(listener.on_frame))
    running = asyncio.create_task(link.run(), name="listen")
    watching = asyncio.create_task(_watch(link, listener), name="watch")
    try:
        await asyncio.wait([running, watching], timeout=duration, return_when=asyncio.FIRST_COMPLETED)
        await link.drain()
    finally:
        ended = [task for task in (running, watching) if task.done()]
        for task in (running, watching):
            task.cancel()
        await asyncio.gather(running, watching, return_exceptions=True)
    for task in ended:
        task.result()


async def _watch(link: Link, listener: LinkListener) -> None:
    """Report every second; a port that cannot be opened at all ends it.  Raises LinkError."""
    from fti.errors import LinkError
    from fti.links.base import NOT_OPENED

    loop = asyncio.get_running_loop()
    due, last_hint = loop.time() + REPORT_S, ""
    while True:
        await asyncio.sleep(POLL_S)
        status = link.status
        if not status.connects and status.hint != NOT_OPENED:
            raise LinkError(status.hint)
        if loop.time() < due:
            continue
        due += REPORT_S
        if status.hint and status.hint != last_hint:
            listener.print_note(f"{status.state}: {status.hint}")
        last_hint = status.hint
        listener.report()


class LinkListener:
    """Prints the received data and tries the drivers on them."""

    def __init__(self, carrier: str) -> None:
        self.start_ns = 0
        self.frames = self.bytes = 0
        from fti.service.navigation.device_monitor import default_decoders

        self._carrier = carrier
        self._decoders = default_decoders(carrier)

    def on_frame(self, data: bytes, t_rx_ns: int) -> None:
        """One frame of the link."""
        self.frames += 1
        self.bytes += len(data)
        for line in frame_lines(data, self._carrier):
            print_line(f"{(t_rx_ns - self.start_ns) / 1e9:12.6f}  {line}")
        for decoder in self._decoders.values():
            decoder.feed(data, t_rx_ns)

    def report(self) -> None:
        """Print received frames and bytes so far, and the drivers that decoded them."""
        self.print_note(f"{self.frames} frames, {self.bytes} bytes")
        for name, decoder in self._decoders.items():
            counters = decoder.counters
            if messages := sum(counters.messages.values()):
                self.print_note(f"  {name}: {messages} messages, {counters.framed} of {counters.bytes_in} bytes")

    @staticmethod
    def print_note(text: str) -> None:
        """Print on standard error, after flushing standard output."""
        import sys

        sys.stdout.flush()
        print_line(text, error=True, flush=True)


def frame_lines(data: bytes, carrier: str) -> list[str]:
    """The lines for one frame."""
    if carrier == "can":
        from fti.canframe import unpack_can

        frame = unpack_can(data)
        kind = "error" if frame.error else "remote" if frame.remote else "fd" if frame.fd else ""
        name = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:03X}"
        return [f"{name:>8}  [{len(frame.data)}]  {frame.data.hex(' ')}  {kind}".rstrip()]
    parts = [data[at : at + WIDTH] for at in range(0, len(data), WIDTH)] or [b""]
    return [f"{part.hex(' '):<{3 * WIDTH}} {_text(part)}" for part in parts]


def _text(data: bytes) -> str:
    return "".join(chr(byte) if 32 <= byte < 127 else "." for byte in data)
