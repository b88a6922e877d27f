"""The topics: names, messages, rates, and where each is recorded and published."""

from __future__ import annotations

import re
import typing
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

from fti.messages.health import HealthRecord
from fti.messages.ledger import LedgerRecord
from fti.messages.measurements import Ack, Calibration, Measurement
from fti.messages.notes import (
    AlarmRecord,
    AlarmReportRecord,
    ClockRecord,
    DeviceClockRecord,
    GapRecord,
    NavigationNote,
    ReadmissionRecord,
    TerrainRecord,
)
from fti.messages.outputs import (
    ClearanceIntegrity,
    Event,
    FilterSolution,
    GlideSlope,
    GroundDrift,
    HeightAboveGround,
    HeightBelowAircraft,
    NavSolution,
    Output,
    PositionFix,
    ProvisionalSolution,
    SourceValidity,
    TerrainFix,
    VerticalSolution,
)
from fti.messages.tables import to_table

FileKind = Literal["raw", "derived", "snapshot", "truth"]

RAW_PREFIX, SENT_PREFIX = "/raw/", "/tx/"
TICK_TOPIC, CLOCK_TOPIC, LEDGER_TOPIC, HEALTH_TOPIC = "/fti/tick", "/fti/clock", "/fti/ledger", "/fti/health"
EVENT_TOPIC, GAP_TOPIC = "/fti/event", "/fti/gap"
#: Alarms of the daemon, in raw files; reports of navigation, in derived files.
ALARM_TOPIC, ALARM_REPORT_TOPIC = "/fti/alarm", "/fti/alarm_report"
DEVICE_CLOCK_TOPIC, TERRAIN_TOPIC, READMISSION_TOPIC = "/fti/device_clock", "/fti/terrain", "/fti/readmission"
LOCATION_TOPIC = "/nav/location"
#: Topics of the bus alone.
BUS_HEALTH, BUS_ALARMS, BUS_EVENT, BUS_EMULATOR = "/health", "/alarms", "/event", "/hil"
#: On the bus an output is late above this age [ms]; a height above ground above that of its device.
OUTPUT_MAX_AGE_MS = 500.0

#: Classes of measurements that are recorded in full.
UNDECIMATED = (Ack, Calibration)
#: Outputs of which there are several, and what each is appended to its topic.
SOURCE_FIELDS: dict[type, str] = {
    HeightAboveGround: "sensor",
    SourceValidity: "source",
    ProvisionalSolution: "source",
}


@cache
def snake_case(name: str) -> str:
    """``HeightAboveGround`` -> ``height_above_ground``."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


#: The classes by their names in topics.
MEASUREMENT_CLASSES: dict[str, type] = {snake_case(cls.__name__): cls for cls in typing.get_args(Measurement)}
OUTPUT_CLASSES: dict[str, type] = {snake_case(cls.__name__): cls for cls in typing.get_args(Output)}
#: Class of the notes of each topic of the service, but of events, which are recorded as ``foxglove.Log``.
NOTE_CLASSES: dict[str, type] = {
    HEALTH_TOPIC: HealthRecord,
    LEDGER_TOPIC: LedgerRecord,
    CLOCK_TOPIC: ClockRecord,
    ALARM_TOPIC: AlarmRecord,
    GAP_TOPIC: GapRecord,
    ALARM_REPORT_TOPIC: AlarmReportRecord,
    DEVICE_CLOCK_TOPIC: DeviceClockRecord,
    TERRAIN_TOPIC: TerrainRecord,
    READMISSION_TOPIC: ReadmissionRecord,
}
_NOTE_TOPICS = {cls: topic for topic, cls in NOTE_CLASSES.items()}
#: A note of the service.
Note = HealthRecord | LedgerRecord | ClockRecord | AlarmRecord | NavigationNote


def note_message(note: Note) -> tuple[str, int, dict[str, Any]]:
    """Topic, FTI time [ns] and table of a note, as it is recorded."""
    return _NOTE_TOPICS[type(note)], note.t_ns, to_table(note)


def schema_name(kind: type) -> str:
    """Name of the MCAP schema of a class: ``fti.Attitude``, ``fti.Health``."""
    return f"fti.{kind.__name__.removesuffix('Record')}"


def measurement_topic(device: str, kind: type) -> str:
    """``/<device>/<class>``."""
    return f"/{device}/{snake_case(kind.__name__)}"


def output_topic(output: Output) -> str:
    """``/nav/<class>``, with the sensor or source appended where there are several; the bus uses it too."""
    kind = type(output)
    topic = measurement_topic("nav", kind)
    return f"{topic}/{getattr(output, SOURCE_FIELDS[kind])}" if kind in SOURCE_FIELDS else topic


@dataclass(frozen=True, slots=True, kw_only=True)
class Topic:
    """A topic, or topics that differ by a name only.

    name    : <link>, <device>, <altimeter>, <source> stand for names of the configuration
    content : class of its messages; None for bytes, and for messages of the emulator
    schema  : name of the MCAP schema; "" for bytes, and for messages of the bus alone
    files   : kinds of the files that have it;  bus : its topic on the bus, "" without one
    """

    name: str
    text: str
    rate: str
    content: type | None = None
    schema: str = ""
    files: tuple[FileKind, ...] = ()
    bus: str = ""
    max_age_ms: float | None = None

    def matches(self, topic: str) -> bool:
        """Is a recorded topic one of these?"""
        pattern = re.sub(r"<\w+>", "[^/]+", self.name)
        return re.fullmatch(pattern, topic) is not None


#: Rate of each output, and its text.
_OUTPUTS: dict[type, tuple[str, str]] = {
    NavSolution: ("25 Hz", "position, velocity and attitude that navigation uses, with their sources"),
    HeightAboveGround: ("each sample; 2 Hz without", "height above ground of an altimeter"),
    HeightBelowAircraft: ("each sample; 2 Hz without", "height above ground of the selected altimeter"),
    ClearanceIntegrity: ("up to 5 Hz; 2 Hz unchanged", "does the terrain match that of the published approach?"),
    GlideSlope: ("up to 5 Hz; 2 Hz unchanged", "deviation from the published glide path"),
    FilterSolution: ("5 Hz", "solution of the error-state filter"),
    VerticalSolution: ("5 Hz", "height and climb from inertial data and an altimeter"),
    TerrainFix: ("2 Hz", "position from a height profile and known terrain"),
    GroundDrift: ("each pair of looks; 2 Hz without", "drift between two looks at the same ground, without a map"),
    PositionFix: ("2 Hz", "position from pseudoranges and DME"),
    SourceValidity: ("2 Hz, and on a change", "result of the tests of a source"),
    ProvisionalSolution: ("5 Hz, while a source is unconfirmed", "solution of the filter if this source were right"),
}


def topics() -> tuple[Topic, ...]:
    """Every topic, in the order of the flow of data."""
    return (*_frame_topics(), *_measurement_topics(), *_output_topics(), *_notes(), *_truth_topics(), *_bus_topics())


def _frame_topics() -> Iterator[Topic]:
    yield Topic(name=f"{RAW_PREFIX}<link>", text="received bytes", rate="as received", files=("raw", "snapshot"))
    yield Topic(name=f"{SENT_PREFIX}<link>", text="sent bytes", rate="as sent", files=("raw", "snapshot"))
    yield Topic(
        name=TICK_TOPIC, text="ticks, so that timeouts are reproducible", rate="50 Hz", files=("raw", "snapshot")
    )


def _measurement_topics() -> Iterator[Topic]:
    for kind in MEASUREMENT_CLASSES.values():
        yield Topic(
            name=measurement_topic("<device>", kind),
            text=_subject(kind),
            rate="as decoded" if kind in UNDECIMATED else "as decoded, at most 25 Hz",
            content=kind,
            schema=schema_name(kind),
            files=("derived",),
        )


def _subject(kind: type) -> str:
    """Begin of the docstring of a class, without units and names of fields in brackets."""
    line = re.sub(r" \[[^]]*\]| \([^)]*\)", "", (kind.__doc__ or "").partition("\n")[0])
    text = re.split(r"[:;]|\.$", line)[0]
    return text[:1].lower() + text[1:]


def _output_topics() -> Iterator[Topic]:
    names = {"sensor": "<altimeter>", "source": "<source>"}
    for kind in OUTPUT_CLASSES.values():
        topic, (rate, text) = measurement_topic("nav", kind), _OUTPUTS[kind]
        if kind in SOURCE_FIELDS:
            topic += f"/{names[SOURCE_FIELDS[kind]]}"
        yield Topic(
            name=topic,
            text=text,
            rate=rate,
            content=kind,
            schema=schema_name(kind),
            files=("derived",),
            bus=topic,
            max_age_ms=None if kind is HeightAboveGround else OUTPUT_MAX_AGE_MS,
        )
    yield Topic(
        name=LOCATION_TOPIC,
        text="a valid position, for maps",
        rate="25 Hz",
        schema="foxglove.LocationFix",
        files=("derived",),
    )


def _notes() -> Iterator[Topic]:
    def note(name: str, rate: str, text: str, *files: FileKind, bus: str = "") -> Topic:
        kind = NOTE_CLASSES[name]
        return Topic(name=name, text=text, rate=rate, content=kind, schema=schema_name(kind), files=files, bus=bus)

    yield Topic(
        name=EVENT_TOPIC,
        text="events for the operator",
        rate="on occurrence",
        content=Event,
        schema="foxglove.Log",
        files=("raw", "derived", "snapshot"),
        bus=BUS_EVENT,
    )
    states = "states of links, devices, storage and processes"
    yield note(HEALTH_TOPIC, "1 Hz; bus: 2 Hz", states, "raw", bus=BUS_HEALTH)
    yield note(LEDGER_TOPIC, "1 Hz", "account of the bytes and frames of each link", "raw")
    yield note(CLOCK_TOPIC, "1 Hz", "FTI time against the clocks of the computer", "raw")
    changes = "begins, changes, ends and acknowledgements of alarms; bus: the list"
    yield note(ALARM_TOPIC, "on a change", changes, "raw", bus=BUS_ALARMS)
    yield note(GAP_TOPIC, "on occurrence", "frames that are missing, and why", "raw", "derived")
    yield note(ALARM_REPORT_TOPIC, "on a change", "conditions of alarms in navigation", "derived")
    yield note(DEVICE_CLOCK_TOPIC, "1 Hz", "estimates of the clocks of the devices", "derived")
    yield note(TERRAIN_TOPIC, "on a change", "the terrain that navigation uses from here on", "derived")
    yield note(READMISSION_TOPIC, "on a command", "a source that the operator readmits", "derived")


def _truth_topics() -> Iterator[Topic]:
    def truth(name: str, kind: str, rate: str, text: str) -> Topic:
        return Topic(name=f"/truth/{name}", text=text, rate=rate, schema=kind, files=("truth",))

    yield truth("state", "fti.Truth", "25 Hz", "true state of the emulated flight")
    yield truth("measurement/<device>", "fti.IntendedValues", "1 Hz", "values of a device before faults and encoder")
    yield truth("late", "", "on occurrence", "times at which the emulator was late")
    yield truth("end", "", "once", "messages and bytes sent on each link")


def _bus_topics() -> Iterator[Topic]:
    yield Topic(name=BUS_EMULATOR, text="state of the emulator", rate="2 Hz", bus=BUS_EMULATOR)
