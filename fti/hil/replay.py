"""Replay: the bytes of a recorded session again, on the same links, at their timing.

One read, datagram or CAN frame of the recording is one message here.  Nothing is lost: where a pty is full, the
replay waits (and is late).  It begins when somebody has opened every serial line, slcan channel and UDP port; a CAN
bus does not tell, which is what the extra wait is for.  It ends when the serial readers have read everything.  What
the recorder itself had sent on a link is not sent again: the far end never said that.
"""

from __future__ import annotations

import asyncio
import struct
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import make_reader

from fti.config import Config
from fti.errors import MissingError
from fti.hil.ports.endpoints import Endpoint, make_endpoint, open_endpoints, run_until
from fti.hil.prefetch_process import SECOND_NS, PrefetchProcess, PrefetchRequest
from fti.hil.replay_clock import FrameStream, ReplayClock
from fti.hil.report import TransmissionReport
from fti.hil.scheduler import Scheduler
from fti.logger.reading.recording import Recording
from fti.types import RawFrame

#: A replay has held its speed when its last frame was late by no more than this, or a thousandth of its length.
MAX_LATE_S, MAX_LATE_SHARE = 0.02, 0.001


class Replay:
    """A session, sent again.

    links_dir : where the symlinks to ptys stand; wait_s : time between the last reader's coming and the first frame
    loop      : again and again; only : these links alone (none named: all)
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
                raise MissingError(f"{name!r} is no link of {config.path}; there are {known}")

    @property
    def position_s(self) -> float | None:
        """Where in the recording it is [s after its first frame], counted on through a loop; None before it begins."""
        return self._from_s + self._stream.elapsed_s * self._speed if self._stream else None

    @property
    def report(self) -> TransmissionReport:
        """What was sent so far and how late, at any time."""
        link_lateness = self._stream.link_lateness if self._stream else {}
        counters = {name: endpoint.counters for name, endpoint in self._endpoints.items()}
        return TransmissionReport(counters, self._scheduler.lateness, link_lateness, remarks=self._speed_problem())

    @property
    def _request(self) -> PrefetchRequest:
        return PrefetchRequest(str(self._recording.path), self._from_s, self._only, self._loop)

    async def run(
        self, stop: asyncio.Event | None = None, progress: Callable[[str], None] = lambda _: None
    ) -> TransmissionReport:
        """Open the endpoints, wait for readers, send everything.  progress : told what is waited for."""
        ended = stop or asyncio.Event()
        ends = {link.name: make_endpoint(link, self._folder, lambda _: [], notify=progress) for link in self._links}
        self._endpoints = ends
        with PrefetchProcess(self._request) as frames:
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
        await _wait_for_readers(self._endpoints, progress)
        await asyncio.sleep(self._wait_s)
        self._stream = FrameStream(frames, self._endpoints, self.replay_clock, self._speed, progress)
        self.replay_clock.start()
        await self._scheduler.run([self._stream], stop)
        for endpoint in self._endpoints.values():
            await endpoint.drain()

    def _speed_problem(self) -> list[str]:
        """What may not be claimed of the speed."""
        stream = self._stream
        if stream is None or stream.last_late_s <= max(MAX_LATE_S, MAX_LATE_SHARE * stream.elapsed_s):
            return []
        reached = self._speed * stream.elapsed_s / (stream.elapsed_s + stream.last_late_s)
        return [f"speed {self._speed:g} was asked for, {reached:.3g} was reached"]


async def _wait_for_readers(endpoints: Mapping[str, Endpoint], progress: Callable[[str], None]) -> None:
    for name, endpoint in endpoints.items():
        progress(f"waiting for a reader of {name}")
        await endpoint.wait_for_reader()


def length_s(recording: Recording) -> float | None:
    """How long a recording is [s], as its finished files say; None when one of them has no end."""
    begins, ends = [], []
    for path in recording.frame_files:
        with path.open("rb") as file:
            try:
                summary = make_reader(file).get_summary()
            except (McapError, ValueError, LookupError, struct.error, OverflowError, MemoryError):
                return None
        if summary is None or summary.statistics is None:
            return None
        begins.append(summary.statistics.message_start_time)
        ends.append(summary.statistics.message_end_time)
    return (max(ends) - min(begins)) / SECOND_NS if begins else None
