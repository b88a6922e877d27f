"""One command on its way: what was wished, by whom, and what has become of it."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

DEFAULT_TIMEOUT_S, MAX_TIMEOUT_S = 3.0, 600.0
MAX_KEY_CHARS = 100
#: Characters of everything that a wish says: it is kept, told in an event, and shown on the page.
MAX_REQUEST_CHARS = 2000
MS = 1_000_000


class CommandState(StrEnum):
    """What has become of a command; the first two go on, the others are its end."""

    SENDING = "sending"
    WAITING = "waiting"  # sent, and not answered yet
    ACKNOWLEDGED = "acknowledged"
    REFUSED = "refused"  # by the device
    SENT = "sent"  # and not acknowledged, by design
    TIMED_OUT = "timed out"
    NOT_SENT = "not sent"
    UNKNOWN = "unknown"  # whether it was sent, or what the device answered
    DENIED = "denied"  # by the daemon: nothing was sent

    @property
    def level(self) -> str:
        """Level of its event."""
        return "info" if self in (CommandState.ACKNOWLEDGED, CommandState.SENT) else "warning"


@dataclass(frozen=True, slots=True)
class CommandRequest:
    """What a client wants.  key : its own number of it; timeout_s : how long it waits for an answer [s]"""

    key: str
    device: str
    command: str
    args: Mapping[str, str]
    timeout_s: float

    def is_same(self, other: CommandRequest) -> bool:
        """The same command, however long somebody waits for it."""
        return (self.device, self.command, self.args) == (other.device, other.command, other.args)


def parse_request(message: Mapping[str, Any]) -> CommandRequest | str:
    """The wish in a message ``{id, device, command, args, timeout_s}``, or what is wrong with it."""
    key, args = message.get("id"), message.get("args", {})
    timeout_s = message.get("timeout_s", DEFAULT_TIMEOUT_S)
    if not isinstance(key, str) or not 1 <= len(key) <= MAX_KEY_CHARS:
        return f"a command has an id of 1 to {MAX_KEY_CHARS} characters"
    device, command = message.get("device"), message.get("command")
    if not isinstance(device, str) or not isinstance(command, str):
        return "device and command are texts"
    if not isinstance(args, dict) or not all(isinstance(value, str) for value in args.values()):
        return "args are texts by name"
    if sum(map(len, (device, command, *args, *args.values()))) > MAX_REQUEST_CHARS:
        return f"device, command and args have at most {MAX_REQUEST_CHARS} characters together"
    if not isinstance(timeout_s, int | float) or not 0 < timeout_s <= MAX_TIMEOUT_S:
        return f"timeout_s is more than 0 and at most {MAX_TIMEOUT_S:g} seconds"
    return CommandRequest(key, device, command, args, float(timeout_s))


@dataclass(slots=True, eq=False)
class TrackedCommand:
    """A command that was asked for.

    number      : of the session, from 1; 0 when it was denied
    t_ns        : FTI time at which it was asked for; sent_ns, answered_ns : when it was sent and answered
    troubles    : what may have cost an answer; early : answers that came before the word that it was sent
    """

    command_request: CommandRequest
    number: int
    who: str
    t_ns: int
    data: bytes
    answered: bool
    state: CommandState = CommandState.SENDING
    detail: str = ""
    sent_ns: int | None = None
    answered_ns: int | None = None
    delay_causes: list[str] = field(default_factory=list)
    early: list[Mapping[str, Any]] = field(default_factory=list)
    ended: asyncio.Event = field(default_factory=asyncio.Event)
    timer: asyncio.TimerHandle | None = None

    def title(self) -> str:
        """Number, device, command and arguments, for people."""
        args = "".join(f" {name}={value}" for name, value in self.command_request.args.items())
        what = f"{self.command_request.device} {self.command_request.command}{args}"
        return f"{self.number}: {what}" if self.number else what

    def outcome(self) -> str:
        """What became of it, for people."""
        after = ""
        if self.answered_ns is not None and self.sent_ns is not None:
            after = f" after {max(0, self.answered_ns - self.sent_ns) / MS:.0f} ms"
        return f"{self.state}{after}" + (f": {self.detail}" if self.detail else "")

    def describe(self) -> dict[str, Any]:
        """Everything, in plain JSON types."""
        return {
            "id": self.command_request.key,
            "number": self.number,
            "device": self.command_request.device,
            "command": self.command_request.command,
            "args": dict(self.command_request.args),
            "who": self.who,
            "data": self.data.hex(),
            "title": self.title(),
            "outcome": self.outcome(),
            "state": self.state.value,
            "detail": self.detail,
            "ended": self.ended.is_set(),
            "t_ns": self.t_ns,
            "sent_ns": self.sent_ns,
            "answered_ns": self.answered_ns,
        }

    def matches_answer(self, ack: Mapping[str, Any], margin_ns: int) -> bool:
        """The answer is of that device, names this command or none, and did not come before it was sent."""
        since = self.t_ns if self.sent_ns is None else self.sent_ns - margin_ns
        named = ack["command"] in ("", self.command_request.command)
        return bool(ack["device"] == self.command_request.device and named and ack["t_ns"] >= since)

    def describe_answer(self, ack: Mapping[str, Any]) -> str:
        """An answer that came when nobody waited for it any more."""
        said = "acknowledged" if ack["accepted"] else "refused"
        after = (ack["t_ns"] - (self.sent_ns or self.t_ns)) / 1e9
        return f"{said} after {after:.1f} s" + (f": {ack['detail']}" if ack["detail"] else "")

    def take_early_answers(self) -> list[Mapping[str, Any]]:
        """The answers that came before the word that it was sent; once."""
        early, self.early = self.early, []
        return early

    def end(self, state: CommandState, detail: str) -> None:
        """It is known what became of it."""
        self.state, self.detail = state, detail
        self.disarm()
        self.ended.set()

    def disarm(self) -> None:
        """Nobody waits any more."""
        if self.timer:
            self.timer.cancel()
            self.timer = None
