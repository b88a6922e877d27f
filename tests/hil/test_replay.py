"""A recorded session through real links again: the same bytes, datagram by datagram, frame by frame."""

from __future__ import annotations

import asyncio
import fcntl
import itertools
import json
import os
import random
import signal
import struct
import subprocess
import sys
import termios
from collections import defaultdict
from collections.abc import Iterator
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import pytest

from fti import config as configuration
from fti.canframe import pack_can
from fti.cli._emulator_run import run_until_stopped
from fti.config import Config, UdpLink
from fti.errors import MissingError
from fti.hil.prefetch_process import select_frames
from fti.hil.replay import Replay, length_s
from fti.hil.replay_clock import FrameStream, ReplayClock
from fti.hil.report import TransmissionReport
from fti.hil.session_config import recorded_config
from fti.hil.status import describe_replay
from fti.latency_histogram import LatencyHistogram
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.messages.frames import TICK_LINK, RawFrame
from fti.web.live_state import HIL_FIELDS
from tests.e2e.harness import with_free_ports
from tests.helpers import until_async
from tests.links.bench import ReceivedFrames, run_link

START_NS = 1_700_000_000_000_000_000
CONFIG = """
[session]
name = "replayed"

[[link]]
name = "line"
kind = "serial"
port = "/dev/ttyS0"

[[link]]
name = "eth"
kind = "udp"
bind = "127.0.0.1:47999"

[[link]]
name = "bus"
kind = "can"
interface = "slcan"
channel = "/dev/ttyACM0"
"""


def frames(count: int, period_s: float = 0.001) -> Iterator[RawFrame]:
    """Frames of three links; every tenth read of the serial line is larger than a pty holds."""
    rng = random.Random(1)
    for seq in range(count):
        link = ("line", "eth", "bus")[seq % 3]
        size = 20_000 if link == "line" and seq % 30 == 0 else rng.randint(1, 200)
        data = (
            pack_can(rng.randrange(0x800), rng.randbytes(rng.randint(0, 8))) if link == "bus" else rng.randbytes(size)
        )
        yield RawFrame(link, seq, START_NS + round(seq * period_s * 1e9), data)


def record(tmp_path: Path, text: str, recorded: list[RawFrame]) -> Path:
    folder = SessionFolder.create(tmp_path, "replayed", START_NS)
    links = [RawTopic(link, kind, {}) for link, kind in (("line", "serial"), ("eth", "udp"), ("bus", "can"))]
    attachments = [("config.toml", "text/plain", text.encode())]
    log = RawLog(folder, links, LogSettings(split_s=300, split_mb=100, attachments=attachments))
    for frame in recorded:
        log.write_frame(frame.link, frame.seq, frame.t_rx_ns, frame.data)
    log.close()
    return folder.path


async def play(
    replay: Replay, config: Config, expected: list[RawFrame], reports: list[TransmissionReport] | None = None
) -> dict[str, ReceivedFrames]:
    """Replay with the links of the configuration open, until the last datagram and CAN frame has been heard."""
    received = {}
    playing = asyncio.create_task(replay.run())
    await replay.ready.wait()
    async with AsyncExitStack() as stack:
        for link in config.link:
            _, received[link.name] = await stack.enter_async_context(run_link(link))
        report = await playing
        if reports is not None:
            reports.append(report)
        assert not any(counters.dropped_messages for counters in report.links.values())
        counts = {name: sum(frame.link == name for frame in expected) for name in ("eth", "bus")}
        await until_async(lambda: all(len(received[name].frames) >= count for name, count in counts.items()))
    return received


async def test_it_is_reported_like_an_emulated_flight(tmp_path: Path) -> None:
    recorded = list(frames(90))
    session = record(tmp_path, with_free_ports(CONFIG), recorded)
    recording = Recording.open(session)
    config = configuration.with_links(recorded_config(recording, session), tmp_path / "links")
    replay = Replay(recording, config, tmp_path / "links", wait_s=0.0)
    before = describe_replay(replay, session.name, length_s(recording))
    assert (before["flight_s"], before["lateness"]["messages"], before["links"]) == (None, 0, {})
    await play(replay, config, recorded)
    after = json.loads(json.dumps(describe_replay(replay, session.name, length_s(recording))))
    assert set(after) >= HIL_FIELDS
    assert after["scenario"] == session.name
    assert after["flight_s"] == after["duration_s"] == pytest.approx(0.089, abs=1e-9)
    assert after["links"].keys() == {"line", "eth", "bus"}
    assert after["links"]["eth"]["messages"] == 30
    assert after["lateness"]["messages"] == 90


@pytest.mark.parametrize(("by_signal", "interrupted"), [(False, False), (True, True)])
async def test_a_key_ends_it_in_good_order_and_a_signal_interrupts_it(by_signal: bool, interrupted: bool) -> None:
    async def ends(stop: asyncio.Event) -> TransmissionReport:
        if by_signal:
            os.kill(os.getpid(), signal.SIGTERM)
        else:
            stop.set()
        await stop.wait()
        return TransmissionReport({}, LatencyHistogram().summary)

    _, result = await run_until_stopped(ends, asyncio.Event())
    assert result is interrupted


async def test_the_same_bytes_arrive_on_every_link(tmp_path: Path) -> None:
    recorded = list(frames(300))
    session = record(tmp_path, with_free_ports(CONFIG), recorded)
    recording = Recording.open(session)
    links = tmp_path / "links"
    config = configuration.with_links(recorded_config(recording, session), links)
    received = await play(Replay(recording, config, links, speed=2.0, wait_s=0.0), config, recorded)
    expected = defaultdict(list)
    for frame in recorded:
        expected[frame.link].append(frame.data)
    assert received["eth"].frames == expected["eth"]
    assert received["bus"].frames == expected["bus"]
    assert received["line"].bytes == b"".join(expected["line"])


async def test_a_later_start_leaves_the_beginning_out(tmp_path: Path) -> None:
    recorded = list(frames(120))
    session = record(tmp_path, with_free_ports(CONFIG), recorded)
    recording, links = Recording.open(session), tmp_path / "links"
    config = configuration.with_links(recorded_config(recording, session), links)
    received = await play(Replay(recording, config, links, from_s=0.06, wait_s=0.0), config, recorded[60:])
    assert received["eth"].frames == [f.data for f in recorded[60:] if f.link == "eth"]


async def test_it_waits_for_readers_and_ends_on_request(tmp_path: Path) -> None:
    session = record(tmp_path, with_free_ports(CONFIG), list(frames(10)))
    recording, links = Recording.open(session), tmp_path / "links"
    replay = Replay(recording, recorded_config(recording, session), links)
    stop, messages = asyncio.Event(), list[str]()
    playing = asyncio.create_task(replay.run(stop, messages.append))
    remedy = f"line: waiting for a program that opens {links}/line; start the daemon with --links {links}"
    await until_async(lambda: messages == [remedy])
    assert not playing.done()
    stop.set()
    assert (await playing).lateness.messages == 0


async def test_it_names_the_address_that_nobody_has_bound(tmp_path: Path) -> None:
    session = record(tmp_path, with_free_ports(CONFIG), list(frames(10)))
    recording = Recording.open(session)
    config = recorded_config(recording, session)
    replay = Replay(recording, config, tmp_path / "links", only=["eth"])
    stop, messages = asyncio.Event(), list[str]()
    playing = asyncio.create_task(replay.run(stop, messages.append))
    (address,) = [link.bind for link in config.link if isinstance(link, UdpLink)]
    await until_async(lambda: bool(messages))
    assert messages[0].startswith(f"eth: waiting for a program that opens {address}; ")
    assert messages[0].endswith("--config CONFIG")
    stop.set()
    await playing


async def test_it_ends_when_the_last_byte_has_been_read(tmp_path: Path) -> None:
    """What is unread when a pty goes is lost."""
    text = CONFIG.partition('[[link]]\nname = "eth"')[0]
    session = record(tmp_path, text, [RawFrame("line", 0, START_NS, b"last words")])
    recording, links = Recording.open(session), tmp_path / "links"
    replay = Replay(recording, recorded_config(recording, session), links, wait_s=0.0)
    playing = asyncio.create_task(replay.run())
    await replay.ready.wait()
    reader = os.open(links / "line", os.O_RDWR | os.O_NOCTTY)
    try:
        await until_async(lambda: unread(reader) == 10)
        await asyncio.wait([playing], timeout=0.2)
        assert not playing.done()
        assert os.read(reader, 100) == b"last words"
        assert (await playing).links["line"].bytes == 10
    finally:
        os.close(reader)


def unread(descriptor: int) -> int:
    """Bytes that wait on a line."""
    count: int = struct.unpack("i", fcntl.ioctl(descriptor, termios.FIONREAD, bytes(4)))[0]
    return count


def due_of(recorded: list[RawFrame], messages: list[str] | None = None, **keys: float) -> list[float]:
    """Instants at which a stream sends, without sending.  messages : gets its progress messages."""

    class Sink:
        async def send_all(self, data: bytes) -> None: ...

    sinks: dict[str, Any] = {frame.link: Sink() for frame in recorded}
    log = list[str]() if messages is None else messages
    frames = select_frames(lambda: recorded, from_s=keys.get("from_s", 0.0))
    stream = FrameStream(frames, sinks, ReplayClock(lambda: 0.0), keys.get("speed", 1.0), log.append)
    found = []
    while (due := stream.due_s()) is not None:
        found.append(due)
        asyncio.run(stream.send())
    return found


def test_frames_keep_their_timing_and_order() -> None:
    stamps = [0, 100, 90, 300]  # [ms]; two links may overtake each other by their kernel stamps
    recorded = [RawFrame("eth", k, START_NS + t * 1_000_000, b"x") for k, t in enumerate(stamps)]
    assert due_of(recorded) == pytest.approx([0.0, 0.1, 0.1, 0.3])
    assert due_of(recorded, speed=10.0) == pytest.approx([0.0, 0.01, 0.01, 0.03])
    assert due_of(recorded, from_s=0.2) == pytest.approx([0.1])


# ------------------------------------------------------------------------------------------------------- snapshots

PARTS = (range(100, 200), range(700, 760))


def record_snapshots(tmp_path: Path, text: str, recorded: list[RawFrame]) -> Path:
    """A session in mode "snapshot": ticks and a file for each of the parts; every other frame was not triggered."""
    folder = SessionFolder.create(tmp_path, "replayed", START_NS)
    links = [RawTopic(link, kind, {}) for link, kind in (("line", "serial"), ("eth", "udp"), ("bus", "can"))]
    settings = LogSettings(
        split_s=300,
        split_mb=100,
        attachments=[("config.toml", "text/plain", text.encode())],
        metadata={"fti": {"mode": "snapshot"}},
    )
    log = RawLog(folder, links, settings)
    for frame in recorded:
        if is_tick(frame):
            log.write_tick(frame.seq, frame.t_rx_ns)
    log.close()
    for part in PARTS:
        shot = RawLog(folder, links, settings, kind="snapshot")
        for frame in recorded[part.start : part.stop]:
            if is_tick(frame):
                shot.write_tick(frame.seq, frame.t_rx_ns)
            else:
                shot.write_frame(frame.link, frame.seq, frame.t_rx_ns, frame.data)
        shot.close()
    return folder.path


def is_tick(frame: RawFrame) -> bool:
    return frame.seq % 10 == 9


def part_of(recorded: list[RawFrame], *parts: range) -> list[RawFrame]:
    return [frame for part in parts for frame in recorded[part.start : part.stop] if not is_tick(frame)]


def test_a_snapshot_session_is_sent_at_its_own_times(tmp_path: Path) -> None:
    recorded = list(frames(1000))
    session = record_snapshots(tmp_path, CONFIG, recorded)
    for place, parts in zip([session, *SessionFolder(session).files("snapshot")], (PARTS, *zip(PARTS)), strict=True):
        expected = part_of(recorded, *parts)
        raw_frames = list(Recording.open(place).frames())
        assert [frame for frame in raw_frames if frame.link != TICK_LINK] == expected
        begin_ns = expected[0].t_rx_ns
        assert due_of(raw_frames) == pytest.approx([(frame.t_rx_ns - begin_ns) / 1e9 for frame in expected])
        assert due_of(raw_frames, from_s=0.02)[0] == pytest.approx(0.0, abs=0.0011)


@pytest.mark.parametrize("which", ["session", "file"])
async def test_every_link_receives_what_the_snapshots_have(which: str, tmp_path: Path) -> None:
    recorded = list(frames(1000))
    session = record_snapshots(tmp_path, with_free_ports(CONFIG), recorded)
    place, parts = (session, PARTS) if which == "session" else (SessionFolder(session).files("snapshot")[1], PARTS[1:])
    recording, links, expected = Recording.open(place), tmp_path / "links", part_of(recorded, *parts)
    config = configuration.with_links(recorded_config(recording, place), links)
    received = await play(
        Replay(recording, config, links, wait_s=0.0), config, expected, reports := list[TransmissionReport]()
    )
    link_lateness = {link: [frame for frame in expected if frame.link == link] for link in received}
    for link in ("eth", "bus"):
        assert received[link].frames == [frame.data for frame in link_lateness[link]]
    assert received["line"].bytes == b"".join(frame.data for frame in link_lateness["line"])
    first, *_, last = link_lateness["eth"]
    lasted_ns = received["eth"].times[-1] - received["eth"].times[0]
    late_ns = reports[0].lateness.max_ms * 1e6  # of the first one, on a machine that stood still
    assert lasted_ns > 0.9 * (last.t_rx_ns - first.t_rx_ns) - late_ns  # the pause between the snapshots is kept


def test_a_long_pause_is_reported() -> None:
    stamps = [0, 1, 7, 8]  # [s]
    recorded = [RawFrame("eth", k, START_NS + t * 1_000_000_000, b"x") for k, t in enumerate(stamps)]
    messages = list[str]()
    due_of(recorded, messages)
    due_of(recorded, messages, speed=2.0)  # it lasts three seconds only
    assert messages == ["pause in the recording; the next frame follows in 6 s"]


def test_the_command_says_that_it_is_a_snapshot(tmp_path: Path) -> None:
    session = record_snapshots(tmp_path, with_free_ports(CONFIG), list(frames(1000)))
    for place in (session, SessionFolder(session).files("snapshot")[0]):
        command = [sys.executable, "-m", "fti.cli.main", "replay", str(place), "--links", str(tmp_path / "links")]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n"
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=120)
        assert process.returncode == 130
        assert errors.startswith("note: SNAPSHOT: not a continuous recording")


def test_ticks_are_not_sent() -> None:
    tick = RawFrame("fti_tick", 0, START_NS, b"")
    assert due_of(list(itertools.chain([tick], frames(3)))) == pytest.approx([0.0, 0.001, 0.002])


def test_a_session_without_its_configuration_is_named(tmp_path: Path) -> None:
    folder = SessionFolder.create(tmp_path, "bare", START_NS)
    log = RawLog(folder, [RawTopic("line", "serial", {})], LogSettings(split_s=300, split_mb=100))
    log.write_frame("line", 0, START_NS, b"x")
    log.close()
    with pytest.raises(MissingError, match=r"has no attachment config\.toml; give the configuration with --config"):
        recorded_config(Recording.open(folder.path), folder.path)


def test_nonsense_is_refused(tmp_path: Path) -> None:
    session = record(tmp_path, CONFIG, list(frames(3)))
    recording = Recording.open(session)
    with pytest.raises(ValueError, match=r"speed 0\.0 must be positive"):
        Replay(recording, recorded_config(recording, session), tmp_path, speed=0.0)
