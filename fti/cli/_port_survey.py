"""Finds out which device sends on a port: opens it at one baud rate after the other, and tries the drivers."""

from __future__ import annotations

import asyncio
import contextlib
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from fti import config as configuration
from fti.clock import SystemClock, choose_epoch_ns
from fti.constants import SECOND_NS
from fti.errors import LinkError
from fti.links import open_link, per_frame_sink
from fti.messages.frames import LinkState
from fti.messages.measurements import Measurement
from fti.service.navigation.device_monitor import default_decoders

#: Tried in this order, until a driver decodes most bytes.
BAUD_RATES = (115200, 57600, 38400, 9600, 230400, 460800, 921600, 19200, 4800)
#: Decodes nearly every bus with its default file: only where nothing else does.
GENERIC = "dbc"
#: Share of the bytes that a driver must decode.
MIN_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class FoundDevice:
    """A driver that decodes the bytes of a port.

    share : decoded bytes of all; rate_hz : of its most frequent message; kinds : classes of its measurements
    """

    driver: str
    share: float
    rate_hz: float
    kinds: frozenset[type[Measurement]]


@dataclass(frozen=True, slots=True)
class FoundPort:
    """A port.  link : its table in the configuration; received : bytes; device : None if no driver decodes them

    fault, is_busy : why it could not be opened, and whether another program uses it
    """

    link: Mapping[str, Any]
    received: int
    device: FoundDevice | None = None
    fault: str = ""
    is_busy: bool = False


class _Listener:
    """Feeds every driver that needs no options.  received : bytes"""

    def __init__(self, carrier: str) -> None:
        self.received = 0
        self._times_ns: list[int] = []  # of the first and the last frame
        self._first: dict[str, Counter[str]] = {}  # messages in the first frame
        self._decoders = default_decoders(carrier)
        self._kinds: dict[str, set[type[Measurement]]] = {name: set() for name in self._decoders}

    def on_frame(self, data: bytes, t_rx_ns: int) -> None:
        self.received += len(data)
        self._times_ns[1:] = [t_rx_ns]
        for name, decoder in self._decoders.items():
            self._kinds[name].update(type(m) for m in decoder.feed(data, t_rx_ns))
        if len(self._times_ns) == 1:  # it may hold what came before the port was opened
            self._first = {name: decoder.counters.messages.copy() for name, decoder in self._decoders.items()}

    def best(self) -> FoundDevice | None:
        """The driver that decodes most bytes; None if none decodes enough."""
        found = []
        duration_s = (self._times_ns[-1] - self._times_ns[0]) / SECOND_NS if len(self._times_ns) > 1 else 0.0
        for name, decoder in self._decoders.items():
            counters = decoder.counters
            share = counters.framed / counters.bytes_in if counters.bytes_in else 0.0
            if counters.messages and share >= MIN_SHARE:
                rate = (
                    max((counters.messages - self._first[name]).values(), default=0) / duration_s if duration_s else 0.0
                )
                found.append(FoundDevice(name, share, rate, frozenset(self._kinds[name])))
        return max(found, key=lambda each: (each.driver != GENERIC, each.share, len(each.kinds)), default=None)


async def survey(links: list[dict[str, Any]], duration_s: float, on_share: Callable[[float], None]) -> list[FoundPort]:
    """Listen on all ports at the same time, duration_s [s] for each baud rate; nothing is sent to a serial line.

    links : tables of links; on_share : called with the completed share of the time, 0 to 1
    """
    for kind in {link["kind"] for link in links}:
        default_decoders(kind)  # loads the drivers: while a port is open, its bytes would wait
    tries, longest = 0, max(len(_tables(link)) for link in links)

    async def listen_in_turn(link: dict[str, Any]) -> FoundPort:
        nonlocal tries
        best = FoundPort(link, 0)
        for number, table in enumerate(_tables(link), 1):
            port = await _listen(table, duration_s)
            if number > tries:
                tries = number
                on_share(tries / longest)
            if port.device or port.received > best.received or port.fault:
                best = port
            if port.device or port.fault:
                break
        return best

    return await asyncio.gather(*(listen_in_turn(link) for link in links))


def _tables(link: dict[str, Any]) -> list[dict[str, Any]]:
    """The link, at each baud rate."""
    return [{**link, "baud": baud} for baud in BAUD_RATES] if link["kind"] == "serial" else [link]


def describe(port: FoundPort) -> str:
    """A port in one line."""
    link = port.link
    where = str(link.get("port") or link.get("bind") or link["channel"])
    if device := port.device:
        baud = f" at {link['baud']} baud" if "baud" in link else ""
        return f"{where}: {device.driver}{baud}, {device.share:.0%} of {port.received} bytes, {device.rate_hz:.1f} Hz"
    silence = f"{port.received} bytes that no driver decodes" if port.received else "no bytes"
    return f"{where}: {port.fault.removeprefix(f'{where}: ') or silence}"


async def _listen(table: dict[str, Any], duration_s: float) -> FoundPort:
    content = {"session": {"name": "survey"}, "link": [{"name": "port", **table}]}
    link = configuration.bind(configuration.Config, content, "fti new").link[0]
    listener = _Listener(link.kind)
    opened = open_link(link, SystemClock(choose_epoch_ns()), per_frame_sink(listener.on_frame))
    running = asyncio.create_task(opened.run(), name="survey")
    try:
        await asyncio.wait([running], timeout=duration_s)
    finally:
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError, LinkError):
            await running
    fault = "" if opened.status.connects else opened.status.hint
    return FoundPort(table, listener.received, listener.best(), fault, opened.status.state == LinkState.BUSY)
