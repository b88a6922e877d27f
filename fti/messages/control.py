"""Messages between the supervisor and the other processes, one union for each receiver.

``fti.service.control_channel`` sends a message as a JSON table with one entry: name of its class, and its fields.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from fti.messages.health import DeviceHealth, HealthRecord, LinkHealth, NavigationHealth, SnapshotHealth, StorageHealth
from fti.messages.ledger import LedgerRecord
from fti.messages.notes import AlarmRecord, AlarmReportRecord
from fti.messages.outputs import Event
from fti.messages.refusals import CarriedRefusal
from fti.messages.units import Bytes, Count, Nanoseconds

# ---------------------------------------------------------------------------------------------- from the supervisor


@dataclass(frozen=True, slots=True)
class Stop:
    """The process must end."""


@dataclass(frozen=True, slots=True)
class Hurry:
    """Navigation must end although its ring is not empty."""


@dataclass(frozen=True, slots=True)
class EventNote:
    """The recorder must record an event.  who : the user who caused it; empty if no user did"""

    event: Event
    who: str = ""


@dataclass(frozen=True, slots=True)
class SnapshotTrigger:
    """The recorder must write a snapshot around t_ns."""

    text: str
    t_ns: Nanoseconds


@dataclass(frozen=True, slots=True)
class SendBytes:
    """The recorder must send data (hexadecimal) on a link.  until_ns : deadline, if there is one"""

    id: Count
    link: str
    data: str
    until_ns: Nanoseconds | None = None


@dataclass(frozen=True, slots=True)
class Readmit:
    """Navigation must readmit a source, or all (``*``)."""

    source: str


@dataclass(frozen=True, slots=True)
class PageKey:
    """The command key of the page."""

    key: str


@dataclass(frozen=True, slots=True)
class CommandDescription:
    """As ``Command`` of ``fti.drivers``."""

    does: str
    arguments: dict[str, str]
    answered: bool


@dataclass(frozen=True, slots=True)
class DeviceCommands:
    """A device and its commands.  transmit : the link may transmit"""

    name: str
    driver: str
    link: str
    transmit: bool
    commands: dict[str, CommandDescription]


@dataclass(frozen=True, slots=True)
class UsableDevices:
    """The devices that take commands."""

    devices: tuple[DeviceCommands, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandProgress:
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


@dataclass(frozen=True, slots=True)
class Ready:
    """A process works.  fault : why the recorder has no file"""

    fault: str | None = None


@dataclass(frozen=True, slots=True)
class FileNumber:
    """The recorder has taken the number of a raw file.  confirmed : the file was written"""

    number: Count
    confirmed: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderReport:
    """The part of health that the recorder knows; twice a second."""

    t_ns: Nanoseconds
    links: dict[str, LinkHealth]
    storage: StorageHealth
    snapshot: SnapshotHealth | None
    next_seq: Count


@dataclass(frozen=True, slots=True)
class NavigationReport:
    """The part of health that navigation knows; twice a second."""

    devices: dict[str, DeviceHealth]
    navigation: NavigationHealth


@dataclass(frozen=True, slots=True)
class ClockStepNotice:
    """The real-time clock was stepped."""

    text: str


@dataclass(frozen=True, slots=True)
class SendResult:
    """The end of a ``SendBytes``.  partly : a part was sent, or may still be sent, despite the fault"""

    id: Count
    fault: str | None
    partly: bool
    t_ns: Nanoseconds


@dataclass(frozen=True, slots=True, kw_only=True)
class RecorderEnd:
    """The last message of the recorder, after its files are closed.

    ledger_recorded : the ledger is in a file;  fault : why a file could not be closed
    unsafe_frames, unsafe_bytes : written to a medium that failed afterwards, and nowhere else
    """

    ledger: LedgerRecord
    ledger_recorded: bool
    fault: str | None
    unsafe_frames: Count
    unsafe_bytes: Bytes


@dataclass(frozen=True, slots=True)
class TerrainLoading:
    """Navigation loads its terrain, or has ended loading."""

    is_loading: bool


@dataclass(frozen=True, slots=True)
class Refusals:
    """The refusals that the next navigation process must begin with."""

    refusals: tuple[CarriedRefusal, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceAnswer:
    """An answer of a device to a command, at its arrival.  command : empty if the answer does not name it"""

    device: str
    t_ns: Nanoseconds
    command: str
    accepted: bool
    detail: str


@dataclass(frozen=True, slots=True)
class PagePort:
    """The page is served at a port."""

    port: Count


@dataclass(frozen=True, slots=True)
class PageFault:
    """Why the page is not served, or a message was not understood."""

    text: str


@dataclass(frozen=True, slots=True)
class PageMark:
    """A mark from the page.  who : user of the browser;  is_trigger : write a snapshot, too"""

    text: str
    who: str
    is_trigger: bool = False


@dataclass(frozen=True, slots=True)
class PageCommand:
    """A command to a device from the page.  id : chosen by the page for each click"""

    id: str
    device: str
    command: str
    who: str
    args: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class PageAcknowledgement:
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
#: Of the zenoh process, too, which sends Ready and Event.
FromChild = FromRecorder | FromNavigation | FromDisplay
ControlMessage = ToRecorder | ToNavigation | ToDisplay | FromChild
