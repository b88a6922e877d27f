"""A navigation process with set computing times, in a simulated time: frames arrive while it computes."""

from __future__ import annotations

import json
import math
import os
import socket
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fti import config as configuration
from fti.buffers.ring import EntryKind, Ring, pack_source
from fti.buffers.ring_reader import RingReader
from fti.clock import FakeClock
from fti.drivers import freeflight_ra4500 as ra
from fti.drivers.imar_ixcom.options import NUMBERS
from fti.drivers.imar_ixcom.solution import encode_inssol
from fti.drivers.imar_ixcom.status import HEALTHY, encode_status
from fti.drivers.imar_ixcom.wire import encode_frame
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from fti.messages.control import Hurry, Refusals, ToNavigation
from fti.messages.frames import TICK_LINK, TICK_PERIOD_NS, RawFrame
from fti.messages.measurements import Attitude, ImuSample, Position, Stamp, Velocity
from fti.messages.refusals import CarriedRefusal
from fti.messages.tables import from_table
from fti.post.reprocess import recorded_setup, reprocess
from fti.service import control_channel
from fti.service.control_channel import ControlChannel
from fti.service.navigation import process
from fti.service.navigation.decode_chain import Chain, ChainOutput
from fti.service.navigation.process import NavigationProcess
from fti.service.startup import NavigationStartup

START_NS = 1_700_000_000_000_000_000
GPS_EPOCH_NS = 315_964_800 * 10**9
SECOND_NS = 10**9
LINKS = ("line", "eth", TICK_LINK)
#: Holds three seconds of what comes.
RING_BYTES = 2**16
#: Frames that come in a second, and those that navigation reads at once.
RATE, READ_LIMIT = 250, 50
LAT_0, SPEED, RADIUS = 0.84, 60.0, 6_366_000.0
OFFSET_M = 100.0

CONFIG = """
[session]
name = "slow"

[[link]]
name = "line"
kind = "serial"
port = "/dev/unused"

[[link]]
name = "eth"
kind = "udp"
bind = "127.0.0.1:0"

[[device]]
name = "altimeter"
link = "line"
driver = "freeflight_ra4500"
max_age_ms = 500

[device.altimeter]
kind = "radar"
range_m = [0.5, 762]

[[device]]
name = "ins"
link = "eth"
driver = "imar_ixcom"
max_age_ms = 100

[nav]
attitude = ["ins"]
position = ["ins"]
altimeters = ["altimeter"]
"""


def height_at(t_ns: int) -> float:
    """Height above ground [m]: so wild that a height of another time is wrong."""
    return 200.0 + 90.0 * math.sin(2 * (t_ns - START_NS) / SECOND_NS)


def north_at(t_ns: int) -> float:
    """Way to the north [m]."""
    return SPEED * (t_ns - START_NS) / SECOND_NS


def _ins(number: int, t_ns: int, lie_m: float) -> bytes:
    at = Stamp(0)
    solution = encode_inssol(
        ImuSample(stamp=at, accel_b=(0.0, 0.0, -9.8), gyro_b=(0.0, 0.0, 0.0)),
        Attitude(stamp=at, roll=0.0, pitch=0.0, heading=0.0),
        Velocity(stamp=at, north=SPEED, east=0.0, down=0.0),
        Position(stamp=at, lat=LAT_0 + (north_at(t_ns) + lie_m) / RADIUS, lon=0.19, alt=900.0),
    )
    return encode_frame(NUMBERS["INSSOL"], number, t_ns - GPS_EPOCH_NS, encode_status(HEALTHY), solution)


def _frames(duration_s: float, lie_from_ns: float) -> list[tuple[int, int, bytes]]:
    """Arrival [ns], link and bytes: ticks, the INS at 100 Hz, the altimeter at 50 Hz, each frame of it cut in two."""
    found = []
    for i in range(round(duration_s * 50)):
        t_ns = START_NS + i * TICK_PERIOD_NS
        height = ra.encode_height(height_at(t_ns), ("in_air",), ra.Options())
        found += [(t_ns, 2, b""), (t_ns, 0, height[:4]), (t_ns + 19_000_000, 0, height[4:])]
        for k, at_ns in enumerate((t_ns + 2_000_000, t_ns + 12_000_000)):
            found.append((at_ns, 1, _ins(2 * i + k, at_ns, OFFSET_M if at_ns >= lie_from_ns else 0.0)))
    return sorted(found, key=lambda frame: frame[0])


class World:
    """Time that passes while navigation computes or sleeps; what arrives meanwhile goes into ring and recording.

    cost_s : what navigation needs for a frame [s], by the time since the start [s]
    ages   : of what was published: (time since the start [s], age [ms], valid)
    fed    : the numbers of the frames fed to the chain
    finish_at_s : time of the message to end at once [s]
    refusals : with which the next navigation process begins
    lie_from_s : from then on the INS is 100 m too far north [s]
    """

    def __init__(
        self, folder: Path, duration_s: float, cost_s: Callable[[float], float], lie_from_s: float = math.inf
    ) -> None:
        self.clock = FakeClock(START_NS)
        self.ring = Ring.create(RING_BYTES)
        self.session = SessionFolder.create(folder, "slow", START_NS)
        self.cost_s = cost_s
        self.ages: list[tuple[float, float, bool]] = []
        self.fed: list[int] = []
        self.finish_at_s: float | None = None
        self.refusals: tuple[CarriedRefusal, ...] = ()
        self._frames = _frames(duration_s, START_NS + lie_from_s * SECOND_NS)
        self._next = 0
        self._raw = RawLog(
            self.session,
            [RawTopic("line", "serial", {}), RawTopic("eth", "udp", {})],
            LogSettings(split_s=3600, split_mb=100, attachments=[("config.toml", "text/plain", CONFIG.encode())]),
        )
        self._far, self._near = socket.socketpair()

    @property
    def now_s(self) -> float:
        """Since the start."""
        return (self.clock.time_ns - START_NS) / SECOND_NS

    @property
    def frames(self) -> int:
        """How many there are in all."""
        return len(self._frames)

    def monotonic(self) -> float:
        """As in ``time``."""
        return self.now_s

    @property
    def _until_frame_s(self) -> float:
        """Until the next frame arrives."""
        return (self._frames[self._next][0] - self.clock.time_ns) / SECOND_NS if self._next < self.frames else 0.0

    def sleep(self, seconds: float) -> None:
        """Frames arrive meanwhile."""
        self.clock.advance(seconds)
        while self._next < len(self._frames) and self._frames[self._next][0] <= self.clock.time_ns:
            t_ns, link, data = self._frames[self._next]
            is_tick = link == LINKS.index(TICK_LINK)
            source = pack_source(EntryKind.TICK, 0) if is_tick else pack_source(EntryKind.RECEIVED, link)
            self.ring.put_many([source], self._next, [t_ns], [data])
            if is_tick:
                self._raw.write_tick(self._next, t_ns)
            else:
                self._raw.write_frame(LINKS[link], self._next, t_ns, data)
            self._next += 1
        if self._next == len(self._frames):
            self.ring.end()

    def startup(self) -> NavigationStartup:
        """Startup message of the next navigation process."""
        config = configuration.parse(tomllib.loads(CONFIG), CONFIG, Path("slow.toml"))
        return NavigationStartup(
            folder=str(self.session.path),
            config=config,
            epoch_ns=START_NS,
            texts={},
            bus="nowhere",
            refusals=self.refusals,
            attachments={},
            metadata={},
        )

    def navigator(self) -> NavigationProcess:
        """A navigation process."""
        startup = self.startup()
        channel, ring = ControlChannel(self._near, ToNavigation), Ring.attach(self._own_fds())
        return NavigationProcess(startup, self.clock, channel, ring)  # type: ignore[arg-type]

    def _own_fds(self) -> tuple[int, int]:
        """The ring's, as another process has them."""
        memory, event = self.ring.fds
        return os.dup(memory), os.dup(event)

    def run(self) -> NavigationProcess:
        """Let a navigation process take all that comes, or until it is interrupted."""
        feed = Chain.feed

        def slow_feed(chain: Chain, frame: RawFrame) -> ChainOutput:
            self.sleep(self.cost_s(self.now_s))
            self.fed.append(frame.seq)
            if self.finish_at_s and self.now_s >= self.finish_at_s:
                self._far.send(control_channel.encode(Hurry()))
                self.finish_at_s = None
            return feed(chain, frame)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(process, "time", self)
            patch.setattr(process, "READ_LIMIT", READ_LIMIT)
            patch.setattr(RingReader, "wait", lambda _, limit_s: self.sleep(min(limit_s, self._until_frame_s)))
            patch.setattr(Chain, "feed", slow_feed)
            patch.setattr(process, "Publisher", lambda *_: self)
            navigator = self.navigator()
            navigator.run()
        navigator._ring.close()
        return navigator

    # --------------------------------------------------------------------------------------- it is its own bus, too

    lost = 0

    def publish(self, topic: str, payload: bytes) -> None:
        """Note the age of a height."""
        message = json.loads(payload)
        if topic.startswith("/nav/height"):
            self.ages.append((self.now_s, message["age_ms"], message["valid"]))

    def close(self) -> None:
        """Nobody is there any more."""

    # ---------------------------------------------------------------------------------------------------- afterwards

    def finish(self) -> list[dict[str, Any]]:
        """Close the recording; returns the events of navigation about itself."""
        self._raw.close()
        self.ring.close()
        self._near.close()
        received = b""
        while data := self._far.recv(2**20):
            received += data
        self._far.close()
        messages = [json.loads(line) for line in received.splitlines()]
        events: list[dict[str, Any]] = [message["Event"] for message in messages if "Event" in message]
        return [event for event in events if event["source"] == "navigation"]

    def last_refusals(self) -> list[CarriedRefusal]:
        """The last refusals that navigation sent to the supervisor."""
        messages = [json.loads(line) for line in self._far.recv(2**24).splitlines()]
        refusals = [message["Refusals"] for message in messages if "Refusals" in message]
        return list(from_table(Refusals, refusals[-1]).refusals)

    def rows(self, topic: str) -> list[dict[str, Any]]:
        """The messages of a topic in the derived file."""
        return [json.loads(data) for *_, data in Recording.open(self.session.path).messages(topic)]

    def gaps(self) -> list[range]:
        """The missing frames in the gaps of the derived file."""
        return [range(row["after_seq"] + 1, row["before_seq"]) for row in self.rows("/fti/gap")]


def outputs(session: Path) -> list[tuple[str, int, bytes]]:
    """Topic, time and bytes of all that navigation has put out."""
    return [(topic, log, data) for topic, log, _, _, data in Recording.open(session).messages("/nav/")]


def reprocessed(world: World, out: Path) -> Path:
    """The reprocessed session."""
    recording = Recording.open(world.session.path)
    setup = recorded_setup(recording, world.session.path)
    return reprocess(recording, setup, out, as_flown=True, progress=lambda seq: None)
