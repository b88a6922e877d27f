"""Writer of the derived files: decimated measurements, outputs, events and gaps as JSON."""

from __future__ import annotations

import operator
import typing
from collections.abc import Callable, Mapping
from typing import Any

from msgspec import structs

from fti.constants import SECOND_NS
from fti.logger import foxglove, schemas
from fti.logger.encoding import encode
from fti.logger.log_layout import LogLayout, LogSettings
from fti.logger.schemas import Schema
from fti.logger.session import SessionFolder
from fti.logger.split_log import SplitLog
from fti.messages.measurements import BeamRange, DmeRange, Measurement, Reading, SurfaceDeflection
from fti.messages.notes import NavigationNote
from fti.messages.outputs import Event, NavSolution, Output
from fti.messages.topics import (
    EVENT_TOPIC,
    LOCATION_TOPIC,
    UNDECIMATED,
    measurement_topic,
    note_message,
    output_topic,
)

#: Limit of buffered bytes: reprocessing at full speed never flushes.
PENDING_LIMIT = 2**20


def _make_stream_key(kind: Any) -> Callable[[Any], object]:
    """Key function that separates the streams of this class on one topic: by identity field and by absent fields.

    Each stream is decimated alone.  Roll, pitch and heading of an ARINC 429 line are three streams of Attitude.
    """
    names = [field.name for field in structs.fields(kind) if field.default is None]
    stream_field = STREAM_FIELD.get(kind)
    if stream_field:
        return lambda m: (getattr(m, stream_field), *[getattr(m, name) is None for name in names])
    if len(names) > 1:
        values, nones = operator.attrgetter(*names), (None,) * len(names)
        return lambda m: tuple(map(operator.is_, values(m), nones))
    return lambda m: [getattr(m, name) is None for name in names] == [True]


#: The field that names the object measured, for classes with several objects per device.
STREAM_FIELD: dict[type, str] = {
    SurfaceDeflection: "surface",
    Reading: "name",
    DmeRange: "station",
    BeamRange: "beam",
}
STREAM_KEY = {kind: _make_stream_key(kind) for kind in typing.get_args(Measurement) if kind not in UNDECIMATED}


class Decimator:
    """Passes at most ``rate_hz`` of each stream on average; a stream of that rate with jitter passes completely."""

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = round(SECOND_NS / rate_hz)
        self._early_ns = self._period_ns // 2
        self._due: dict[object, int] = {}

    def is_due(self, stream: object, t_ns: int) -> bool:
        """Is this message to be recorded?  Call once for each, in order."""
        due = self._due.get(stream, t_ns)
        if t_ns < due - self._early_ns:
            return False
        self._due[stream] = (due if due > t_ns else t_ns) + self._period_ns
        return True

    def passes(self, device: str, measurement: Measurement) -> bool:
        """Is this measurement to be recorded?  Call once for each, in order."""
        kind = type(measurement)
        stream_key = STREAM_KEY.get(kind)
        return stream_key is None or self.is_due((device, kind, stream_key(measurement)), measurement.stamp.t_rx_ns)


class DerivedLog(SplitLog):
    """Writes the derived files of a session.  All methods except ``flush``, ``sync`` and ``close`` only buffer.

    folder : see SplitLog
    """

    def __init__(self, folder: SessionFolder | None, settings: LogSettings, *, decimate_hz: float = 25.0) -> None:
        super().__init__(folder, LogLayout("derived", settings))
        self.is_due = Decimator(decimate_hz).passes  # for callers that queue measurements
        self._channels: dict[str, int] = {}
        self._channels_of: dict[tuple[str, type], int] = {}

    def write_measurement(self, device: str, measurement: Measurement) -> None:
        """Decimate and write a measurement on ``/<device>/<class>``: log time is arrival, publish time is validity."""
        if self.is_due(device, measurement):
            self.write_undecimated(device, measurement)

    def write_undecimated(self, device: str, measurement: Measurement) -> None:
        """Write a measurement for which ``is_due`` was true; it is called once for each, in order."""
        kind = type(measurement)
        channel = self._channels_of.get((device, kind))
        if channel is None:
            channel = self._channel(measurement_topic(device, kind), schemas.schema_of(kind))
            self._channels_of[device, kind] = channel
        stamp = measurement.stamp
        self._write(channel, (stamp.t_rx_ns, stamp.t_valid_ns), encode(measurement))

    def write_output(self, output: Output | Event) -> None:
        """Write an output on ``/nav/<class>`` or an event on ``/fti/event``; log time is its time."""
        if isinstance(output, Event):
            channel = self._channel(EVENT_TOPIC, schemas.note_schema(EVENT_TOPIC))
            self._write(channel, (output.t_ns, None), schemas.encode_note(EVENT_TOPIC, output))
            return
        channel = self._channel(output_topic(output), schemas.schema_of(type(output)))
        times = output.t_ns, output.t_valid_ns
        self._write(channel, times, encode(output))
        if isinstance(output, NavSolution) and (fix := foxglove.location(output)):
            self._write(self._channel(LOCATION_TOPIC, schemas.foxglove_schema("LocationFix")), times, encode(fix))

    def write_note(self, note: NavigationNote) -> None:
        """Write a note of navigation; log time is its time."""
        self.write_table(*note_message(note))

    def write_table(self, topic: str, t_ns: int, content: Mapping[str, Any]) -> None:
        """Write a note as a table.  Raises ValueError for a topic without notes."""
        self._write(self._channel(topic, schemas.note_schema(topic)), (t_ns, None), encode(content))

    def _channel(self, topic: str, schema: Schema) -> int:
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self.add_channel(topic, "json", schema)
        return channel

    def _write(self, channel: int, times: tuple[int, int | None], data: bytes) -> None:
        writer = self.segment.writer
        writer.write(channel, times[0], data, 0, times[1])
        if writer.pending_bytes >= PENDING_LIMIT:
            self.flush()
