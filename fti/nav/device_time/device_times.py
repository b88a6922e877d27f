"""Times of validity of measurements: the clocks of all devices, and GNSS time.

Deterministic: its only input are measurements in order of ``seq``.  A restart of navigation resets it.
"""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from fti.config import Device
from fti.constants import SECOND_NS
from fti.messages.measurements import Measurement, Stamp, TimeScale
from fti.messages.notes import ClockEstimate, DeviceClockRecord, GnssTime
from fti.messages.outputs import Event
from fti.nav.device_time.clock_estimator import ARRIVAL_SD_NS, WINDOW_S, ClockEstimator, ClockState
from fti.nav.device_time.delay_envelope import Z95

#: Scales that are common to all devices, the better one first.
GNSS_SCALES = (TimeScale.GPS, TimeScale.UTC)
#: Limit of valid device times [ns]: 146 years.  Devices without time often send their largest number.
MAX_TIME_NS = 2**62
_Key = tuple[str, TimeScale]


def device_time_of(stamp: Stamp) -> tuple[TimeScale, int] | None:
    """Time scale and device time [ns] of a message; None if it has none or an invalid one."""
    if stamp.time_scale is None or stamp.t_dev_ns is None or abs(stamp.t_dev_ns) > MAX_TIME_NS:
        return None
    return stamp.time_scale, stamp.t_dev_ns


class DeviceTimes:
    """Sets ``t_valid_ns``, and reports once a second.  window_s : as in ``ClockEstimator``"""

    def __init__(self, devices: Iterable[Device], window_s: int | None = WINDOW_S) -> None:
        self._devices = {device.name: device for device in devices}
        self._latency_ns = {name: _latency_ns(device) for name, device in self._devices.items()}
        self._window = window_s
        self.clocks: dict[_Key, ClockEstimator] = {}
        self._last: dict[_Key, tuple[int, int, int | None]] = {}
        self._second = 0
        self._stamp: Stamp | None = None
        self._device = ""
        self._valid_stamp = Stamp(0)

    def stamp(self, device: str, m: Measurement) -> Measurement:
        """The same measurement with ``t_valid_ns``: by the device's clock, or else by its arrival.

        Invalid measurements use the arrival: with an earlier time, an older valid value would be used longer.
        """
        stamp = m.stamp
        if stamp is not self._stamp or device != self._device:  # the measurements of a message share one stamp
            self._valid_stamp = self._validity_stamp(self._devices[device], stamp)
            self._stamp, self._device = stamp, device  # not before: after a failure the next one must retry
        if getattr(m, "valid", True):
            return replace(m, stamp=self._valid_stamp)
        return replace(m, stamp=replace(stamp, t_valid_ns=stamp.t_rx_ns - self._latency_ns[device]))

    def _validity_stamp(self, device: Device, stamp: Stamp) -> Stamp:
        """By the clock of the device; by the arrival if that is not known."""
        by_clock = self._by_clock(device, stamp)
        if by_clock is None or not device.use_device_time:
            return replace(stamp, t_valid_ns=stamp.t_rx_ns - self._latency_ns[device.name])
        return replace(stamp, t_valid_ns=by_clock)

    def _by_clock(self, device: Device, stamp: Stamp) -> int | None:
        """Measurements of one message have the same stamp: it is processed once."""
        device_time = device_time_of(stamp)
        if device_time is None:
            return None
        scale, t_dev_ns = device_time
        key = (device.name, scale)
        last_rx_ns, last_dev_ns, valid_ns = self._last.get(key, (None, None, None))
        if (last_rx_ns, last_dev_ns) != (stamp.t_rx_ns, t_dev_ns):
            clock = self.clocks.get(key) or self._begin(key, device)
            valid_ns = clock.feed(stamp.t_rx_ns, t_dev_ns)
            self._last[key] = stamp.t_rx_ns, t_dev_ns, valid_ns
        return valid_ns

    def _begin(self, key: _Key, device: Device) -> ClockEstimator:
        max_age_ns = round(device.max_age_ms * 1e6)
        clock = self.clocks[key] = ClockEstimator(key[1], _latency_ns(device), max_age_ns, self._window, device.name)
        return clock

    def tick(self, t_ns: int) -> DeviceClockRecord | None:
        """Once a second, the state of every clock, for ``/fti/device_clock``."""
        if t_ns // SECOND_NS == self._second:
            return None
        self._second = t_ns // SECOND_NS
        clocks = {f"{name}_{scale}": describe(clock, t_ns) for (name, scale), clock in self.clocks.items()}
        return DeviceClockRecord(t_ns=t_ns, clocks=clocks, gnss=self._gnss(t_ns)) if clocks else None

    def clocks_of(self, device: str, t_ns: int) -> list[ClockEstimate]:
        """State of the clocks of a device, common time scales first."""
        order = [*GNSS_SCALES, *(scale for scale in TimeScale if scale not in GNSS_SCALES)]
        known = [self.clocks[device, scale] for scale in order if (device, scale) in self.clocks]
        return [describe(clock, t_ns) for clock in known if clock.segments]

    def drain_events(self, t_ns: int) -> list[Event]:
        """Events since the last call."""
        news = [text for clock in self.clocks.values() for text in clock.drain_event_texts()]
        return [Event(t_ns=t_ns, level="info", source="clock", text=text) for text in news]

    def _gnss(self, t_ns: int) -> GnssTime:
        """GPS or UTC time at t_ns, from the first device whose clock is known; empty without one."""
        good = [key for key, clock in self.clocks.items() if clock.state is ClockState.GOOD]
        for scale in GNSS_SCALES:
            for device in self._devices:
                if (device, scale) in good:
                    clock = self.clocks[device, scale]
                    return GnssTime(device=device, scale=scale, time_ns=clock.device_ns(t_ns))
        return GnssTime()


def describe(clock: ClockEstimator, t_ns: int) -> ClockEstimate:
    """A clock at the FTI time t_ns."""
    segment = clock.segments[-1]
    good, known = clock.state is ClockState.GOOD, segment.is_known
    sd_ns = clock.sd_ns(t_ns)
    return ClockEstimate(
        scale=clock.scale,
        state=clock.state,
        offset_ns=clock.device_ns(t_ns) - t_ns,
        offset_sd_ns=sd_ns if known else None,
        drift_ppm=segment.drift_ppm if known else None,
        drift_sd_ppm=1e6 * segment.line.slope_95 / Z95 if known else None,
        validity_sd_ns=sd_ns if good else ARRIVAL_SD_NS,
        usual_ns=segment.line.spread if known else None,
        largest_ns=segment.largest_ns,
        messages=segment.messages,
        late=segment.late,
        refused=clock.refused,
        segments=len(clock.segments),
    )


def _latency_ns(device: Device) -> int:
    return round(device.latency_ms * 1e6)
