"""Commands of the page: mark, snapshot (a mark that triggers), command to a device, acknowledgement of alarms.

They are limited in size and rate, and need the key of this start, which only the owner of the daemon can read.

Every program of this machine can open the WebSocket and send any Origin, so neither is a permission.  A page has the
key from the address that its owner opened; a page without it is read-only.  ``check`` tests a key.
"""

from __future__ import annotations

import hmac
import json
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from fti.messages import control
from fti.messages.tables import to_table

MAX_TEXT_CHARS = 200
MAX_PER_SECOND = 5
#: A connection is closed after this number of wrong keys.
MAX_WRONG_KEYS = 3
NS_PER_S = 1_000_000_000
#: Commands of the page that are marks: do they trigger a snapshot?
MARKS = {"mark": False, "snapshot": True}
UNKNOWN_COMMAND = "unknown command"
CHECK = "check"
WITHOUT_KEY = "view only; to control: fti page"
WRONG_KEY = "the key is old; to control: fti page"
#: Sends a command to the daemon; False when it cannot be reached.
Send = Callable[[control.FromPage], bool]


MAX_REQUESTS = 20


class CommandStatus:
    """Available commands to devices and the state of the last ones, for the page.

    version : increases with each change, after which each page gets everything again; 0 while no link may transmit
    """

    def __init__(self) -> None:
        self.version = 0
        self._devices: list[Any] = []
        self._requests: dict[tuple[str, int], Mapping[str, Any]] = {}

    def update(self, message: control.ToDisplay) -> None:
        """Handle a message of the supervisor."""
        if isinstance(message, control.UsableDevices):
            self._devices = to_table(message.devices)
            self.version += bool(self._devices)
        elif isinstance(message, control.CommandProgress):
            self._requests[message.id, message.t_ns] = to_table(message)  # a denied one may have no id
            if len(self._requests) > MAX_REQUESTS:
                del self._requests[next(iter(self._requests))]
            self.version += 1

    def message(self) -> dict[str, Any]:
        """Devices with their commands, and the last requests, newest first, ready for JSON."""
        return {"type": "commands", "devices": self._devices, "requests": list(self._requests.values())[::-1]}


@dataclass(slots=True)
class PageClient:
    """A connected page.  user : user of its program, if known; wrong_keys : number of wrong keys"""

    user: str
    wrong_keys: int = 0

    @property
    def is_refused(self) -> bool:
        """It has sent too many wrong keys."""
        return self.wrong_keys >= MAX_WRONG_KEYS


class CommandGate:
    """Handles the messages of all pages.  key : the command key; now_ns : monotonic clock"""

    def __init__(self, key: str, send: Send, now_ns: Callable[[], int]) -> None:
        self._key = key.encode()
        self._send = send
        self._now_ns = now_ns
        self._taken: deque[int] = deque(maxlen=MAX_PER_SECOND)

    def handle_message(self, message: str, client: PageClient) -> dict[str, Any] | None:
        """Execute a message; returns ``{"type": "answer", "id", "fault"}``, or None if it is not a command."""
        try:
            command = json.loads(message)
        except (ValueError, RecursionError):
            return None
        if not isinstance(command, dict) or "command" not in command:
            return None
        return {"type": "answer", "id": command.get("id"), "fault": self._refusal(command, client)}

    def _refusal(self, command: Mapping[str, Any], client: PageClient) -> str | None:
        """Why a command is refused; None when it was sent to the daemon."""
        if fault := self._fault_of_key(command.get("key"), client):
            return fault
        if command["command"] == CHECK:
            return None
        found = READERS.get(str(command["command"]), read_mark)(command, client.user)
        if isinstance(found, str):
            return found
        if not self._is_within_rate():
            return f"more than {MAX_PER_SECOND} marks or commands per second"
        return None if self._send(found) else "the daemon cannot be reached"

    def _fault_of_key(self, key: object, client: PageClient) -> str | None:
        """Why a client may not command; None with the right key, unless it has sent too many wrong ones."""
        if not isinstance(key, str) or not key:
            return WITHOUT_KEY
        if not client.is_refused and hmac.compare_digest(key.encode(errors="replace"), self._key):
            return None
        client.wrong_keys += 1
        return WRONG_KEY

    def _is_within_rate(self) -> bool:
        """Count a command, unless the rate limit is reached."""
        now = self._now_ns()
        if len(self._taken) == MAX_PER_SECOND and now - self._taken[0] < NS_PER_S:
            return False
        self._taken.append(now)
        return True


def read_mark(command: Mapping[str, Any], user: str) -> control.PageMark | str:
    """The message to the daemon for a mark, or its error.  user : user of the browser"""
    text, name = clean_text(command.get("text")), command["command"]
    if not isinstance(name, str) or name not in MARKS or text is None:
        return UNKNOWN_COMMAND
    return fault_of_mark(text) or control.PageMark(text, user, MARKS[name])


def read_device_command(command: Mapping[str, Any], user: str) -> control.PageCommand | str:
    """The message to the daemon for a command to a device, ``{device, name, args, request}``, or its error.

    request : identifier chosen by the page for each click; the daemon sends a repetition only once
    user    : user of the browser
    """
    names = {"id": "request", "device": "device", "command": "name"}
    texts: dict[str, Any] = {key: command.get(source) for key, source in names.items()}
    args = command.get("args")
    if not isinstance(args, dict) or not all(isinstance(text, str) for text in (*texts.values(), *args.values())):
        return UNKNOWN_COMMAND
    return control.PageCommand(**texts, args=args, who=user)


def read_acknowledgement(command: Mapping[str, Any], user: str) -> control.PageAcknowledgement | str:
    """The message to the daemon for the acknowledgement of an alarm, or of all (None), or its error."""
    alarm_id = command.get("alarm")
    if alarm_id is not None and not (isinstance(alarm_id, str) and len(alarm_id) <= MAX_TEXT_CHARS):
        return UNKNOWN_COMMAND
    return control.PageAcknowledgement(alarm_id, user)


#: Reader of each command; all others are marks.
READERS = {"send": read_device_command, "acknowledge": read_acknowledgement}


def clean_text(text: object) -> str | None:
    """A text on one line of printable characters; None if it is not a text."""
    if not isinstance(text, str):
        return None
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def fault_of_mark(text: str) -> str | None:
    """Why a text cannot be a mark; None when it can."""
    if 1 <= len(text) <= MAX_TEXT_CHARS:
        return None
    return f"a mark must have 1 to {MAX_TEXT_CHARS} characters, not {len(text)}"
