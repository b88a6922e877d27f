"""Commands to an emulated receiver on a pty, through a real daemon, and what the recording says of them."""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import os
import pwd
import re
import signal
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from fti.cli.main import main
from fti.drivers import ublox_ubx
from fti.errors import FtiError
from fti.logger.reading.recording import Recording
from fti.service.control_client import send_command
from tests.e2e.harness import Daemon, Line, daemon, fti
from tests.helpers import until

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(900)]

CONFIG = """
[session]
name = "bench"
directory = "out"
min_free_mb = 10

[[link]]
name = "line"
kind = "serial"
port = "line"
transmit = true
half_duplex = true

[[link]]
name = "shut"
kind = "serial"
port = "shut"

[[device]]
name = "gnss"
link = "line"
driver = "ublox_ubx"

[[device]]
name = "spare"
link = "shut"
driver = "ublox_ubx"

[display]
port = 0
"""
LONG_S = 30.0


class Receiver:
    """The emulated receiver at the far end of a line; it may keep its answers to itself."""

    def __init__(self, line: Line) -> None:
        self._line, self._encoder = line, ublox_ubx.make_encoder(ublox_ubx.Options())
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="receiver")
        self.received = bytearray()
        self.replies: list[bytes] = []
        self.speaks = True

    def __enter__(self) -> Receiver:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()

    def speak(self) -> None:
        """Say what was kept."""
        self._line.write(b"".join(self.replies))
        self.replies.clear()

    def _run(self) -> None:
        while not self._stop.wait(0.002):
            data = self._line.read()
            self.received += data
            self.replies += self._encoder.respond(data) if data else []
            if self.speaks:
                self.speak()


class Bench:
    """A daemon, what it is asked in this test, and the receiver."""

    def __init__(self, running: Daemon, receiver: Receiver) -> None:
        self.running, self.receiver = running, receiver
        self.run_dir = str(running.run_dir)

    def send(self, *arguments: str) -> tuple[int, str, str]:
        """``fti send``: exit code, standard output, standard error."""
        return call("send", *arguments, "--run-dir", self.run_dir)

    def send_command(self, key: str, period_ms: int, timeout_s: float = LONG_S, device: str = "gnss") -> dict[str, Any]:
        """The same over the control socket, with a number of our own."""
        request = {"id": key, "device": device, "command": "rate", "args": {"period_ms": str(period_ms)}}
        return send_command({"send": request | {"timeout_s": timeout_s}}, self.run_dir, 2 * LONG_S)

    def tx_frames(self) -> int:
        """How many the recorder says that it has sent."""
        return int(self.running.health()["links"].get("line", {}).get("tx_frames", 0))


def call(*arguments: str) -> tuple[int, str, str]:
    """A command in this process, which has loaded everything: exit code, standard output, standard error."""
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = main(arguments)
    return code, out.getvalue(), err.getvalue()


def rate(period_ms: int) -> bytes:
    return ublox_ubx.command("rate", {"period_ms": str(period_ms)}, ublox_ubx.Options())


def test_commands_go_out_once_and_come_back_and_stand_in_the_file(tmp_path: Path) -> None:
    links = tmp_path / "links"
    links.mkdir()
    line, shut = (contextlib.closing(Line(links / name)) for name in ("line", "shut"))
    (tmp_path / "bench.toml").write_text(CONFIG)
    with (
        line as far,
        shut as never,
        Receiver(far) as receiver,
        daemon(tmp_path / "bench.toml", tmp_path / "out", "--links", str(links)) as running,
    ):
        session = running.session
        bench = Bench(running, receiver)
        until(lambda: bench.running.health()["navigation"], LONG_S, "navigation")
        teaches(bench)
        refuses_what_may_not_be_sent(bench)
        sends_and_is_answered(bench)
        sends_the_same_request_once(bench)
        asyncio.run(is_refused_without_the_key(running.display, receiver))
        asyncio.run(sends_from_the_page(running.page, receiver))
        reports_silence_and_a_late_answer(bench)
        outlives_the_recorder(bench)
        ends_with_the_session(bench)
        assert never.read() == b""
    with pytest.raises(FtiError):
        bench.send_command("late", 100)
    stands_in_the_file(session, bytes(receiver.received), tmp_path)


def teaches(bench: Bench) -> None:
    code, out, _ = bench.send("--list")
    assert code == 0
    assert "line may transmit" in out.splitlines()[0]
    assert "shut may not transmit" in out.splitlines()[1]
    code, out, _ = bench.send("gnss", "--json")
    assert "25..65535 ms" in json.loads(out)["commands"]["rate"]["arguments"]["period_ms"]


def refuses_what_may_not_be_sent(bench: Bench) -> None:
    code, out, err = bench.send("spare", "rate", "period_ms=100")
    assert (code, out) == (2, "")
    assert 'set transmit = true at [[link]] name = "shut"' in err
    with pytest.raises(FtiError, match="unknown device 'none'; configured: gnss, spare"):
        bench.send_command("a", 100, device="none")
    with pytest.raises(FtiError, match="period_ms"):
        bench.send_command("b", 1)
    assert bench.receiver.received == b""


def sends_and_is_answered(bench: Bench) -> None:
    done = fti("send", "gnss", "rate", "period_ms=101", "--run-dir", bench.run_dir)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("1: gnss rate period_ms=101: acknowledged after ")
    assert bench.receiver.received == rate(101)


def sends_the_same_request_once(bench: Bench) -> None:
    with ThreadPoolExecutor(3) as pool:
        first, *others = [job.result() for job in [pool.submit(bench.send_command, "button", 102) for _ in range(3)]]
    assert first["state"] == "acknowledged"
    assert all(other == first for other in others)
    assert bench.send_command("button", 102) == first
    assert bench.receiver.received.count(rate(102)) == 1


async def is_refused_without_the_key(address: str, receiver: Receiver) -> None:
    """Whoever is on this machine can fetch the page and claim its Origin; that is no permission."""
    before = bytes(receiver.received)
    async with aiohttp.ClientSession() as client, asyncio.timeout(LONG_S):
        async with client.get(address) as response:
            served = re.findall(r"[A-Za-z0-9_-]{16,}", await response.text())
        for key in [None, *served]:
            async with client.ws_connect(f"{address}ws", headers={"Origin": address.rstrip("/")}) as ws:
                request = {"command": "send", "device": "gnss", "name": "rate", "args": {"period_ms": "200"}}
                await ws.send_json(request | {"request": "forged", "token": key, "key": key, "id": 1})
                while (answer := await ws.receive_json())["type"] != "answer":
                    pass
                assert answer["fault"].endswith("; to control: fti page")
    assert bytes(receiver.received) == before


async def sends_from_the_page(owner_address: str, receiver: Receiver) -> None:
    """As the page does: with the owner's key, and twice, because the button bounces."""
    address, _, key = owner_address.partition("#key=")
    async with (
        asyncio.timeout(LONG_S),
        aiohttp.ClientSession(headers={"Origin": address.rstrip("/")}) as client,
        client.ws_connect(f"{address}ws") as ws,
    ):
        content = await _next_commands(ws)
        assert [device["name"] for device in content["devices"]] == ["gnss"]
        request = {"command": "send", "device": "gnss", "name": "rate", "args": {"period_ms": "105"}}
        for n in range(2):
            await ws.send_json(request | {"request": "click", "key": key, "id": n})
        while not any(r["id"] == "click" and r["ended"] for r in content["requests"]):
            content = await _next_commands(ws)
    assert content["requests"][0]["state"] == "acknowledged"
    assert receiver.received.count(rate(105)) == 1


async def _next_commands(ws: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
    while (message := await ws.receive_json())["type"] != "commands":
        pass
    content: dict[str, Any] = message
    return content


def reports_silence_and_a_late_answer(bench: Bench) -> None:
    bench.receiver.speaks = False
    content = bench.send_command("silent", 103, timeout_s=0.3)
    assert (content["state"], content["detail"].partition(";")[0]) == ("timed out", "no answer within 0.3 s")
    bench.receiver.speaks = True
    until(lambda: bench.running.health()["devices"]["gnss"]["messages"] == 4, LONG_S, "the late answer")


def outlives_the_recorder(bench: Bench) -> None:
    bench.receiver.speaks = False
    before, pid = bench.tx_frames(), bench.running.pid_of("recorder")
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(bench.send_command, "killed", 104)
        until(lambda: bench.tx_frames() > before, LONG_S, "the word that it was sent")
        os.kill(pid, signal.SIGKILL)
        until(lambda: bench.running.pid_of("recorder") != pid, LONG_S, "another recorder")
        bench.receiver.speaks = True
        assert future.result()["state"] == "acknowledged"
    assert bench.receiver.received.count(rate(104)) == 1


def ends_with_the_session(bench: Bench) -> None:
    bench.receiver.speaks = False
    before = bench.tx_frames()
    with ThreadPoolExecutor(1) as pool:
        future = pool.submit(bench.send_command, "open", 106)
        until(lambda: bench.tx_frames() > before, LONG_S, "the word that it was sent")
        assert bench.running.stop() == 130
        found = future.result()
    assert (found["state"], found["detail"]) == ("unknown", "sent, but the session ended before an answer came")


def stands_in_the_file(session: Path, received: bytes, tmp_path: Path) -> None:
    recording = Recording.open(session)
    frames = [frame.data for frame in recording.sent_frames()]
    assert frames == [rate(ms) for ms in (101, 102, 105, 103, 104, 106)]
    assert b"".join(frames) == received
    events = [json.loads(data) for *_, data in recording.messages("/fti/event", kind="raw")]
    texts = [event["message"] for event in events if event["name"] == "command"]
    assert f"1: gnss rate period_ms=101 for {os.environ.get('USER', 'root')} (process " in texts[3]
    assert texts[3].endswith(f"): {rate(101).hex()}")
    user = pwd.getpwuid(os.geteuid()).pw_name
    assert f"3: gnss rate period_ms=105 for the page (the owner's key, {user}): {rate(105).hex()}" in texts
    assert [text.partition(" after")[0] for text in texts if "acknowledged" in text] == [
        "1: gnss rate period_ms=101: acknowledged",
        "2: gnss rate period_ms=102: acknowledged",
        "3: gnss rate period_ms=105: acknowledged",
        "4: gnss rate period_ms=103: late answer: acknowledged",
        "5: gnss rate period_ms=104: acknowledged",
    ]
    assert sum("not sent for" in text for text in texts) == 3
    assert texts[-1] == "6: gnss rate period_ms=106: unknown: sent, but the session ended before an answer came"
    code, out, _ = call("verify", str(session))
    assert code == 3  # a recorder was killed
    assert "none is missing" in out
    assert out.count("\nloss ") == 1
    code, out, err = call("reprocess", str(session), "--out", str(tmp_path / "again"))
    assert code == 0, err
    again = [data for *_, data in Recording.open(Path(out.strip())).messages("/gnss/ack")]
    assert again == [data for *_, data in recording.messages("/gnss/ack")]
    assert len(again) == 5
