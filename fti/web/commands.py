"""What a page may ask for: a mark, a snapshot (a mark that triggers), a command to a device, or to acknowledge alarms.

Bounded in size and rate, and only with the key of this start, which the owner of the daemon alone can read.

Every program of this machine can open the WebSocket and claim any Origin, so neither is a permission.  A page has the
key from the address that its owner opened; one without it only shows.  ``check`` asks whether a key fits.
"""

from __future__ import annotations

import hmac
import json
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

MAX_TEXT_CHARS = 200
MAX_PER_SECOND = 5
#: A connection that has shown so many keys that do not fit is closed.
MAX_WRONG_KEYS = 3
NS_PER_S = 1_000_000_000
#: Command of the page to what the daemon is told beside the text of a mark.
MARKS: dict[str, dict[str, bool]] = {"mark": {}, "snapshot": {"trigger": True}}
UNKNOWN_COMMAND = "there is no such command"
CHECK = "check"
WITHOUT_KEY = "view only; to control: fti page"
WRONG_KEY = "the key is old; to control: fti page"
#: Hands a command to the daemon; False when it cannot be reached.
Send = Callable[[Mapping[str, Any]], bool]


@dataclass(slots=True)
class PageClient:
    """A connected page.  user : whose program it is, as far as that is known; wrong_keys : how many it has shown"""

    user: str
    wrong_keys: int = 0

    @property
    def is_refused(self) -> bool:
        """It has shown too many."""
        return self.wrong_keys >= MAX_WRONG_KEYS


class CommandGate:
    """Takes the messages of all pages together.  key : with which they may command; now_ns : monotonic clock."""

    def __init__(self, key: str, send: Send, now_ns: Callable[[], int]) -> None:
        self._key = key.encode()
        self._send = send
        self._now_ns = now_ns
        self._taken: deque[int] = deque(maxlen=MAX_PER_SECOND)

    def handle_message(self, message: str, client: PageClient) -> dict[str, Any] | None:
        """Do what a message says; ``{"type": "answer", "id", "fault"}``, or None when it is no command."""
        try:
            command = json.loads(message)
        except (ValueError, RecursionError):
            return None
        if not isinstance(command, dict) or "command" not in command:
            return None
        return {"type": "answer", "id": command.get("id"), "fault": self._refusal(command, client)}

    def _refusal(self, command: Mapping[str, Any], client: PageClient) -> str | None:
        """Why a command is refused; None when it was handed on."""
        if fault := self._fault_of_key(command.get("key"), client):
            return fault
        if command["command"] == CHECK:
            return None
        found = READERS.get(str(command["command"]), read_mark)(command, client.user)
        if isinstance(found, str):
            return found
        if not self._has_room():
            return f"more than {MAX_PER_SECOND} marks or commands in a second"
        return None if self._send(found) else "the daemon does not listen"

    def _fault_of_key(self, key: object, client: PageClient) -> str | None:
        """Why a client may not command; one that has shown too many keys may not any more."""
        if not isinstance(key, str) or not key:
            return WITHOUT_KEY
        if not client.is_refused and hmac.compare_digest(key.encode(errors="replace"), self._key):
            return None
        client.wrong_keys += 1
        return WRONG_KEY

    def _has_room(self) -> bool:
        """Count a command, unless the last second was full of them."""
        now = self._now_ns()
        if len(self._taken) == MAX_PER_SECOND and now - self._taken[0] < NS_PER_S:
            return False
        self._taken.append(now)
        return True


def read_mark(command: Mapping[str, Any], user: str) -> dict[str, Any] | str:
    """A mark as the daemon takes it, or why it is none.  user : whose browser it comes from"""
    text, name = clean_text(command.get("text")), command["command"]
    if not isinstance(name, str) or name not in MARKS or text is None:
        return UNKNOWN_COMMAND
    return fault_of_mark(text) or {"mark": text, **MARKS[name], "who": user}


def read_device_command(command: Mapping[str, Any], user: str) -> dict[str, Any] | str:
    """A command to a device, ``{device, name, args, request}``, as the daemon takes it, or why it is none.

    request : the page's number of it, made once for each click; the daemon sends the same one once
    user    : whose browser it comes from
    """
    texts = {key: command.get(source) for key, source in (("id", "request"), ("device", "device"), ("command", "name"))}
    args = command.get("args")
    if not isinstance(args, dict) or not all(isinstance(text, str) for text in (*texts.values(), *args.values())):
        return UNKNOWN_COMMAND
    return {"send": {**texts, "args": args}, "who": user}


def read_acknowledgement(command: Mapping[str, Any], user: str) -> dict[str, Any] | str:
    """The identity of an alarm, or None for all, as the daemon takes it; or why it is none.  user : who has seen it"""
    alarm_id = command.get("alarm")
    if alarm_id is not None and not (isinstance(alarm_id, str) and len(alarm_id) <= MAX_TEXT_CHARS):
        return UNKNOWN_COMMAND
    return {"acknowledge": alarm_id, "who": user}


#: What reads a command; all others are marks.
READERS = {"send": read_device_command, "acknowledge": read_acknowledgement}


def clean_text(text: object) -> str | None:
    """A text on one line of printable characters; None when it is no text."""
    if not isinstance(text, str):
        return None
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def fault_of_mark(text: str) -> str | None:
    """Why a text cannot be a mark; None when it can."""
    if 1 <= len(text) <= MAX_TEXT_CHARS:
        return None
    return f"a mark has 1 to {MAX_TEXT_CHARS} characters, not {len(text)}"
