"""All clocks of a session against FTI time: devices, computer, and GNSS time (source 003, figure 6.10).

Each segment of a clock is fitted over its whole length, which navigation cannot do in flight.  Raw timestamps are never
changed.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from fti.arrays import Ints
from fti.config import Device
from fti.devices import BoundDevice
from fti.drivers import Decoder
from fti.logger.reading.json_message import parse_table, using_message, whole_number
from fti.logger.reading.recording import Recording
from fti.logger.reading.session_metadata import session_metadata
from fti.messages.frames import RawFrame
from fti.messages.measurements import TimeScale
from fti.messages.topics import CLOCK_TOPIC
from fti.nav.device_time.clock_estimator import ClockEstimator, ClockSegment
from fti.nav.device_time.device_times import device_time_of

#: Called with the number of frames done.
Progress = Callable[[int], None]

PROGRESS_FRAMES = 5000
#: The real-time clock was set when it moved against the monotonic clock by more than the errors of both readings.
STEP_NS = 100_000
#: Fields of ``/fti/clock``, each with ``_ns``.
CLOCKS = ("t", "monotonic_raw", "realtime", "width")
GNSS_SCALES = (TimeScale.GPS, TimeScale.UTC)


@dataclass(slots=True)
class DeviceClockSeries:
    """The clock of a device in one scale, and all its messages: arrivals and unwrapped times of the device [ns]."""

    device: Device
    clock: ClockEstimator
    t_rx: array[int] = field(default_factory=lambda: array("q"))
    t_dev: array[int] = field(default_factory=lambda: array("q"))
    _last: tuple[int, int] | None = None

    @property
    def scale(self) -> TimeScale:
        """Scale of its time."""
        return self.clock.scale

    def feed(self, t_rx_ns: int, t_dev_ns: int) -> None:
        """Add a message; several measurements of one message count once."""
        if self._last == (t_rx_ns, t_dev_ns):
            return
        self._last = t_rx_ns, t_dev_ns
        self.clock.feed(t_rx_ns, t_dev_ns)
        self.t_rx.append(t_rx_ns)
        self.t_dev.append(t_dev_ns + self.clock.unwrap_ns)

    def delays(self, segment: ClockSegment) -> tuple[Ints, Ints]:
        """Arrivals in a segment, and the delay of each message beyond the minimum delay [ns]."""
        t_rx, t_dev = np.asarray(self.t_rx, dtype=np.int64), np.asarray(self.t_dev, dtype=np.int64)
        begin, end = np.searchsorted(t_rx, [segment.first_ns, segment.last_ns + 1])
        return t_rx[begin:end], segment.lateness_of(t_rx[begin:end], t_dev[begin:end])


@dataclass(frozen=True, slots=True)
class ComputerClock:
    """``/fti/clock`` of the session: FTI time, CLOCK_MONOTONIC_RAW and CLOCK_REALTIME [ns], shape (n,)."""

    t: Ints
    raw: Ints
    realtime: Ints
    width: Ints

    @property
    def offset(self) -> Ints:
        """CLOCK_REALTIME - FTI time [ns]."""
        return self.realtime - self.t

    @property
    def steps(self) -> list[tuple[int, int]]:
        """FTI times at which the real-time clock was set, with the size of the step [ns]."""
        changes = np.diff(self.offset)
        is_step = np.abs(changes) > STEP_NS + (self.width[1:] + self.width[:-1]) // 2
        return [(int(self.t[i + 1]), int(changes[i])) for i in np.flatnonzero(is_step)]

    @property
    def slew_ppm(self) -> float | None:
        """Rate of CLOCK_MONOTONIC against the oscillator (CLOCK_MONOTONIC_RAW), positive: faster."""
        if len(self.t) < 2:
            return None
        return 1e6 * (float(self.t[-1] - self.t[0]) / float(self.raw[-1] - self.raw[0]) - 1.0)


@dataclass(frozen=True, slots=True)
class Sync:
    """The clocks of a session.

    begin_ns : FTI time of its first frame; session_metadata : see ``fti.logger.reading.session_metadata``
    """

    begin_ns: int
    clock_series: list[DeviceClockSeries]
    computer: ComputerClock
    session_metadata: Mapping[str, str] = field(default_factory=dict)

    def gnss(self) -> DeviceClockSeries | None:
        """The clock for GNSS time: a known one, GPS before UTC, in the order of the configuration."""
        known = [h for h in self.clock_series if h.clock.segments and any(s.is_known for s in h.clock.segments)]
        return next((h for scale in GNSS_SCALES for h in known if h.scale is scale), None)


def analyse(recording: Recording, devices: list[BoundDevice], progress: Progress) -> Sync:
    """Decode everything and fit every clock.  progress : called periodically with the number of frames done"""
    collector = _ClockCollector(devices)
    begin_ns = 0
    for done, frame in enumerate(recording.frames()):
        begin_ns = begin_ns or frame.t_rx_ns
        collector.add_frame(frame)
        if done % PROGRESS_FRAMES == 0:
            progress(done)
    return Sync(begin_ns, collector.finish(), read_computer_clock(recording), session_metadata(recording))


class _ClockCollector:
    """The decoder of every device, and the clocks in its measurements."""

    def __init__(self, devices: list[BoundDevice]) -> None:
        self._devices = devices
        self._on_link: dict[str, list[tuple[Device, Decoder]]] = {}
        for bound in devices:
            self._on_link.setdefault(bound.device.link, []).append((bound.device, bound.make_decoder()))
        self._clock_series: dict[tuple[str, TimeScale], DeviceClockSeries] = {}

    def add_frame(self, frame: RawFrame) -> None:
        """Decode a frame and add its device times."""
        for device, decoder in self._on_link.get(frame.link, ()):
            for measurement in decoder.feed(frame.data, frame.t_rx_ns):
                if device_time := device_time_of(measurement.stamp):
                    scale, t_dev_ns = device_time
                    self._of(device, scale).feed(measurement.stamp.t_rx_ns, t_dev_ns)

    def _of(self, device: Device, scale: TimeScale) -> DeviceClockSeries:
        key = device.name, scale
        if key not in self._clock_series:
            latency_ns, max_age_ns = round(device.latency_ms * 1e6), round(device.max_age_ms * 1e6)
            clock = ClockEstimator(scale, latency_ns, max_age_ns, None, device.name)
            self._clock_series[key] = DeviceClockSeries(device, clock)
        return self._clock_series[key]

    def finish(self) -> list[DeviceClockSeries]:
        """The clocks in the order of the configuration, fitted over all messages."""
        order = [bound.device.name for bound in self._devices]
        clock_series = sorted(self._clock_series.values(), key=lambda h: (order.index(h.device.name), h.scale))
        for each in clock_series:
            each.clock.finish()
        return clock_series


def read_computer_clock(recording: Recording) -> ComputerClock:
    """``/fti/clock`` of a recording; empty where there is none."""
    rows = list(_clock_rows(recording))
    columns = np.array(rows, dtype=np.int64).reshape(-1, 4).T
    return ComputerClock(*columns)


def _clock_rows(recording: Recording) -> Iterator[tuple[int, int, int, int]]:
    for topic, t_ns, _, _, data in recording.messages(CLOCK_TOPIC, kind="raw"):
        with using_message(topic, t_ns):
            row = {"width_ns": STEP_NS, **parse_table(data)}
            t, raw, real, width = (whole_number(row[f"{key}_ns"]) for key in CLOCKS)
        yield t, raw, real, width
