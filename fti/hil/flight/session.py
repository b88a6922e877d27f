"""A recorded flight from a session: position and attitude of one of its devices, decoded again from its bytes.

Times are the validity times of the measurements by the clock of the device.  As in navigation
(``fti.nav.source_interpolation``), parts of a position or attitude from several messages are joined, and the lever arm
is removed: the result is the path of the reference point P.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fti.config import Config, decode_text
from fti.constants import SECOND_NS
from fti.devices import BoundDevice, bind_devices
from fti.errors import ConfigError
from fti.hil.flight.trajectory import FlightSamples
from fti.hil.session_config import recorded_config
from fti.logger.reading.recording import Recording
from fti.messages.measurements import Attitude, Measurement, Position
from fti.nav.device_time.device_times import DeviceTimes
from fti.nav.source_interpolation import NavSource

#: A position is joined with attitudes that follow within this time [ns].
JOIN_TIMEOUT_NS = SECOND_NS // 5
#: t [ns], lat, lon [rad], alt [m], roll, pitch, heading [rad].
Row = tuple[int, float, float, float, float, float, float]


def read_session(folder: Path, device: str | None) -> FlightSamples:
    """The samples of a device, t = 0 at the first; None: of the only device with position and attitude.

    Raises MissingError without session, ConfigError for an unknown device, for one without position and attitude, and
    when several devices have both and none is named.
    """
    recording = Recording.open(folder)
    config = recorded_config(recording, folder)
    texts = {name: decode_text(data, f"{folder / name}") for name, data in recording.attachments().items()}
    known = {bound.device.name: bound for bound in bind_devices(config, texts)}
    if device is not None and device not in known:
        raise ConfigError(f"{folder}: unknown device {device!r}; the session has {', '.join(known)}")
    candidates = [known[device]] if device else list(known.values())
    tracks = {bound.device.name: list(_rows(recording, config, bound)) for bound in candidates}
    able = [name for name, rows in tracks.items() if rows]
    if not able:
        raise ConfigError(f"{folder}: no position with attitude from {device or 'any of its devices'}")
    if len(able) > 1:
        raise ConfigError(f"{folder}: several devices have position and attitude; name one of {', '.join(able)}")
    rows = sorted({row[0]: row for row in tracks[able[0]]}.values())
    t_ns, *values = zip(*rows, strict=True)
    return FlightSamples((np.array(t_ns) - t_ns[0]) / SECOND_NS, *(np.array(column) for column in values))


def _rows(recording: Recording, config: Config, bound: BoundDevice) -> Iterator[Row]:
    """Position and attitude at the times of the positions."""
    source, waiting = NavSource(bound.device), list[int]()
    for m in _measurements(recording, config, bound):
        t_ns = m.stamp.t_valid_ns
        if t_ns is None:
            continue
        if isinstance(m, Attitude):
            source.push_attitude(m, t_ns)
        elif isinstance(m, Position):
            source.push_position(m, t_ns)
            waiting.append(t_ns)
        while waiting and waiting[0] < t_ns - JOIN_TIMEOUT_NS:
            yield from _row(source, waiting.pop(0))
    for t_ns in waiting:
        yield from _row(source, t_ns)


def _row(source: NavSource, t_ns: int) -> Iterator[Row]:
    attitude = source.attitude(t_ns)
    position = source.position(t_ns, attitude)
    if position is None or position.alt is None or attitude is None or attitude.heading is None:
        return
    yield t_ns, position.lat, position.lon, position.alt, attitude.roll, attitude.pitch, attitude.heading


def _measurements(recording: Recording, config: Config, bound: BoundDevice) -> Iterator[Measurement]:
    decoder, times = bound.make_decoder(), DeviceTimes(config.device)
    for frame in recording.frames():
        if frame.link == bound.device.link:
            for m in decoder.feed(frame.data, frame.t_rx_ns):
                yield times.stamp(bound.device.name, m)
