"""A commander whose recorder and devices are played by a test."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, cast

from fti.clock import FakeClock
from fti.config import Config, Device, SerialLink, Session, StrictModel
from fti.devices import BoundDevice
from fti.drivers import Command, Driver
from fti.messages.control import DeviceAnswer, SendBytes, SendResult
from fti.messages.tables import to_table
from fti.service.supervisor.command_catalogue import CommandCatalogue
from fti.service.supervisor.command_tracker import CommandTracker
from tests.helpers import until_async

CommandTask = asyncio.Task[dict[str, Any]]
SECOND_NS = 1_000_000_000
COMMANDS = {
    "rate": Command("set the output rate", {"rate": "Hz, 1 to 20"}),
    "reset": Command("start again", answered=False),
}


def command(name: str, args: Mapping[str, str], options: StrictModel | None = None) -> bytes:
    """A driver's command: ``rate`` takes 1 to 20."""
    if name == "rate" and args.get("rate", "") not in map(str, range(1, 21)):
        raise ValueError(f"rate = {args.get('rate')}: must be 1 to 20 Hz")
    return f"*{name}{args.get('rate', '')}\r".encode()


def make_catalogue() -> CommandCatalogue:
    links = tuple(SerialLink(name=n, kind="serial", port="x", transmit=n != "mute") for n in ("line", "mute"))
    speaking = cast(Driver, SimpleNamespace(COMMANDS=COMMANDS, command=command, poll=lambda options: None))
    deaf = cast(Driver, SimpleNamespace(COMMANDS={}, poll=lambda options: (60.0, b"?")))
    devices = [
        BoundDevice(Device(name=name, link=link, driver="d"), driver, StrictModel())
        for name, link, driver in (
            ("mag", "line", speaking),
            ("other", "line", speaking),
            ("shut", "mute", speaking),
            ("gnss", "line", deaf),
        )
    ]
    return CommandCatalogue(Config(session=Session(name="s"), link=links, path="a.toml"), devices)


class Bench:
    """A commander whose recorder and devices are played by the test."""

    def __init__(self) -> None:
        self.clock = FakeClock(10 * SECOND_NS)
        self.sent: list[dict[str, Any]] = []
        self.events: list[tuple[str, str]] = []
        self.shown: list[dict[str, Any]] = []
        self.there = True
        self.hint = ""
        self.command_tracker = CommandTracker(
            make_catalogue(),
            self.clock,
            send=self._send,
            report_event=lambda level, text: self.events.append((level, text)),
            changed=lambda command: self.shown.append(to_table(command)),
            delay_reason=lambda: self.hint,
        )

    def _send(self, message: SendBytes) -> bool:
        if self.there:
            self.sent.append(to_table(message))
        return self.there

    def ask(
        self, key: str = "k1", name: str = "rate", device: str = "mag", **more: Any
    ) -> asyncio.Task[dict[str, Any]]:
        args = {"rate": "10"} if name == "rate" else {}
        request = {"id": key, "device": device, "command": name, "args": args, "timeout_s": 30.0, **more}
        return asyncio.create_task(self.command_tracker.handle_command(request, "an engineer"))

    async def ask_and_send(self, *names: str, **more: Any) -> CommandTask:
        """Ask, and let the recorder send it."""
        task = self.ask(*names, **more)
        before = len(self.sent)
        await until_async(lambda: len(self.sent) > before)
        self.confirm_sending()
        return task

    def confirm_sending(self, number: int | None = None, fault: str | None = None, partly: bool = False) -> None:
        number = number or self.sent[-1]["id"]
        self.command_tracker.on_sent(SendResult(number, fault, partly, self.clock.now_ns()))

    def answer(self, name: str = "rate", accepted: bool = True, detail: str = "", device: str = "mag") -> None:
        t_ns = self.clock.now_ns()
        answer = DeviceAnswer(device=device, t_ns=t_ns, command=name, accepted=accepted, detail=detail)
        self.command_tracker.on_ack(answer)
