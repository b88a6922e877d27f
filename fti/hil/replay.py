"""Replay: sends the bytes of a recorded session on the same links with the same timing.

One read, datagram or CAN frame of the recording is one message.  Nothing is lost: when a pty is full, the replay waits
and is late.  It begins when every serial line, slcan channel and UDP port has a reader, plus an extra wait for CAN
buses, whose readers are not visible.  It ends when the serial readers have read everything.  Frames that the recorder
itself transmitted are not replayed.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from fti.config import Config, LinkTable, UdpLink
from fti.constants import SECOND_NS
from fti.errors import MissingError
from fti.hil.ports.endpoints import Endpoint, make_endpoint, open_endpoints, run_until
from fti.hil.prefetch_process import PrefetchProcess, PrefetchRequest
from fti.hil.replay_clock import FrameStream, ReplayClock
from fti.hil.report import TransmissionReport
from fti.hil.scheduler import Scheduler
from fti.logger.reading.file_statistics import file_statistics
from fti.logger.reading.recording import Recording
from fti.messages.frames import RawFrame

#: A replay has held its speed when its last frame was late by at most this time, or this share of its duration.
MAX_LATE_S, MAX_LATE_SHARE = 0.02, 0.001
#: A link without a reader is reported after this time [s].
WAIT_NOTICE_S = 2.0


class Replay:
    """Replays a session.

    links_dir : folder of the symlinks to ptys; wait_s : time between the arrival of the last reader and the first frame
    loop      : repeat endlessly; only : replay these links only (empty: all)
    """

    def __init__(
        self,
        recording: Recording,
        config: Config,
        links_dir: Path,
        *,
        speed: float = 1.0,
        from_s: float = 0.0,
        wait_s: float = 0.5,
        loop: bool = False,
        only: Sequence[str] = (),
    ) -> None:
        if speed <= 0.0 or from_s < 0.0 or wait_s < 0.0:
            raise ValueError(f"speed {speed} must be positive, from {from_s} and wait {wait_s} not negative")
        self.ready = asyncio.Event()
        self.replay_clock = ReplayClock(time.monotonic)
        self.session_name = config.session.name
        self._recording, self._folder = recording, links_dir
        self._speed, self._from_s, self._wait_s, self._loop, self._only = speed, from_s, wait_s, loop, only
        self._links = [link for link in config.link if not only or link.name in only]
        self._stream: FrameStream | None = None
        self._scheduler = Scheduler(self.replay_clock.now_s)
        self._endpoints: dict[str, Endpoint] = {}
        for name in only:
            if name not in [link.name for link in self._links]:
                known = ", ".join(link.name for link in config.link)
                raise MissingError(f"{config.path}: unknown link {name!r}; configured: {known}")

    @property
    def position_s(self) -> float | None:
        """Position in the recording [s after its first frame]; a loop counts on; None before the replay begins."""
        return self._from_s + self._stream.elapsed_s * self._speed if self._stream else None

    @property
    def report(self) -> TransmissionReport:
        """Messages sent so far and their lateness."""
        link_lateness = self._stream.link_lateness if self._stream else {}
        counters = {name: endpoint.counters for name, endpoint in self._endpoints.items()}
        return TransmissionReport(counters, self._scheduler.lateness, link_lateness, remarks=self._speed_problem())

    async def run(
        self, stop: asyncio.Event | None = None, progress: Callable[[str], None] = lambda _: None
    ) -> TransmissionReport:
        """Open the endpoints, wait for readers, send everything.  progress : called with each step."""
        ended = stop or asyncio.Event()
        ends = {link.name: make_endpoint(link, self._folder, lambda _: [], notify=progress) for link in self._links}
        self._endpoints = ends
        request = PrefetchRequest(str(self._recording.path), self._from_s, self._only, self._loop)
        with PrefetchProcess(request) as frames:
            async with open_endpoints(ends):
                self.ready.set()
                await run_until(self._play(frames, ended, progress), ended)
        return self.report

    async def _play(
        self,
        frames: Iterator[RawFrame],
        stop: asyncio.Event,
        progress: Callable[[str], None],
    ) -> None:
        for link in self._links:
            await self._wait_for_reader(link, progress)
        await asyncio.sleep(self._wait_s)
        self._stream = FrameStream(frames, self._endpoints, self.replay_clock, self._speed, progress)
        self.replay_clock.start()
        await self._scheduler.run([self._stream], stop)
        for endpoint in self._endpoints.values():
            await endpoint.drain()

    async def _wait_for_reader(self, link: LinkTable, progress: Callable[[str], None]) -> None:
        """Wait for the daemon to open a link; say after a moment what is waited for, and what to do."""
        waiting = asyncio.create_task(self._endpoints[link.name].wait_for_reader())
        try:
            await asyncio.wait([waiting], timeout=WAIT_NOTICE_S)
            if not waiting.done():
                progress(f"{link.name}: waiting for a program that opens {self._describe_port(link)}")
            await waiting
        finally:
            waiting.cancel()

    def _describe_port(self, link: LinkTable) -> str:
        if isinstance(link, UdpLink):
            return f"{link.bind}; a daemon with another address needs its configuration here, too: --config CONFIG"
        return f"{self._folder / link.name}; start the daemon with --links {self._folder}"

    def _speed_problem(self) -> list[str]:
        """A message when the requested speed was not reached."""
        stream = self._stream
        if stream is None or stream.last_late_s <= max(MAX_LATE_S, MAX_LATE_SHARE * stream.elapsed_s):
            return []
        reached = self._speed * stream.elapsed_s / (stream.elapsed_s + stream.last_late_s)
        return [f"speed {reached:.3g} was reached, {self._speed:g} was requested"]


def length_s(recording: Recording) -> float | None:
    """Duration of a recording [s] by the summaries of its files; None when a file has no summary."""
    files = file_statistics(recording.frame_files)
    if not files:
        return None
    begin_ns, end_ns = min(file.message_start_time for file in files), max(file.message_end_time for file in files)
    return (end_ns - begin_ns) / SECOND_NS
