"""The state of each device, from what its decoder counts, with a hint for the person at the connector."""

from __future__ import annotations

import contextlib
from collections import deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from fti import drivers
from fti.config import Config
from fti.drivers import Decoder
from fti.service.navigation.clock_status import clock_status
from fti.service.navigation.decode_chain import GAP, Chain, DeviceDecoder
from fti.types import LinkState, RawFrame

#: A state is judged over so many health reports (twice a second).
WINDOW = 8
#: Reports of a navigation that stood still in between hold less time than that: too little for a rate.
MIN_RATE_SPAN_NS = 2_000_000_000
SILENT_NS = 1_000_000_000
MIN_OBSERVATION_NS = 3 * SILENT_NS
#: Bytes of a link kept for trying other drivers on.
RECENT_BYTES = 8192
BAD_SHARE = 0.05
RATE_TOLERANCE = 0.3
NO_FRAME_REASONS = frozenset({"no_sync", "no_beginning", "other_id", "other_line", "comment", GAP})
#: The hint beside a device that waits to be asked where nothing may be sent.
POLLING_BLOCKED = "it must be asked, and nothing may be sent on its link: set transmit = true there"


class CounterSample(NamedTuple):
    """What a decoder had counted at one health report."""

    bytes_in: int
    framed: int
    bad: int
    messages: dict[str, int]


@dataclass(slots=True)
class CounterHistory:
    """What a decoder had counted at the last health reports.

    times_ns : up to when everything that arrived had been counted: a navigation that catches up counts many seconds of
    messages in one, and their rate is what it was
    """

    times_ns: deque[int] = field(default_factory=lambda: deque(maxlen=WINDOW))
    counts: deque[CounterSample] = field(default_factory=lambda: deque(maxlen=WINDOW))


def default_decoders(carrier: str) -> dict[str, Decoder]:
    """A decoder of every driver that can be on such a link and needs no options."""
    found = {}
    for name in drivers.names():
        driver = drivers.load(name)
        if carrier not in driver.CARRIERS:
            continue
        with contextlib.suppress(ValueError):  # it needs options
            found[name] = driver.make_decoder(driver.Options())
    return found


def guess_drivers(data: bytes, carrier: str) -> list[str]:
    """Names of the drivers that find messages in these bytes, most first; those that need options are not tried."""
    found: list[tuple[int, str]] = []
    for name, decoder in default_decoders(carrier).items():
        decoder.feed(data, 0)
        if decoder.counters.framed * 2 > len(data):
            found.append((decoder.counters.framed, name))
    return [name for _, name in sorted(found, reverse=True)]


class DeviceMonitor:
    """Looks at the listeners of a chain twice a second."""

    def __init__(self, config: Config, chain: Chain) -> None:
        self._chain = chain
        self._kinds = {link.name: link.kind for link in config.link}
        mute = {link.name for link in config.link if not link.transmit}
        self._unpolled = {
            device_decoder.name
            for device_decoder in chain.device_decoders
            if device_decoder.bound.device.link in mute and device_decoder.bound.needs_polling()
        }
        self._past = {device_decoder.name: CounterHistory() for device_decoder in chain.device_decoders}
        self._recent: dict[str, bytearray] = {}  # the last bytes of links on which something is unclear
        self._last_rx_ns: dict[str, int] = {}
        self._first_ns: int | None = None  # nothing has been counted yet
        self._counted_ns: int | None = None

    def feed(self, frame: RawFrame) -> None:
        """Note that a frame arrived; keep its bytes when its link is unclear."""
        self._last_rx_ns[frame.link] = frame.t_rx_ns
        self._first_ns = self._first_ns or frame.t_rx_ns
        self._counted_ns = max(self._counted_ns or 0, frame.t_rx_ns)
        recent = self._recent.get(frame.link)
        if recent is not None:
            recent += frame.data
            del recent[:-RECENT_BYTES]

    def devices(self, now_ns: int) -> dict[str, dict[str, Any]]:
        """Health of every device."""
        return {
            device_decoder.name: self._device(device_decoder, now_ns) for device_decoder in self._chain.device_decoders
        }

    def _device(self, device_decoder: DeviceDecoder, now_ns: int) -> dict[str, Any]:
        counters, device = device_decoder.decoder.counters, device_decoder.bound.device
        past = self._past[device_decoder.name]
        bad = sum(n for reason, n in counters.skipped.items() if reason not in NO_FRAME_REASONS)
        if self._counted_ns is not None:
            past.times_ns.append(self._counted_ns)
            past.counts.append(CounterSample(counters.bytes_in, counters.framed, bad, dict(counters.messages)))
        rate = _rate_hz(past)
        state, hint = self._judge(device_decoder, past, rate)
        if state is LinkState.SILENT and device_decoder.name in self._unpolled:
            hint = f"{hint}; {POLLING_BLOCKED}"
        return {
            "link": device.link,
            "driver": device.driver,
            "state": state,
            "hint": hint,
            "is_known": self._is_known,
            "messages": device_decoder.messages,
            "rate_hz": rate,
            "age_ms": None if device_decoder.last_ns is None else (now_ns - device_decoder.last_ns) / 1e6,
            "bytes_in": counters.bytes_in,
            "framed": counters.framed,
            "held": counters.held,
            "skipped": dict(counters.skipped),
            "clocks": [
                clock_status(known, used=device.use_device_time)
                for known in self._chain.clocks_of(device_decoder.name, now_ns)
            ],
        }

    @property
    def _is_known(self) -> bool:
        """Navigation has taken enough to know which devices are silent."""
        return (self._counted_ns or 0) - (self._first_ns or 0) > MIN_OBSERVATION_NS

    def _judge(self, device_decoder: DeviceDecoder, past: CounterHistory, rate: float) -> tuple[LinkState, str]:
        """By what navigation has taken: one that is behind does not know that a link is silent."""
        device = device_decoder.bound.device
        heard = self._last_rx_ns.get(device.link)
        if heard is None or (self._counted_ns or 0) - heard > SILENT_NS:
            self._recent.pop(device.link, None)
            return LinkState.SILENT, "no bytes on the link; is the device powered, and the cable in?"
        first, last = past.counts[0], past.counts[-1]
        bytes_in, framed, bad = last.bytes_in - first.bytes_in, last.framed - first.framed, last.bad - first.bad
        if framed <= 0 and len(past.times_ns) > 2:
            return self._judge_unframed(device_decoder, bytes_in)
        self._recent.pop(device.link, None)
        if bad > BAD_SHARE * max(bytes_in, 1):
            return (
                LinkState.INVALID,
                f"{100 * bad / bytes_in:.0f} % of the bytes are damaged; look at cable and baud rate",
            )
        if device.rate_hz and _has_enough_data(past) and abs(rate / device.rate_hz - 1) > RATE_TOLERANCE:
            return LinkState.WRONG_RATE, f"{rate:.1f} messages a second where rate_hz = {device.rate_hz:g}"
        return LinkState.GOOD, ""

    def _judge_unframed(self, device_decoder: DeviceDecoder, bytes_in: int) -> tuple[LinkState, str]:
        """Bytes, but no frame of this device."""
        device = device_decoder.bound.device
        carrier = self._kinds[device.link]
        if carrier == "can" or bytes_in == 0:
            return LinkState.SILENT, "the link is alive, but nothing on it is from this device"
        recent = self._recent.setdefault(device.link, bytearray())
        others = [name for name in guess_drivers(bytes(recent), carrier) if name != device.driver]
        if others:
            return LinkState.NOISE, f"not {device.driver}; it looks like {' or '.join(others)}: wrong cable?"
        return LinkState.NOISE, f"bytes, but no frame of {device.driver}: look at baud rate, inversion and driver"


def _has_enough_data(past: CounterHistory) -> bool:
    """Is the window full, and does it hold time enough for a rate?"""
    return len(past.times_ns) == WINDOW and past.times_ns[-1] - past.times_ns[0] >= MIN_RATE_SPAN_NS


def _rate_hz(past: CounterHistory) -> float:
    """Rate of the most frequent message over the window [Hz]."""
    span = past.times_ns[-1] - past.times_ns[0] if past.times_ns else 0
    if span <= 0:
        return 0.0
    first, last = past.counts[0].messages, past.counts[-1].messages
    return max((n - first.get(name, 0) for name, n in last.items()), default=0) * 1e9 / span
