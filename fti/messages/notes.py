"""Notes of the service: clocks, gaps, terrain, readmissions and alarms."""

from __future__ import annotations

from msgspec import UNSET, UnsetType

from fti.messages.refusals import CarriedRefusal
from fti.messages.tables import Message
from fti.messages.units import (
    Bytes,
    Count,
    FractionalNanoseconds,
    Metres,
    Nanoseconds,
    PartsPerMillion,
    Radians,
    SiValue,
)


class ClockRecord(Message, kw_only=True):
    """The kernel's clocks at one moment.  t_ns : FTI time; width_ns : duration of reading them"""

    t_ns: Nanoseconds
    monotonic_ns: Nanoseconds
    monotonic_raw_ns: Nanoseconds
    realtime_ns: Nanoseconds
    width_ns: Nanoseconds


class ClockEstimate(Message, kw_only=True):
    """The clock of a device against FTI time.

    offset_ns      : device - FTI time;  drift_ppm : relative to FTI time, positive: faster
    validity_sd_ns : one sigma of times of validity
    usual_ns, largest_ns : median and largest delay beyond the minimum
    late, refused  : messages with more than the usual delay, and messages that did not fit
    """

    scale: str
    state: str
    offset_ns: Nanoseconds
    offset_sd_ns: FractionalNanoseconds | None
    drift_ppm: PartsPerMillion | None
    drift_sd_ppm: PartsPerMillion | None
    validity_sd_ns: FractionalNanoseconds
    usual_ns: FractionalNanoseconds | None
    largest_ns: FractionalNanoseconds
    messages: Count
    late: Count
    refused: Count
    segments: Count


class GnssTime(Message, kw_only=True):
    """Time of the first device whose clock is known, GPS or UTC; empty without one."""

    device: str | UnsetType = UNSET
    scale: str | UnsetType = UNSET
    time_ns: Nanoseconds | UnsetType = UNSET


class DeviceClockRecord(Message, kw_only=True):
    """The clocks of the devices, by ``<device>_<scale>``."""

    t_ns: Nanoseconds
    clocks: dict[str, ClockEstimate]
    gnss: GnssTime


class ElevationSource(Message, kw_only=True):
    """An elevation file.  vertical : datum of its heights;  date : of the survey;  sd : 1-sigma of its heights"""

    file: str
    vertical: str
    date: str | None = None
    sd: Metres


class TerrainRecord(Message, kw_only=True):
    """The terrain that navigation uses after frame ``after_seq``: its name and files, or why there is none.

    sources : datum, date and sigma of each file
    lat, lon, radius : middle and half the side of the square that is loaded; without: all is loaded
    sha256 : of the posts, to the last bit;  checksums : of the posts of each layer, as ``Ground.checksums``
    """

    t_ns: Nanoseconds
    after_seq: Count
    fault: str | UnsetType = UNSET
    name: str | UnsetType = UNSET
    files: tuple[str, ...] | UnsetType = UNSET
    sources: tuple[ElevationSource, ...] | UnsetType = UNSET
    lat: Radians | UnsetType = UNSET
    lon: Radians | UnsetType = UNSET
    radius: Metres | UnsetType = UNSET
    sha256: str | UnsetType = UNSET
    checksums: tuple[Metres, ...] | UnsetType = UNSET


class ReadmissionRecord(Message, kw_only=True):
    """The operator readmits a source, or all (``*``), after frame ``after_seq``."""

    t_ns: Nanoseconds
    after_seq: Count
    source: str


class GapRecord(Message, kw_only=True):
    """Missing frames.

    kind : buffer_overflow: dropped frames of a link, with numbers and times of the first and the last one, in raw
           files;  ring, restart: frames that navigation missed, between two numbers, in derived files
    refusals : that navigation had before its restart
    """

    t_ns: Nanoseconds
    kind: str
    link: str | UnsetType = UNSET
    first_seq: Count | UnsetType = UNSET
    last_seq: Count | UnsetType = UNSET
    first_t_ns: Nanoseconds | UnsetType = UNSET
    last_t_ns: Nanoseconds | UnsetType = UNSET
    frames: Count | UnsetType = UNSET
    bytes: Bytes | UnsetType = UNSET
    after_seq: Count | UnsetType = UNSET
    before_seq: Count | UnsetType = UNSET
    refusals: tuple[CarriedRefusal, ...] | UnsetType = UNSET


class AlarmReportRecord(Message, kw_only=True):
    """The condition of a subject from t_ns on, as navigation reports it; id None: no fault.

    value, explained_by, is_latched : see ``fti.alarms.condition``
    """

    t_ns: Nanoseconds
    subject: str
    id: str | None
    severity: str | None
    title: str | None
    cause: str | None
    value: SiValue | None
    explained_by: tuple[str, ...]
    is_latched: bool


class AlarmRecord(Message, kw_only=True):
    """A change of an alarm: begins, changes, ends, acknowledged.  The other fields : see ``fti.alarms.alarm_list``."""

    t_ns: Nanoseconds
    change: str
    id: str
    severity: str
    title: str
    cause: str
    value: SiValue | None
    first_ns: Nanoseconds
    begin_ns: Nanoseconds
    end_ns: Nanoseconds | None
    count: Count
    acknowledged_ns: Nanoseconds | None
    acknowledged_by: str | None


#: Notes of navigation, for its own files.
NavigationNote = DeviceClockRecord | TerrainRecord | ReadmissionRecord | GapRecord | AlarmReportRecord
