"""slcan: the Lawicel text, and a link to an emulated adapter on a pty."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.canframe import CanFrame, pack_can, unpack_can
from fti.clock import FakeClock
from fti.config import CanLink
from fti.errors import ConfigError, PartialSendError
from fti.links import open_link
from fti.links.slcan import MAX_LINE_BYTES, Lawicel, format_frame, parse_line
from fti.links.slcan_status import StatusWatch
from fti.messages.frames import LinkState
from tests.helpers import until_async
from tests.links.bench import Peer, ReceivedFrames, run_link


class Parsed:
    """A parser and what it delivered."""

    def __init__(self) -> None:
        self.frames: list[CanFrame] = []
        self.times: list[int] = []
        self.parser = Lawicel(self._take, StatusWatch({}))
        self.bytes_in = 0

    def _take(self, frame: bytes, t_rx_ns: int) -> None:
        self.frames.append(unpack_can(frame))
        self.times.append(t_rx_ns)

    def feed(self, data: bytes, t_rx_ns: int = 0) -> None:
        self.parser.feed(data, t_rx_ns)
        self.bytes_in += len(data)
        found = self.parser
        assert found.framed + found.answers + found.held + found.noise == self.bytes_in
        assert found.held <= MAX_LINE_BYTES


# Vectors: Lawicel CAN232 manual version 3, the examples of commands t, T, r, R and of received frames with time.
VECTORS = [
    (b"t10021133", CanFrame(0x100, False, False, False, False, b"\x11\x33")),
    (b"T0000010021133", CanFrame(0x100, True, False, False, False, b"\x11\x33")),
    (b"r1002", CanFrame(0x100, False, True, False, False, b"\0\0")),
    (b"R000001002", CanFrame(0x100, True, True, False, False, b"\0\0")),
    (b"t1002113332A4", CanFrame(0x100, False, False, False, False, b"\x11\x33")),
    (b"t7FF0", CanFrame(0x7FF, False, False, False, False, b"")),
    (b"T1fffffff81122334455667788", CanFrame(0x1FFFFFFF, True, False, False, False, bytes.fromhex("1122334455667788"))),
    (b"d1239" + b"ab" * 12, CanFrame(0x123, False, False, False, True, b"\xab" * 12)),
    (b"D00000123F" + b"01" * 64, CanFrame(0x123, True, False, False, True, b"\x01" * 64)),
]


@pytest.mark.parametrize(("line", "frame"), VECTORS)
def test_vectors(line: bytes, frame: CanFrame) -> None:
    data = parse_line(line)
    assert data is not None
    assert unpack_can(data) == frame


NO_FRAMES = """
    t t12 t1002113 t100211334 t800 t8000 t1009112233445566778899 T200000000 t10021x33 r100211 x1002 t-1021133
    t1_021133 tFFF0 r1009
"""


@pytest.mark.parametrize("line", [b"", b"t1002 133", *NO_FRAMES.encode().split()])
def test_what_is_no_frame(line: bytes) -> None:
    assert parse_line(line) is None


def test_bit_rate_switch_survives_both_ways() -> None:
    line = b"b1231AA\r"
    frame = parse_line(line[:-1])
    assert frame is not None
    assert frame[5] == 0x05
    assert format_frame(frame) == line


def packed(wide: bool, can_id: int, data: bytes, remote: bool) -> bytes:
    return pack_can(can_id & (0x1FFFFFFF if wide else 0x7FF), data, extended=wide, remote=remote)


frames = st.builds(packed, st.booleans(), st.integers(0, 0x1FFFFFFF), st.binary(max_size=8), st.booleans())
junk = st.one_of(st.binary(max_size=12), st.sampled_from([b"\r", b"\a", b"z\r", b"Z\r", b"V1013\r", b"F00\r"]))


@given(st.lists(frames, max_size=8), st.lists(st.integers(0, 300), max_size=6))
def test_any_chunking_gives_the_same_frames(sent: list[bytes], cuts: list[int]) -> None:
    text = b"".join(format_frame(frame) + b"z\r" for frame in sent)
    places = [0, *sorted(min(cut, len(text)) for cut in cuts), len(text)]
    parsed = Parsed()
    for a, b in itertools.pairwise(places):
        parsed.feed(text[a:b])
    assert parsed.frames == [unpack_can(frame) for frame in sent]
    assert parsed.parser.noise == 0


@given(st.lists(st.one_of(junk, frames.map(format_frame)), max_size=20), st.integers(1, 40))
def test_every_byte_is_accounted_for(parts: list[bytes], size: int) -> None:
    text, parsed = b"".join(parts), Parsed()
    for at in range(0, len(text), size):
        parsed.feed(text[at : at + size])


@given(st.binary(max_size=300).filter(lambda data: not data.endswith(b"\r")), frames)
def test_first_whole_line_after_garbage_is_found(garbage: bytes, frame: bytes) -> None:
    parsed = Parsed()
    parsed.feed(garbage + b"\r" + format_frame(frame))
    assert parsed.frames[-1] == unpack_can(frame)


def test_frame_behind_a_lost_cr_is_found_by_its_letter() -> None:
    parsed = Parsed()
    parsed.feed(b"t1231A" + b"t1002113\xff" + b"t10021133\r")
    assert parsed.frames == [VECTORS[0][1]]
    assert parsed.parser.noise == 15


def test_stamp_is_that_of_the_first_letter() -> None:
    parsed = Parsed()
    for t_rx_ns, text in enumerate([b"t100", b"21133\rt1", b"0021133", b"\r\xffgarbage", b"t10021133", b"\rt1000\r"]):
        parsed.feed(text, t_rx_ns)
    assert parsed.times == [0, 1, 4, 5]


def test_text_without_an_end_is_held_in_bounds() -> None:
    parsed = Parsed()
    for t_rx_ns in range(1000):
        parsed.feed(b"t", t_rx_ns)
    assert parsed.parser.held == MAX_LINE_BYTES
    assert len(parsed.parser._reads) <= MAX_LINE_BYTES
    parsed.feed(b"1000\r", 1000)
    assert parsed.times == [999]


def test_refusals_are_counted() -> None:
    parsed = Parsed()
    parsed.feed(b"\at10021133\r\a")
    assert (parsed.parser.refusals, parsed.parser.noise, len(parsed.frames)) == (2, 0, 1)


def test_error_frame_cannot_be_sent() -> None:
    with pytest.raises(ValueError, match="error frame"):
        format_frame(pack_can(4, bytes(8), error=True))


# ---------------------------------------------------------------------------------------------------------- the link


@pytest.fixture
def adapter(tmp_path: Path) -> Iterator[Peer]:
    peer = Peer(tmp_path / "can1")
    yield peer
    peer.power_off()


def link(adapter: Peer, **keys: Any) -> CanLink:
    table = {"name": "can1", "kind": "can", "interface": "slcan", "channel": str(adapter.path), **keys}
    return CanLink.model_validate(table)


async def test_adapter_is_opened_and_frames_arrive(adapter: Peer) -> None:
    clock = FakeClock(3)
    async with run_link(link(adapter, bitrate=500_000), clock=clock) as (opened, received):
        await adapter.expect(b"C\rS6\rO\rF\r")
        adapter.write(b"\r\r\rt10021133\rT0000010")
        await until_async(lambda: received.frames)
        clock.advance(1)
        adapter.write(b"021133\r")
        await until_async(lambda: len(received.frames) == 2)
    assert [unpack_can(frame) for frame in received.frames] == [VECTORS[0][1], VECTORS[1][1]]
    assert received.times == [3, 3]
    assert opened.status.noise_bytes == 0
    assert opened.status.bytes == 32


async def test_adapter_that_dies_is_opened_again(adapter: Peer) -> None:
    async with run_link(link(adapter)) as (opened, received):
        await adapter.expect(b"C\rO\rF\r")
        adapter.write(b"??\rt1002")  # garbage, then half a frame, which is lost with the adapter
        await until_async(lambda: opened._parser.held == 5)
        adapter.power_off()
        await until_async(lambda: opened.status.state is LinkState.ABSENT)
        adapter.connect()
        await adapter.expect(b"C\rO\rF\r")
        adapter.write(b"1133\rt10021133\r")
        await until_async(lambda: received.frames)
        assert opened.status.noise_bytes == 3 + 5 + 5
        assert opened.status.errors["slcan_noise_bytes"] == 13
    assert [unpack_can(frame) for frame in received.frames] == [VECTORS[0][1]]


async def test_frames_are_sent_as_text(adapter: Peer) -> None:
    keys = {"transmit": True, "settings": {"listen_only": True}}
    async with run_link(link(adapter, **keys), on_connect=[pack_can(1, b"\x02")]) as (opened, _):
        await adapter.expect(b"C\rL\rF\rt001102\r")
        await opened.send(pack_can(0x1ABCDEF0, b"\xaa\xbb", extended=True))
        await adapter.expect(b"T1ABCDEF02AABB\r")
        with pytest.raises(ValueError, match="a CAN frame has"):
            await opened.send(b"no frame")
        assert opened.status.tx_frames == 2


async def test_a_line_that_is_ended_after_it_was_given_up_is_reported_and_recorded(
    adapter: Peer, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = bytearray()
    frames = [pack_can(number, b"\x02") for number in (1, 2)]
    async with run_link(link(adapter, transmit=True)) as (opened, _):
        sent = ReceivedFrames()
        opened.on_sent = sent
        room = 3

        def write(fd: int, data: bytes) -> int:
            nonlocal room
            size = min(room, len(data))
            if not size:
                raise BlockingIOError
            result.extend(data[:size])
            room -= size
            return size

        monkeypatch.setattr("fti.links.slcan.os.write", write)
        monkeypatch.setattr(opened, "_writable", lambda fd: asyncio.sleep(0.001))
        with pytest.raises(PartialSendError, match="its line is incomplete"):
            await opened.send(frames[0], timeout_s=0.05)
        assert (bytes(result), sent.frames) == (b"t00", [])
        room = 1000
        await opened.send(frames[1])
        assert bytes(result).startswith(b"t001102\rt002102\r")
        assert sent.frames == frames


async def test_hints_say_what_is_wrong(adapter: Peer) -> None:
    async with run_link(link(adapter)) as (opened, _):
        assert "no frame arrives" in opened.status.hint
        adapter.write(b"$GPGGA,123519*00\r\n")
        await until_async(lambda: opened.status.noise_bytes)
        await until_async(lambda: "is it a Lawicel adapter" in opened.status.hint)
        assert opened.status.state is LinkState.SILENT
        adapter.write(b"\a")
        await until_async(lambda: "refused a command" in opened.status.hint)


@pytest.mark.parametrize(
    ("keys", "words"), [({"bitrate": 123}, "supports 10000"), ({"settings": {"ttyBaud": 9600}}, "no such key")]
)
def test_what_can_never_work_is_an_error_at_once(tmp_path: Path, keys: dict[str, Any], words: str) -> None:
    table = {"name": "can1", "kind": "can", "interface": "slcan", "channel": str(tmp_path), **keys}
    with pytest.raises(ConfigError, match=words):
        open_link(CanLink.model_validate(table), FakeClock(), lambda frames, times: None)
