"""Tables of measurements: every one that is decoded from the frames; where there are no frames the recorded ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Protocol

from fti.logger.derived_log import Decimator
from fti.logger.export.columns import flatten
from fti.logger.export.contents import parse_item
from fti.logger.export.measurement_rows import MeasurementRows
from fti.logger.export.point_rows import POINT_COLUMNS, POINTS_SUFFIX, point_rows
from fti.logger.export.recorded_measurements import RecordedMeasurements
from fti.logger.export.row_spool import JsonRow
from fti.logger.export.selection import ExportSelection, TimeWindow
from fti.logger.export.topic_tables import Tables
from fti.logger.reading.mcap_file import McapMessage
from fti.logger.reading.note_states import NoteStates
from fti.messages.frames import TICK_LINK, RawFrame
from fti.messages.measurements import Measurement, RangeScan
from fti.messages.topics import measurement_topic

#: Frames are decoded until this time after the end of the window [ns]: a message is complete after its first byte.
LATEST_BYTE_NS = 10_000_000_000
#: A frame and its measurements, with the names of their devices.
DecodedFrame = tuple[RawFrame, list[tuple[str, Measurement]]]


class Decoded(Protocol):
    """The measurements of a recording, decoded from its frames."""

    @property
    def devices(self) -> Mapping[str, int]:
        """Maximum age of the values of each device [ns], by its name."""

    def measurements(self, is_wanted: Callable[[str], bool]) -> Iterator[DecodedFrame]:
        """Each frame with its measurements, of the devices that are wanted."""


class MeasurementWriter:
    """Writes the decoded measurements, and the recorded ones of times without frames.

    kinds : classes of the topics of the devices
    """

    def __init__(self, tables: Tables, selection: ExportSelection, kinds: Mapping[str, type]) -> None:
        self._tables = tables
        self._kinds = {topic: kind for topic, kind in kinds.items() if selection.matches(topic)}
        self._rows: dict[tuple[str, type], tuple[str, MeasurementRows]] = {}
        self._decimator = Decimator(selection.thin_hz) if selection.thin_hz else None
        self._has_points = selection.points

    def write(self, decoded: Decoded, recorded: RecordedMeasurements, window: TimeWindow) -> None:
        """Write those of the window."""
        devices = {topic.split("/")[1] for topic in self._kinds}
        if not devices:
            return
        for frame, measurements in decoded.measurements(devices.__contains__):
            if window.has_ended(frame.t_rx_ns - LATEST_BYTE_NS):
                return
            if frame.link != TICK_LINK:
                for item in recorded.before_frame(frame.t_rx_ns):
                    self._write_recorded(item)
            for device, measurement in measurements:
                self._write_decoded(device, measurement)
        for item in recorded.rest():
            self._write_recorded(item)

    def _write_decoded(self, device: str, measurement: Measurement) -> None:
        kind = type(measurement)
        topic, rows = self._rows.get((device, kind)) or self._begin(device, kind)
        if topic in self._kinds and (self._decimator is None or self._decimator.passes(device, measurement)):
            t_rx_ns, t_valid_ns = measurement.stamp.t_rx_ns, measurement.stamp.t_valid_ns
            times = t_rx_ns, t_rx_ns if t_valid_ns is None else t_valid_ns
            self._tables.write(topic, times, rows.cells(measurement))
            if self._has_points and isinstance(measurement, RangeScan):
                self._write_points(topic + POINTS_SUFFIX, measurement)

    def _write_points(self, topic: str, scan: RangeScan) -> None:
        if topic not in self._tables.columns:
            self._tables.open(topic, POINT_COLUMNS)
        for t_valid_ns, cells in point_rows(scan):
            self._tables.write(topic, (scan.stamp.t_rx_ns, t_valid_ns), cells)

    def _write_recorded(self, item: McapMessage) -> None:
        topic = item.topic.name
        if topic not in self._kinds:
            return
        self._begin(topic.split("/")[1], self._kinds[topic])
        cells = flatten(parse_item(item, NoteStates()))
        self._tables.write_found(JsonRow(topic, (item.log_time, item.publish_time), cells))

    def _begin(self, device: str, kind: type) -> tuple[str, MeasurementRows]:
        topic = measurement_topic(device, kind)
        entry = self._rows.setdefault((device, kind), (topic, MeasurementRows(topic, kind)))
        if topic in self._kinds and topic not in self._tables.columns:
            self._tables.open(topic, entry[1].columns)
        return entry
