"""The state of each device, from the counters of its decoder, with a hint for the operator."""

from __future__ import annotations

import contextlib
from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

from fti import drivers
from fti.config import Config
from fti.drivers import Decoder
from fti.formats.device_time import GPS_EPOCH_UTC_NS, LEAP_NS
from fti.messages.frames import LinkState, RawFrame
from fti.messages.health import ClockHealth, DeviceHealth
from fti.messages.measurements import TimeScale
from fti.messages.notes import ClockEstimate
from fti.service.navigation.decode_chain import GAP, Chain, DeviceDecoder

#: Number of health reports (twice a second) for the assessment of a state.
WINDOW = 8
#: Minimum time span for a rate; reports after a standstill of navigation span less.
MIN_RATE_SPAN_NS = 2_000_000_000
SILENT_NS = 1_000_000_000
MIN_OBSERVATION_NS = 3 * SILENT_NS
#: Bytes of a link stored for trying other drivers.
RECENT_BYTES = 8192
BAD_SHARE = 0.05
RATE_TOLERANCE = 0.3
NO_FRAME_REASONS = frozenset({"no_sync", "no_beginning", "other_id", "other_line", "comment", GAP})
#: The hint for a polled device on a link that does not transmit.
POLLING_BLOCKED = "the device must be polled, but its link does not transmit: set transmit = true"


class CounterSample(NamedTuple):
    """Counters of a decoder at one health report."""

    bytes_in: int
    framed: int
    bad: int
    messages: dict[str, int]


@dataclass(slots=True)
class CounterHistory:
    """Counters of a decoder at the last health reports.

    times_ns : arrival time of the last counted frame, not the time of the report: navigation may catch up
    """

    times_ns: deque[int] = field(default_factory=lambda: deque(maxlen=WINDOW))
    counts: deque[CounterSample] = field(default_factory=lambda: deque(maxlen=WINDOW))


def default_decoders(carrier: str) -> dict[str, Decoder]:
    """A decoder of every driver for this kind of link that needs no options."""
    found = {}
    for name in drivers.names():
        driver = drivers.load(name)
        if carrier not in driver.CARRIERS:
            continue
        with contextlib.suppress(ValueError):  # it needs options
            found[name] = driver.make_decoder(driver.Options())
    return found


def guess_drivers(data: bytes, carrier: str) -> list[str]:
    """Names of the drivers that find messages in these bytes, best match first; only drivers without options."""
    found: list[tuple[int, str]] = []
    for name, decoder in default_decoders(carrier).items():
        decoder.feed(data, 0)
        if decoder.counters.framed * 2 > len(data):
            found.append((decoder.counters.framed, name))
    return [name for _, name in sorted(found, reverse=True)]


class DeviceMonitor:
    """Assesses the device decoders of a chain twice a second."""

    def __init__(self, config: Config, chain: Chain) -> None:
        self._chain = chain
        self._kinds = {link.name: link.kind for link in config.link}
        silent_links = {link.name for link in config.link if not link.transmit}
        self._unpolled = {
            device_decoder.name
            for device_decoder in chain.device_decoders
            if device_decoder.bound.device.link in silent_links and device_decoder.bound.needs_polling()
        }
        self._past = {device_decoder.name: CounterHistory() for device_decoder in chain.device_decoders}
        self._recent: dict[str, bytearray] = {}  # the last bytes of links without frames
        self._last_rx_ns: dict[str, int] = {}
        self._first_ns: int | None = None  # nothing has been counted yet
        self._counted_ns: int | None = None

    def feed(self, frame: RawFrame) -> None:
        """Count a frame; store its bytes if its link has no frames of its device."""
        self._last_rx_ns[frame.link] = frame.t_rx_ns
        self._first_ns = self._first_ns or frame.t_rx_ns
        self._counted_ns = max(self._counted_ns or 0, frame.t_rx_ns)
        recent = self._recent.get(frame.link)
        if recent is not None:
            recent += frame.data
            del recent[:-RECENT_BYTES]

    def devices(self, now_ns: int) -> dict[str, DeviceHealth]:
        """Health of every device."""
        return {
            device_decoder.name: self._device(device_decoder, now_ns) for device_decoder in self._chain.device_decoders
        }

    def _device(self, device_decoder: DeviceDecoder, now_ns: int) -> DeviceHealth:
        counters, device = device_decoder.decoder.counters, device_decoder.bound.device
        past = self._past[device_decoder.name]
        bad = sum(n for reason, n in counters.skipped.items() if reason not in NO_FRAME_REASONS)
        if self._counted_ns is not None:
            past.times_ns.append(self._counted_ns)
            past.counts.append(CounterSample(counters.bytes_in, counters.framed, bad, dict(counters.messages)))
        rate = _rate_hz(past)
        state, hint = self._assess(device_decoder, past, rate)
        if state is LinkState.SILENT and device_decoder.name in self._unpolled:
            hint = f"{hint}; {POLLING_BLOCKED}"
        return DeviceHealth(
            link=device.link,
            driver=device.driver,
            state=state,
            hint=hint,
            # navigation has processed enough time to know which devices are silent
            is_known=(self._counted_ns or 0) - (self._first_ns or 0) > MIN_OBSERVATION_NS,
            messages=device_decoder.messages,
            rate_hz=rate,
            age_ms=None if device_decoder.last_ns is None else (now_ns - device_decoder.last_ns) / 1e6,
            bytes_in=counters.bytes_in,
            framed=counters.framed,
            held=counters.held,
            skipped=dict(counters.skipped),
            clocks=tuple(
                clock_status(known, used=device.use_device_time)
                for known in self._chain.clocks_of(device_decoder.name, now_ns)
            ),
        )

    def _assess(self, device_decoder: DeviceDecoder, past: CounterHistory, rate: float) -> tuple[LinkState, str]:
        """Assess up to the last processed frame: navigation that is behind cannot know that a link is silent."""
        device = device_decoder.bound.device
        last_rx_ns = self._last_rx_ns.get(device.link)
        if last_rx_ns is None or (self._counted_ns or 0) - last_rx_ns > SILENT_NS:
            self._recent.pop(device.link, None)
            return LinkState.SILENT, "no bytes on the link; is the device powered, and the cable in?"
        first, last = past.counts[0], past.counts[-1]
        bytes_in, framed, bad = last.bytes_in - first.bytes_in, last.framed - first.framed, last.bad - first.bad
        if framed <= 0 and len(past.times_ns) > 2:
            return self._assess_unframed(device_decoder, bytes_in)
        self._recent.pop(device.link, None)
        if bad > BAD_SHARE * max(bytes_in, 1):
            return (
                LinkState.INVALID,
                f"{100 * bad / bytes_in:.0f} % of the bytes are damaged; look at cable and baud rate",
            )
        if device.rate_hz and _has_enough_data(past) and abs(rate / device.rate_hz - 1) > RATE_TOLERANCE:
            return LinkState.WRONG_RATE, f"{rate:.1f} messages/s; configured: rate_hz = {device.rate_hz:g}"
        return LinkState.GOOD, ""

    def _assess_unframed(self, device_decoder: DeviceDecoder, bytes_in: int) -> tuple[LinkState, str]:
        """The state of a device whose link has bytes, but no frame of it."""
        device = device_decoder.bound.device
        carrier = self._kinds[device.link]
        if carrier == "can" or bytes_in == 0:
            return LinkState.SILENT, "the link is active, but has no data of this device"
        recent = self._recent.setdefault(device.link, bytearray())
        candidates = [name for name in guess_drivers(bytes(recent), carrier) if name != device.driver]
        if candidates:
            return LinkState.NOISE, f"not {device.driver}; it looks like {' or '.join(candidates)}: wrong cable?"
        return LinkState.NOISE, f"bytes, but no frame of {device.driver}: look at baud rate, inversion and driver"


def _has_enough_data(past: CounterHistory) -> bool:
    """Is the window full, and its time span sufficient for a rate?"""
    return len(past.times_ns) == WINDOW and past.times_ns[-1] - past.times_ns[0] >= MIN_RATE_SPAN_NS


def _rate_hz(past: CounterHistory) -> float:
    """Rate of the most frequent message in the window [Hz]."""
    span = past.times_ns[-1] - past.times_ns[0] if past.times_ns else 0
    if span <= 0:
        return 0.0
    first, last = past.counts[0].messages, past.counts[-1].messages
    return max((n - first.get(name, 0) for name, n in last.items()), default=0) * 1e9 / span


NS_PER_MS = 1e6


def clock_status(known: ClockEstimate, *, used: bool) -> ClockHealth:
    """Health of a clock.  used : validity times are taken from it (``use_device_time``)"""
    offset_ns = known.offset_ns + (GPS_EPOCH_UTC_NS - LEAP_NS if known.scale == TimeScale.GPS else 0)
    return ClockHealth(
        scale=known.scale,
        state=known.state,
        used=used,
        offset_ms=offset_ns / NS_PER_MS,
        offset_sd_ms=None if known.offset_sd_ns is None else known.offset_sd_ns / NS_PER_MS,
        drift_ppm=known.drift_ppm,
        drift_sd_ppm=known.drift_sd_ppm,
        late_share=known.late / known.messages if known.messages else 0.0,
        messages=known.messages,
        refused=known.refused,
    )
