"""A command to a device: the request of a client, and its state until the end."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from fti.messages.control import CommandProgress, DeviceAnswer

DEFAULT_TIMEOUT_S, MAX_TIMEOUT_S = 3.0, 600.0
MAX_KEY_CHARS = 100
#: Maximum length of all texts of a request: it is stored, recorded in an event, and shown on the page.
MAX_REQUEST_CHARS = 2000
MS = 1_000_000


class CommandState(StrEnum):
    """State of a command; the first two are intermediate, the others final."""

    SENDING = "sending"
    WAITING = "waiting"  # sent, not answered yet
    ACKNOWLEDGED = "acknowledged"
    REFUSED = "refused"  # by the device
    SENT = "sent"  # the device does not acknowledge it
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
    """A request of a client.  key : identifier chosen by the client; timeout_s : timeout of the answer [s]"""

    key: str
    device: str
    command: str
    args: Mapping[str, str]
    timeout_s: float

    def is_same(self, other: CommandRequest) -> bool:
        """The same command; the timeout may differ."""
        return (self.device, self.command, self.args) == (other.device, other.command, other.args)


def parse_request(message: Mapping[str, Any]) -> CommandRequest | str:
    """The request in a message ``{id, device, command, args, timeout_s}``, or a text with its error."""
    key, args = message.get("id"), message.get("args", {})
    timeout_s = message.get("timeout_s", DEFAULT_TIMEOUT_S)
    if not isinstance(key, str) or not 1 <= len(key) <= MAX_KEY_CHARS:
        return f"id must have 1 to {MAX_KEY_CHARS} characters"
    device, command = message.get("device"), message.get("command")
    if not isinstance(device, str) or not isinstance(command, str):
        return "device and command must be texts"
    if not isinstance(args, dict) or not all(isinstance(value, str) for value in args.values()):
        return "args must be texts by name"
    if sum(map(len, (device, command, *args, *args.values()))) > MAX_REQUEST_CHARS:
        return f"device, command and args must have at most {MAX_REQUEST_CHARS} characters together"
    if not isinstance(timeout_s, int | float) or not 0 < timeout_s <= MAX_TIMEOUT_S:
        return f"timeout_s must be more than 0 and at most {MAX_TIMEOUT_S:g} seconds"
    return CommandRequest(key, device, command, args, float(timeout_s))


@dataclass(slots=True, eq=False)
class TrackedCommand:
    """A requested command.

    number        : number in the session, from 1; 0 when it was denied
    t_ns          : FTI time of the request; sent_ns, answered_ns : of sending and of the answer
    delay_causes  : possible reasons for a missing answer
    early_answers : answers that came before the confirmation of sending
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
    early_answers: list[DeviceAnswer] = field(default_factory=list)
    end_event: asyncio.Event = field(default_factory=asyncio.Event)
    timer: asyncio.TimerHandle | None = None

    def title(self) -> str:
        """Number, device, command and arguments as a text."""
        args = "".join(f" {name}={value}" for name, value in self.command_request.args.items())
        what = f"{self.command_request.device} {self.command_request.command}{args}"
        return f"{self.number}: {what}" if self.number else what

    def outcome(self) -> str:
        """Its state as a text."""
        after = ""
        if self.answered_ns is not None and self.sent_ns is not None:
            after = f" after {max(0, self.answered_ns - self.sent_ns) / MS:.0f} ms"
        return f"{self.state}{after}" + (f": {self.detail}" if self.detail else "")

    def progress(self) -> CommandProgress:
        """Its state, as displays and clients get it."""
        return CommandProgress(
            id=self.command_request.key,
            number=self.number,
            device=self.command_request.device,
            command=self.command_request.command,
            args=dict(self.command_request.args),
            who=self.who,
            data=self.data.hex(),
            title=self.title(),
            outcome=self.outcome(),
            state=self.state.value,
            detail=self.detail,
            ended=self.end_event.is_set(),
            t_ns=self.t_ns,
            sent_ns=self.sent_ns,
            answered_ns=self.answered_ns,
        )

    def matches_answer(self, ack: DeviceAnswer, margin_ns: int) -> bool:
        """The answer is from this device, names this command or none, and did not come before it was sent."""
        since = self.t_ns if self.sent_ns is None else self.sent_ns - margin_ns
        named = ack.command in ("", self.command_request.command)
        return ack.device == self.command_request.device and named and ack.t_ns >= since

    def describe_answer(self, ack: DeviceAnswer) -> str:
        """A text about an answer after the timeout."""
        verb = "acknowledged" if ack.accepted else "refused"
        after = (ack.t_ns - (self.sent_ns or self.t_ns)) / 1e9
        return f"{verb} after {after:.1f} s" + (f": {ack.detail}" if ack.detail else "")

    def take_early_answers(self) -> list[DeviceAnswer]:
        """Remove and return the answers that came before the confirmation of sending."""
        answers, self.early_answers = self.early_answers, []
        return answers

    def end(self, state: CommandState, detail: str) -> None:
        """Set the final state."""
        self.state, self.detail = state, detail
        self.disarm()
        self.end_event.set()

    def disarm(self) -> None:
        """Cancel the timer."""
        if self.timer:
            self.timer.cancel()
            self.timer = None
