"""Overview of a session: metadata, files, and topics with their configured rates."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fti.config import decode_text, parse_toml
from fti.constants import SECOND_NS
from fti.errors import ConfigError
from fti.formats.device_time import GPS_EPOCH_UTC_NS, LEAP_NS
from fti.logger.reading.mcap_file import McapFile
from fti.logger.reading.recording import Recording
from fti.logger.session import CONFIG_ATTACHMENT
from fti.logger.statistics.interval_stats import TimeGap
from fti.logger.statistics.topic_stats import RecordingStatistics, TopicStatistics, collect_statistics, time_span
from fti.messages.measurements import TimeScale
from fti.messages.topics import RAW_PREFIX, SENT_PREFIX
from fti.post.flight_summary import FlightSummary

CONTINUOUS = "continuous"


@dataclass(frozen=True, slots=True)
class FileState:
    """A file.  compression : of its chunks, "" when it is not packed; fault : why reading broke off, else None."""

    path: Path
    bytes: int
    finished: bool
    compression: str
    fault: str | None

    @property
    def words(self) -> str:
        """The state as text."""
        if self.fault:
            return self.fault
        packed = f", packed ({self.compression})" if self.compression else ""
        return ("finished" if self.finished else "not finished") + packed


@dataclass(frozen=True, slots=True)
class Overview:
    """A session.

    begin_ns, end_ns : first and last message of all; rates : configured, of the device of a link, by topic [Hz]
    """

    recording: Recording
    statistics: RecordingStatistics
    files: list[FileState]
    begin_ns: int
    end_ns: int
    rates: Mapping[str, float]
    flight: FlightSummary

    @classmethod
    def make(cls, recording: Recording) -> Overview:
        """Read everything, once."""
        flight = FlightSummary()
        statistics = collect_statistics(recording, flight.handlers)
        files = [_file_state(recording, path) for path in recording.files]
        return cls(recording, statistics, files, *time_span(statistics.topics), configured_rates(recording), flight)

    @property
    def session_metadata(self) -> Mapping[str, str]:
        """Name, origin, software, ... of the session."""
        return self.recording.metadata.get("fti", {})

    @property
    def origin(self) -> str:
        """flight, hil or replay; unknown when the file does not state it."""
        return self.session_metadata.get("origin", "unknown")

    @property
    def mode(self) -> str:
        """continuous, or snapshot: only the data around a trigger are recorded."""
        return self.session_metadata.get("mode", CONTINUOUS)

    @property
    def duration_s(self) -> float:
        """From the first to the last message [s]."""
        return (self.end_ns - self.begin_ns) / SECOND_NS

    @property
    def links(self) -> list[TopicStatistics]:
        """The topics to plot, one row each: the links; in a file without links, all topics."""
        topics = [topic for topic in self.statistics.topics if not self.is_copy(topic)]
        return [topic for topic in topics if topic.topic.startswith(RAW_PREFIX)] or topics

    def is_copy(self, topic: TopicStatistics) -> bool:
        """Does a raw file have the same messages?  Frames of a snapshot are copies only in a continuous recording."""
        has_raw = topic.kind == "snapshot" and bool(self.recording.raw_files)
        return has_raw and (self.mode == CONTINUOUS or not topic.topic.startswith((RAW_PREFIX, SENT_PREFIX)))

    def since_begin_s(self, t_ns: int) -> float:
        """Time after the first message [s]."""
        return (t_ns - self.begin_ns) / SECOND_NS

    def find_gaps(self, topic: TopicStatistics) -> list[TimeGap]:
        """The gaps of a topic; also before its first message and after its last one."""
        if not topic.messages:
            return [TimeGap(self.begin_ns, self.end_ns - self.begin_ns)]
        limit_ns = (topic.intervals.gap_limit_s or 0.0) * SECOND_NS
        before = TimeGap(self.begin_ns, topic.first_ns - self.begin_ns)
        after = TimeGap(topic.last_ns, self.end_ns - topic.last_ns)
        edges = [gap for gap in (before, after) if limit_ns and gap.length_ns > max(limit_ns, SECOND_NS)]
        return sorted([*edges, *topic.intervals.gaps])

    def gnss(self) -> GnssTime | None:
        """GNSS time at the end of the session; None when no clock of it was known."""
        clock = self.statistics.gnss
        if not clock:
            return None
        is_gps = clock["scale"] == TimeScale.GPS
        utc_ns = clock["time_ns"] + (GPS_EPOCH_UTC_NS - LEAP_NS if is_gps else 0)
        return GnssTime(clock["device"], clock["scale"], utc_ns - clock["t_ns"])

    def clock_offset_s(self) -> tuple[float, float] | None:
        """Real-time clock minus FTI time at the first and the last ``/fti/clock`` [s]; None when there is none."""
        known = [c for c in self.statistics.clocks if {"realtime_ns", "t_ns"} <= c.keys()]
        if not known:
            return None
        first, last = ((c["realtime_ns"] - c["t_ns"]) / SECOND_NS for c in (known[0], known[-1]))
        return first, last


@dataclass(frozen=True, slots=True)
class GnssTime:
    """UTC minus FTI time [ns], from a device's GPS or UTC time."""

    device: str
    scale: str
    utc_minus_fti_ns: int


def _file_state(recording: Recording, path: Path) -> FileState:
    fault = recording.faults.get(path)
    text = fault.text if fault else None
    file = McapFile(path)
    return FileState(path, path.stat().st_size, file.is_finished(), file.compression(), text)


def configured_rates(recording: Recording) -> dict[str, float]:
    """Rates of the attached configuration, for links with one device, by topic [Hz]."""
    devices = _devices(recording.attachments().get(CONFIG_ATTACHMENT, b""))
    lines = [device["link"] for device in devices]
    single = (device for device in devices if lines.count(device["link"]) == 1)
    return {
        f"{RAW_PREFIX}{d['link']}": float(d["rate_hz"]) for d in single if isinstance(d.get("rate_hz"), int | float)
    }


def _devices(text: bytes) -> list[dict[str, Any]]:
    """The devices of a configuration, which may have another version."""
    try:
        tables = parse_toml(decode_text(text, CONFIG_ATTACHMENT), CONFIG_ATTACHMENT).get("device", [])
    except ConfigError:
        return []
    listed = tables if isinstance(tables, list) else []
    return [d for d in listed if isinstance(d, dict) and isinstance(d.get("link"), str)]
