"""Half-duplex lines, and lines with an echo."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.config import SerialLink
from fti.errors import LinkError
from fti.hil.ports.endpoints import make_endpoint
from fti.links.half_duplex import Echo, LineTurn, TimedBytes, character_s, quiet_s
from fti.links.serial import open_port
from tests.helpers import until_async
from tests.links.bench import Peer, ReceivedFrames, run_link

LONG_MS = 60_000.0


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[Peer]:
    result = Peer(tmp_path / "line")
    yield result
    result.power_off()


def link(peer: Peer | None = None, **keys: Any) -> SerialLink:
    port = str(peer.path) if peer else "x"
    return SerialLink(name="line", kind="serial", port=port, transmit=True, **keys)


#: Bytes that are often the beginning of others.
ALIKE = st.text("ab", min_size=1, max_size=4).map(str.encode)


# ------------------------------------------------------------------------------------------------------------ times


@pytest.mark.parametrize(
    ("keys", "character_ms", "quiet_ms"),
    [
        ({"baud": 9600}, 10 / 9.6, 3.5 * 10 / 9.6 + 20),
        ({"baud": 19200, "parity": "even", "stop_bits": 2}, 12 / 19.2, 3.5 * 12 / 19.2 + 20),
        ({"baud": 1200, "data_bits": 7, "parity": "odd"}, 10 / 1.2, 3.5 * 10 / 1.2 + 20),
        ({"baud": 9600, "quiet_ms": 5.0}, 10 / 9.6, 5.0),
    ],
)
def test_the_times_follow_from_the_baud_rate(keys: dict[str, Any], character_ms: float, quiet_ms: float) -> None:
    assert character_s(link(**keys)) * 1000 == pytest.approx(character_ms)
    assert quiet_s(link(**keys)) * 1000 == pytest.approx(quiet_ms)


def test_a_question_has_the_line_until_its_answer_is_over() -> None:
    turn = LineTurn(quiet_s=0.02, answer_s=0.25, character_s=0.001)
    assert turn.wait_time_s(0.0) < 0
    turn.mark_sent(10, 0.0)
    assert turn.wait_time_s(0.0) == pytest.approx(0.26)  # on the line for 10 ms, then the answer may begin
    turn.mark_received(0.1)
    assert turn.wait_time_s(0.1) == pytest.approx(0.02)  # the answer has begun: it is over when the line is quiet
    turn.mark_received(0.115)
    assert turn.wait_time_s(0.125) == pytest.approx(0.01)
    turn.mark_sent(10, 0.2)
    assert turn.wait_time_s(0.5) < 0  # nobody answers


def test_what_the_kernel_has_taken_is_on_the_line_one_after_the_other() -> None:
    turn = LineTurn(quiet_s=0.02, answer_s=0.0, character_s=0.001)
    turn.mark_sent(100, 0.0)
    turn.mark_sent(100, 0.01)
    assert turn.wait_time_s(0.1) == pytest.approx(0.12)


# ----------------------------------------------------------------------------------------------------- half duplex


async def test_the_second_question_waits_for_the_answer_to_the_first(peer: Peer) -> None:
    config = link(peer, half_duplex=True, quiet_ms=5, answer_ms=LONG_MS)
    async with run_link(config) as (opened, received):
        first = asyncio.create_task(opened.send(b"one\r", 30.0))
        second = asyncio.create_task(opened.send(b"two\r", 30.0))
        third = asyncio.create_task(opened.send(b"three\r", 30.0))
        await peer.expect(b"one\r")
        await first
        peer.write(b"1")
        await peer.expect(b"two\r")
        assert received.bytes == b"1"
        await second
        assert not third.done()
        peer.write(b"2")
        await peer.expect(b"three\r")
        await third


async def test_a_question_that_nobody_answers_gives_the_line_free(peer: Peer) -> None:
    async with run_link(link(peer, half_duplex=True, answer_ms=20), [b"hello\r"]) as (opened, _):
        await opened.send(b"one\r", 30.0)
        await opened.send(b"two\r", 30.0)
        await peer.expect(b"hello\rone\rtwo\r")


async def test_a_sender_without_a_turn_gets_the_reason(peer: Peer) -> None:
    async with run_link(link(peer, half_duplex=True, quiet_ms=10_000)) as (opened, _):
        words = "half_duplex: the line must be quiet for 10000 ms before sending, and an answer has 250 ms to begin"
        with pytest.raises(LinkError, match=words):
            await opened.send(b"x", timeout_s=0.05)
        assert peer.read() == b""
        assert opened.status.tx_frames == 0


async def test_when_the_session_ends_nothing_is_sent_nor_a_greeting(peer: Peer) -> None:
    async with run_link(link(peer, half_duplex=True, quiet_ms=30, answer_ms=0), [b"hello\r"]) as (opened, _):
        await peer.expect(b"hello\r")
        await opened.drain()
        connects = opened.status.connects
        peer.power_off()
        peer.connect()
        await until_async(lambda: opened.status.connects > connects)
        with pytest.raises(LinkError, match="the session ends"):
            await opened.send(b"x", 30.0)
        assert peer.read() == b""
        assert opened.status.tx_frames == 1


async def test_a_sender_that_waits_while_the_device_dies_gets_an_error(peer: Peer) -> None:
    async with run_link(link(peer, half_duplex=True, quiet_ms=1000, answer_ms=0)) as (opened, _):
        sending = asyncio.create_task(opened.send(b"x", 30.0))
        await asyncio.sleep(0)
        peer.power_off()
        with pytest.raises(LinkError, match="not connected"):
            await sending
        peer.connect()


# ------------------------------------------------------------------------------------------------------------- echo


async def test_an_echo_is_sent_and_not_received(peer: Peer) -> None:
    async with run_link(link(peer, half_duplex=True, echo=True, answer_ms=LONG_MS)) as (opened, received):
        sent = ReceivedFrames()
        opened.on_sent = sent
        await opened.send(b"ask\r", 30.0)
        await peer.expect(b"ask\r")
        for piece in (b"a", b"sk", b"\rans", b"wer"):
            peer.write(piece)
            await asyncio.sleep(0)
        await until_async(lambda: received.bytes == b"answer")
        assert sent.bytes == b"ask\r"
        assert (opened.status.echo_bytes, opened.status.bytes) == (4, 6)
        assert opened.status.errors["echo_garbled"] == opened.status.errors["echo_missing"] == 0


async def test_the_emulator_echoes_where_the_line_does(tmp_path: Path) -> None:
    config = SerialLink(name="line", kind="serial", port=str(tmp_path / "line"), transmit=True, echo=True)
    endpoint = make_endpoint(config, tmp_path, lambda data: [b"answer to " + data])
    await endpoint.open()
    async with run_link(config) as (opened, received):
        await opened.send(b"ask")
        await until_async(lambda: received.bytes == b"answer to ask")
        assert opened.status.echo_bytes == 3
    endpoint.close()


async def test_an_echo_is_no_answer(peer: Peer) -> None:
    async with run_link(link(peer, half_duplex=True, echo=True, quiet_ms=5, answer_ms=LONG_MS)) as (opened, received):
        await opened.send(b"ask\r", 30.0)
        await peer.expect(b"ask\r")
        peer.write(b"ask\r")
        await until_async(lambda: opened.status.echo_bytes == 4)
        with pytest.raises(LinkError):
            await opened.send(b"more\r", 0.05)
        assert received.bytes == peer.read() == b""


async def test_what_was_taken_for_an_echo_is_not_lost(peer: Peer) -> None:
    """The transceiver does not hear itself, though the configuration says so, and the answer begins as the question."""
    async with run_link(link(peer, echo=True)) as (opened, received):
        await opened.send(b"\x01\x03ask", 30.0)
        await peer.expect(b"\x01\x03ask")
        peer.write(b"\x01\x03ok")
        await until_async(lambda: received.bytes == b"\x01\x03ok")
        assert opened.status.errors["echo_garbled"] == 1
        await opened.send(b"\x01\x03ask", 30.0)
        peer.write(b"\x01\x03")
        await until_async(lambda: received.bytes == b"\x01\x03ok\x01\x03")
        assert opened.status.errors["echo_missing"] == 1
        assert opened.status.echo_bytes == 0


async def test_an_echo_has_half_a_second_however_long_an_answer_may_take(peer: Peer) -> None:
    """What was taken for its beginning is received soon, while the answer to the next question is far away."""
    async with run_link(link(peer, half_duplex=True, echo=True, answer_ms=LONG_MS)) as (opened, received):
        await opened.send(b"\x01\x03ask", 30.0)
        peer.write(b"\x01\x03")
        await until_async(lambda: received.bytes == b"\x01\x03")
        assert opened.status.errors["echo_missing"] == 1


def test_the_beginning_of_no_echo_is_received_before_what_follows() -> None:
    echo = Echo()
    echo.expect(b"ask", 1.0)
    assert echo.take(b"as", 10) == []
    assert echo.take(b"x", 20) == [(b"as", 10), (b"x", 20)]
    assert echo.take(b"ask", 30) == [(b"ask", 30)]
    assert (echo.size, echo.garbled, echo.missing) == (0, 1, 0)


@given(st.lists(st.binary(min_size=1, max_size=6), max_size=5), st.binary(max_size=8), st.data())
def test_echoes_in_any_pieces_are_taken_out_and_nothing_else(
    sent: list[bytes], after: bytes, data: st.DataObject
) -> None:
    echo = Echo()
    for message in sent:
        echo.expect(message, 1.0)
    line = b"".join(sent) + after
    cuts = sorted(data.draw(st.sets(st.integers(0, len(line))) if line else st.just(set[int]())))
    reads = [read for a, b in itertools.pairwise([0, *cuts, len(line)]) for read in echo.take(line[a:b], b)]
    assert b"".join(part for part, _ in reads) == after
    assert (echo.size, echo.garbled) == (len(line) - len(after), 0)
    assert echo.expire(2.0) == []


@given(st.lists(ALIKE, max_size=4), st.lists(ALIKE, max_size=8))
def test_every_byte_is_an_echo_or_received(sent: list[bytes], came: list[bytes]) -> None:
    echo = Echo()
    for message in sent:
        echo.expect(message, 1.0)
    reads: list[TimedBytes] = []
    for n, part in enumerate(came):
        reads += echo.take(part, n)
    reads += echo.expire(2.0)
    assert sum(len(part) for part, _ in reads) + echo.size == sum(map(len, came))
    assert [t for _, t in reads] == sorted(t for _, t in reads)


# -------------------------------------------------------------------------------------------------------- direction


def test_a_driver_that_cannot_switch_the_direction_is_reported(peer: Peer, monkeypatch: pytest.MonkeyPatch) -> None:
    open_port(link(peer, rs485="rts_high")).close()  # a pty has no direction
    monkeypatch.setattr("fti.links.serial.is_pty", lambda port: False)
    with pytest.raises(LinkError, match=r'does not switch the direction of an RS-485 line; remove rs485 = "rts_high"'):
        open_port(link(peer, rs485="rts_high"))


@pytest.mark.parametrize(
    ("rs485", "echo", "flags"), [("rts_high", False, 0b0011), ("rts_low", False, 0b0101), ("rts_high", True, 0b10011)]
)
def test_the_kernel_is_asked_to_switch_the_direction(
    peer: Peer, monkeypatch: pytest.MonkeyPatch, rs485: str, echo: bool, flags: int
) -> None:
    """linux/serial.h: SER_RS485_ENABLED 1, RTS_ON_SEND 2, RTS_AFTER_SEND 4, RX_DURING_TX 16."""
    import fcntl

    reported: list[int] = []
    real = fcntl.ioctl

    def ioctl(fd: int, request: int, *arguments: Any) -> Any:
        if request == 0x542F:  # TIOCSRS485
            reported.append(arguments[0][0])
        return None if request in (0x542E, 0x542F) else real(fd, request, *arguments)

    monkeypatch.setattr("fti.links.serial.is_pty", lambda port: False)
    monkeypatch.setattr("serial.serialposix.fcntl.ioctl", ioctl)
    open_port(link(peer, rs485=rs485, echo=echo)).close()
    assert reported[-1] == flags
