"""Messages between the supervisor and the other processes, one union for each receiver.

``fti.service.control_channel`` sends a message as a JSON table with one entry: name of its class, and its fields.
"""

from __future__ import annotations

from msgspec import field

from fti.messages.health import (
    DeviceHealth,
    HealthRecord,
    LinkHealth,
    NavigationHealth,
    SinkHealth,
    SnapshotHealth,
    StorageHealth,
)
from fti.messages.ledger import LedgerRecord
from fti.messages.notes import AlarmRecord, AlarmReportRecord
from fti.messages.outputs import Event
from fti.messages.refusals import CarriedRefusal
from fti.messages.tables import Message
from fti.messages.units import Bytes, Count, Nanoseconds

# ---------------------------------------------------------------------------------------------- from the supervisor


class Stop(Message):
    """The process must end."""


class Hurry(Message):
    """Navigation must end although its ring is not empty."""


class EventNote(Message):
    """The recorder must record an event.  who : the user who caused it; empty if no user did"""

    event: Event
    who: str = ""


class SnapshotTrigger(Message):
    """The recorder must write a snapshot around t_ns."""

    text: str
    t_ns: Nanoseconds


class SendBytes(Message):
    """The recorder must send data (hexadecimal) on a link.  until_ns : deadline, if there is one"""

    id: Count
    link: str
    data: str
    until_ns: Nanoseconds | None = None


class Readmit(Message):
    """Navigation must readmit a source, or all (``*``)."""

    source: str


class PageKey(Message):
    """The command key of the page."""

    key: str


class CommandDescription(Message):
    """As ``Command`` of ``fti.drivers``."""

    does: str
    arguments: dict[str, str]
    answered: bool


class DeviceCommands(Message):
    """A device and its commands.  transmit : the link may transmit"""

    name: str
    driver: str
    link: str
    transmit: bool
    commands: dict[str, CommandDescription]


class UsableDevices(Message):
    """The devices that take commands."""

    devices: tuple[DeviceCommands, ...]


class CommandProgress(Message, kw_only=True):
    """The state of a command to a device.

    id, number : chosen by the client, and of the session;  who : the user;  ended : the state is final
    """

    id: str
    number: Count
    device: str
    command: str
    args: dict[str, str]
    who: str
    data: str
    title: str
    outcome: str
    state: str
    detail: str
    ended: bool
    t_ns: Nanoseconds
    sent_ns: Nanoseconds | None
    answered_ns: Nanoseconds | None


# ------------------------------------------------------------------------------------------------- to the supervisor


class Ready(Message):
    """A process works.  fault : why the recorder has no file"""

    fault: str | None = None


class FileNumber(Message):
    """The recorder has taken the number of a raw file.  confirmed : the file was written"""

    number: Count
    confirmed: bool


class RecorderReport(Message, kw_only=True):
    """The part of health that the recorder knows; twice a second."""

    t_ns: Nanoseconds
    links: dict[str, LinkHealth]
    storage: StorageHealth
    snapshot: SnapshotHealth | None
    next_seq: Count


class NavigationReport(Message):
    """The part of health that navigation knows; twice a second."""

    devices: dict[str, DeviceHealth]
    navigation: NavigationHealth


class PublishReport(Message):
    """The part of health that the publish process knows; once a second."""

    sinks: dict[str, SinkHealth]


class ClockStepNotice(Message):
    """The real-time clock was stepped."""

    text: str


class SendResult(Message):
    """The end of a ``SendBytes``.  partly : a part was sent, or may still be sent, despite the fault"""

    id: Count
    fault: str | None
    partly: bool
    t_ns: Nanoseconds


class RecorderEnd(Message, kw_only=True):
    """The last message of the recorder, after its files are closed.

    ledger_recorded : the ledger is in a file;  fault : why a file could not be closed
    unsafe_frames, unsafe_bytes : written to a medium that failed afterwards, and nowhere else
    """

    ledger: LedgerRecord
    ledger_recorded: bool
    fault: str | None
    unsafe_frames: Count
    unsafe_bytes: Bytes


class TerrainLoading(Message):
    """Navigation loads its terrain, or has ended loading."""

    is_loading: bool


class Refusals(Message):
    """The refusals that the next navigation process must begin with."""

    refusals: tuple[CarriedRefusal, ...]


class DeviceAnswer(Message, kw_only=True):
    """An answer of a device to a command, at its arrival.  command : empty if the answer does not name it"""

    device: str
    t_ns: Nanoseconds
    command: str
    accepted: bool
    detail: str


class PagePort(Message):
    """The page is served at a port."""

    port: Count


class PageFault(Message):
    """Why the page is not served, or a message was not understood."""

    text: str


class PageMark(Message):
    """A mark from the page.  who : user of the browser;  is_trigger : write a snapshot, too"""

    text: str
    who: str
    is_trigger: bool = False


class PageCommand(Message):
    """A command to a device from the page.  id : chosen by the page for each click"""

    id: str
    device: str
    command: str
    who: str
    args: dict[str, str] = field(default_factory=dict)


class PageAcknowledgement(Message):
    """An acknowledgement of an alarm with its consequences from the page, or of all (None)."""

    alarm_id: str | None
    who: str


#: Notes of the supervisor, for the raw files.
RecorderNote = EventNote | AlarmRecord | HealthRecord
ToRecorder = Stop | SnapshotTrigger | SendBytes | RecorderNote
ToNavigation = Stop | Hurry | Readmit
ToDisplay = Stop | PageKey | UsableDevices | CommandProgress
FromRecorder = Ready | FileNumber | RecorderReport | ClockStepNotice | SendResult | RecorderEnd | Event
FromNavigation = Ready | NavigationReport | TerrainLoading | Refusals | DeviceAnswer | AlarmReportRecord | Event
FromPage = PageMark | PageCommand | PageAcknowledgement
FromDisplay = PagePort | PageFault | FromPage
FromPublish = Ready | PublishReport | Event
#: Of the zenoh process, too, which sends Ready and Event.
FromChild = FromRecorder | FromNavigation | FromDisplay | FromPublish
ControlMessage = ToRecorder | ToNavigation | ToDisplay | FromChild
