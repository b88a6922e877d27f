"""Transmissions: each command once, with one reply; nothing after its deadline, and nothing after stop."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from fti.clock import FakeClock
from fti.config import Config, Device, SerialLink, Session
from fti.devices import bind_devices
from fti.errors import LinkError, PartialSendError
from fti.links import Link, LinkStatus, Sink
from fti.messages.control import SendBytes, SendResult
from fti.messages.tables import to_table
from fti.service.navigation.decode_chain import Chain
from fti.service.navigation.device_monitor import POLLING_BLOCKED, DeviceMonitor
from fti.service.recorder.transmitter import COMMAND_TIMEOUT_S, Transmitter
from fti.service.startup import LinkStartup, RecorderStartup
from fti.service.supervisor.startup_checks import ValidatedConfig
from tests.helpers import until_async

SECOND_NS = 1_000_000_000


class FakeLink:
    """Takes what is sent as far as ``takes`` allows it."""

    def __init__(self) -> None:
        self.name = "line"
        self.status = LinkStatus()
        self.on_sent: Sink | None = None
        self.urgent = False
        self.taken: list[tuple[bytes, float]] = []
        self.takes = asyncio.Event()
        self.takes.set()
        self.fault: Exception | None = None

    async def run(self) -> None: ...

    async def drain(self) -> None: ...

    async def send(self, data: bytes, timeout_s: float = 1.0) -> int:
        await self.takes.wait()
        if self.fault:
            raise self.fault
        self.taken.append((data, timeout_s))
        return len(data)


class Rig:
    def __init__(self, *polls: tuple[float, str]) -> None:
        self.clock, self.link, self.replies = FakeClock(5 * SECOND_NS), FakeLink(), list[SendResult]()
        links: dict[str, Link] = {"line": self.link}
        startups = {"line": LinkStartup(polls=polls)}
        self.sender = Transmitter(links, startups, self.clock, send_reply=self.replies.append, report=self.fail)

    def fail(self, unit: str, error: Exception) -> None:
        raise AssertionError(unit) from error

    async def reply(self, link: str = "line", until_ns: int | None = None) -> dict[str, Any]:
        """The reply to a request."""
        self.replies.clear()
        self.sender.handle_command(SendBytes(4, link, "2a31", until_ns))
        await until_async(lambda: self.replies)
        reply: dict[str, Any] = to_table(self.replies[0])
        return reply


async def test_a_command_is_sent_and_reported() -> None:
    rig = Rig()
    reply = {"id": 4, "fault": None, "partly": False, "t_ns": 5 * SECOND_NS}
    assert await rig.reply() == reply
    assert await rig.reply(until_ns=6 * SECOND_NS) == reply
    assert rig.link.taken == [(b"*1", COMMAND_TIMEOUT_S), (b"*1", 1.0)]


async def test_what_nobody_waits_for_any_more_is_not_sent() -> None:
    """A recorder that was stopped, or had no time, must not do later what was given up before."""
    rig = Rig()
    reply = await rig.reply(until_ns=SECOND_NS)
    assert reply["fault"] == "it reached the recorder 4.0 s after its deadline"
    assert rig.link.taken == []


@pytest.mark.parametrize(
    ("fault", "text"),
    [(LinkError("link line: is not connected"), "not connected"), (ValueError("transmit"), "transmit")],
)
async def test_why_it_was_not_sent_is_reported(fault: Exception, text: str) -> None:
    rig = Rig()
    rig.link.fault = fault
    assert text in (await rig.reply())["fault"]
    assert "unknown link 'none'" in (await rig.reply(link="none"))["fault"]
    rig.link.fault = PartialSendError("its first 3 bytes are sent")
    assert (await rig.reply())["partly"]


async def test_whatever_a_link_does_there_is_a_word(monkeypatch: pytest.MonkeyPatch) -> None:
    rig, failed = Rig(), list[str]()
    monkeypatch.setattr(rig.sender, "_report", lambda unit, error: failed.append(unit))
    rig.link.fault = AssertionError("a driver of a vendor")
    reply = await rig.reply()
    assert (reply["fault"], reply["partly"], failed) == ("AssertionError: a driver of a vendor", True, ["send"])


async def test_after_stop_nothing_is_sent() -> None:
    rig = Rig((0.001, "3f"))
    rig.link.takes.clear()
    rig.sender.start()
    rig.sender.handle_command(SendBytes(4, "line", "2a31"))
    await asyncio.sleep(0)
    await rig.sender.stop()
    rig.sender.handle_command(SendBytes(5, "line", "2a31"))
    rig.link.takes.set()
    await asyncio.sleep(0.01)
    assert (rig.link.taken, rig.replies) == ([], [])


async def test_a_question_is_repeated_though_the_link_is_down() -> None:
    rig = Rig((0.001, "3f"))
    rig.link.fault = LinkError("down")
    rig.sender.start()
    await asyncio.sleep(0)
    rig.link.fault = None
    await until_async(lambda: len(rig.link.taken) >= 3)
    assert {data for data, _ in rig.link.taken} == {b"?"}
    await rig.sender.stop()


# ------------------------------------------------------------------------------------- where nothing may be sent


def make_config(transmit: bool) -> Config:
    link = SerialLink(name="line", kind="serial", port="x", transmit=transmit)
    device = Device(name="laser", link="line", driver="lightware_ascii", options={"query": "d"})
    return Config(session=Session(name="s"), link=(link,), device=(device,))


@pytest.mark.parametrize("transmit", [False, True])
def test_nothing_is_asked_where_nothing_may_be_sent(transmit: bool) -> None:
    text = ValidatedConfig(make_config(transmit), 0).recorder_startup([_place()])
    sending = RecorderStartup.model_validate_json(text).sending
    assert {name: len(startup.polls) for name, startup in sending.items()} == ({"line": 1} if transmit else {})


def _place() -> Any:
    from pathlib import Path

    from fti.logger.storage_target import StorageTarget

    return StorageTarget(Path("/x"), Path("/"))


@pytest.mark.parametrize("transmit", [False, True])
def test_a_silent_device_that_is_not_asked_has_a_hint(transmit: bool) -> None:
    config = make_config(transmit)
    diagnosis = DeviceMonitor(config, Chain(config, bind_devices(config, {}), None))
    health = diagnosis.devices(SECOND_NS)["laser"]
    assert health.state == "silent"
    assert (POLLING_BLOCKED in health.hint) is not transmit
