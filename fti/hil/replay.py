"""Replay: the bytes of a recorded session again, on the same links, at their timing.

One read, datagram or CAN frame of the recording is one message here.  Nothing is lost: where a pty is full, the
replay waits (and is late).  It begins when somebody has opened every serial line, slcan channel and UDP port; a CAN
bus does not tell, which is what the extra wait is for.  It ends when the serial readers have read everything.
"""

from __future__ import annotations

import asyncio
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from fti import config as configuration
from fti.clock import SystemClock
from fti.config import Config
from fti.errors import MissingError
from fti.hil.ports.endpoints import Endpoint, make_endpoint, opened, until
from fti.hil.report import Report
from fti.hil.scheduler import Scheduler
from fti.logger.reading.recording import Recording
from fti.types import TICK_LINK, RawFrame

SECOND_NS = 1_000_000_000
#: A longer pause is told: in a snapshot it may last until the next trigger.
PAUSE_S = 5.0
CONFIG_ATTACHMENT = "config.toml"


class FrameStream:
    """The frames of a recording as a stream of the scheduler.

    from_s   : part of the recording that is left out [s after its first frame]; speed : 2 is twice as fast
    progress : told of long pauses
    """

    def __init__(
        self,
        frames: Iterator[RawFrame],
        endpoints: Mapping[str, Endpoint],
        from_s: float,
        speed: float,
        progress: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._frames = (f for f in frames if f.link != TICK_LINK)
        self._endpoints, self._speed, self._progress = endpoints, speed, progress
        self._next = next(self._frames, None)
        self._origin_ns = (self._next.t_rx_ns if self._next else 0) + round(from_s * SECOND_NS)
        self._due = 0.0
        while self._next is not None and self._next.t_rx_ns < self._origin_ns:
            self._next = next(self._frames, None)

    def due_s(self) -> float | None:
        """When the next frame goes out; frames keep their order also where their stamps do not."""
        if self._next is None:
            return None
        self._due = max(self._due, (self._next.t_rx_ns - self._origin_ns) / SECOND_NS / self._speed)
        return self._due

    async def send(self) -> None:
        """Send the frame, without loss."""
        assert self._next is not None
        endpoint = self._endpoints.get(self._next.link)
        if endpoint is None:
            raise MissingError(f"link {self._next.link!r} of the recording is not in the configuration")
        await endpoint.send_all(self._next.data)
        self._next = next(self._frames, None)
        before_s = self._due
        if (due_s := self.due_s()) is not None and due_s - before_s > PAUSE_S:
            self._progress(f"no frames were recorded now; it goes on in {due_s - before_s:.0f} s")


class Replay:
    """A session, sent again.

    links_dir : where the symlinks to ptys stand; wait_s : time between the last reader's coming and the first frame
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
    ) -> None:
        if speed <= 0.0 or from_s < 0.0 or wait_s < 0.0:
            raise ValueError(f"speed {speed} must be positive, from {from_s} and wait {wait_s} not negative")
        self.ready = asyncio.Event()
        self._recording, self._config, self._folder = recording, config, links_dir
        self._speed, self._from_s, self._wait_s = speed, from_s, wait_s

    async def run(self, stop: asyncio.Event | None = None, progress: Callable[[str], None] = lambda _: None) -> Report:
        """Open the endpoints, wait for readers, send everything.  progress : told what is waited for."""
        ended = stop or asyncio.Event()
        clock = SystemClock(0)
        started = [0]
        scheduler = Scheduler(lambda: (clock.now_ns() - started[0]) / SECOND_NS)

        async def play(endpoints: Mapping[str, Endpoint]) -> None:
            await _readers(endpoints, progress)
            await asyncio.sleep(self._wait_s)
            stream = FrameStream(self._recording.frames(), endpoints, self._from_s, self._speed, progress)
            started[0] = clock.now_ns()
            await scheduler.run([stream], ended)
            for endpoint in endpoints.values():
                await endpoint.drained()

        async with opened(
            {link.name: make_endpoint(link, self._folder, lambda _: []) for link in self._config.link}
        ) as endpoints:
            self.ready.set()
            await until(play(endpoints), ended)
        return Report({name: e.sent for name, e in endpoints.items()}, scheduler.lateness)


async def _readers(endpoints: Mapping[str, Endpoint], progress: Callable[[str], None]) -> None:
    for name, endpoint in endpoints.items():
        progress(f"waiting for a reader of {name}")
        await endpoint.reader_ready()


def recorded_config(recording: Recording, session: Path) -> Config:
    """The configuration that a session was recorded with, from its attachment.  Raises MissingError, ConfigError."""
    data = recording.attachments().get(CONFIG_ATTACHMENT)
    if data is None:
        raise MissingError(f"{session}: holds no attachment {CONFIG_ATTACHMENT}; name the configuration with --config")
    text = data.decode("utf-8")
    return configuration.parse(tomllib.loads(text), text, session / CONFIG_ATTACHMENT)
