"""What a rough day does to a whole daemon: nothing of it may touch the recording, and each loss is told."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager
from itertools import accumulate
from pathlib import Path
from typing import Any

import pytest

from fti.logger.reading.recording import Recording
from fti.logger.stream_writer import StreamWriter
from tests.e2e.feeder import CONFIG
from tests.e2e.harness import FTI, Daemon, Line, daemon, free_udp_port, fti
from tests.helpers import until

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(600)]


DATAGRAM = 1300
#: More than the smallest ring holds.
OVERRUN = 16_000
FLOOD_BLOCK = 4096
#: So much may wait in a socket, however little the machine gives one [B].
QUEUED = 50_000


class Rig:
    """The small daemon's configuration, its line, and its port."""

    def __init__(self, folder: Path) -> None:
        self.links = folder / "links"
        self.links.mkdir()
        self.port = free_udp_port()
        self.config = folder / "small.toml"
        self.config.write_text(CONFIG.format(port=self.port))
        self.out = folder / "out"
        self.line = Line(self.links / "line")

    def run(self) -> AbstractContextManager[Daemon]:
        """A daemon on these links."""
        return daemon(self.config, self.out, "--links", str(self.links))

    def replug(self) -> None:
        """Another device takes the place of one that has vanished."""
        self.line = Line(self.links / "line")


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    new_rig = Rig(tmp_path)
    yield new_rig
    new_rig.line.close()


def _link(running: Daemon, name: str) -> dict[str, Any]:
    content: dict[str, Any] = running.health().get("links", {}).get(name, {})
    return content


def _assert_verified(session: Path) -> None:
    done = fti("verify", str(session))
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.alone
def test_a_long_stop_of_navigation_a_flood_and_a_flapping_line(rig: Rig, scale: int) -> None:
    """The recording has everything; the derived file and health say what navigation has not seen."""
    turns, written = 2 if scale == 1 else scale, b""
    with rig.run() as running:
        session = running.session
        _await_line(running, "state", "silent")
        lost = _overrun_the_ring(running, rig.port)
        for turn in range(turns):
            _await_line(running, "connects", turn + 1)
            written += _flood(rig.line, 1000 * scale)
            _await_line(running, "bytes", len(written))
            rig.line.close()
            _await_line(running, "state", "absent")
            rig.replug()
        running.stop()
    recording = Recording.open(session)
    assert [int(f.data[:9]) for f in recording.frames() if f.link == "eth"] == list(range(OVERRUN))
    assert b"".join(f.data for f in recording.frames() if f.link == "line") == written
    gaps = [json.loads(data) for _, _, _, _, data in recording.messages("/fti/gap", kind="derived")]
    assert gaps[0]["kind"] == "ring"
    assert lost in accumulate(gap["before_seq"] - gap["after_seq"] - 1 for gap in gaps)
    _assert_verified(session)


def _overrun_the_ring(running: Daemon, port: int) -> int:
    """Stop navigation for so long that the ring cannot hold what comes; returns the frames that it has lost."""
    pid = running.pid_of("navigation")
    until(lambda: "lag_ms" in running.health()["navigation"], what="the first word of navigation")
    os.kill(pid, signal.SIGSTOP)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for number in range(OVERRUN):
            sock.sendto(b"%09d" % number + bytes(DATAGRAM), ("127.0.0.1", port))
            if number % 20 == 19:
                until(lambda: _queued(port) < QUEUED, what="a socket that is emptied")
    until(lambda: running.health()["navigation"]["lag_ms"] > 3000, what="health says that navigation is late")
    os.kill(pid, signal.SIGCONT)
    lost: int = until(lambda: running.health()["navigation"]["ring_lost_frames"], what="lost frames")
    return lost


def _queued(port: int) -> int:
    """Memory of the datagrams that wait in the socket of a port of loopback [B]."""
    rows = [line.split() for line in Path("/proc/net/udp").read_text().splitlines()[1:]]
    return sum(int(row[4].partition(":")[2], 16) for row in rows if int(row[1].partition(":")[2], 16) == port)


def _flood(line: Line, blocks: int) -> bytes:
    """Write as fast as the line takes it."""
    data = b"".join((b"%015d\n" % number) * (FLOOD_BLOCK // 16) for number in range(blocks))
    line.write(data)
    return data


def _await_line(running: Daemon, key: str, value: object) -> None:
    until(lambda: _link(running, "line").get(key) == value, what=f"{key} {value}")


def test_two_daemons_of_one_name_started_at_the_same_moment(tmp_path: Path) -> None:
    """Each has a run directory and a session of its own."""
    config = tmp_path / "small.toml"
    config.write_text('[session]\nname = "twin"\ndirectory = "out"\nmin_free_mb = 10\n[display]\nenabled = false\n')
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)}
    twins = [subprocess.Popen([*FTI, "run", str(config)], env=environment) for _ in range(2)]
    try:
        places = [tmp_path / "fti" / name / "fti.json" for name in ("twin", "twin_2")]
        until(lambda: all(place.exists() for place in places), what="two daemons")
        infos = [json.loads(place.read_text()) for place in places]
    finally:
        for twin in twins:
            twin.send_signal(signal.SIGINT)
        codes = [twin.wait(60) for twin in twins]
    assert codes == [130, 130]
    assert {info["pid"] for info in infos} == {twin.pid for twin in twins}
    assert len({info["session"] for info in infos}) == 2


def test_an_interrupt_while_it_starts_leaves_nothing_half_done(rig: Rig, scale: int) -> None:
    """Whatever was reached: no socket, and no session, or a finished one."""
    for turn in range(2 * scale):
        with rig.run() as running:
            time.sleep(0.4 + 0.6 * turn / (2 * scale))  # the moment of the interrupt
            assert running.stop() in (130, -signal.SIGINT)  # the latter before the first line of ours
        assert not list(running.run_dir.glob("*"))
    for session in rig.out.glob("small_*"):
        assert not Recording.open(session).find_unfinished_files()


def test_a_second_interrupt_does_not_wait_for_the_repair_of_old_sessions(rig: Rig) -> None:
    """Each old file is closed, or as it was; the new session is finished."""
    old = _make_unfinished(rig.out, 20)
    before = old[0].read_bytes()
    with rig.run() as running:
        session = running.session
        running.process.send_signal(signal.SIGINT)
        until(lambda: not Recording.open(session).find_unfinished_files(), what="a finished recording")
        running.process.send_signal(signal.SIGINT)
        assert running.wait() == 130
    left = [path for path in old if Recording.open(path).find_unfinished_files()]
    assert left
    assert all(path.read_bytes() == before for path in left)


def _make_unfinished(out: Path, count: int) -> list[Path]:
    """Sessions of which each takes a moment to be closed."""
    paths = [out / f"old_{n}" / f"old_{n}_000.mcap" for n in range(count)]
    for path in paths:
        path.parent.mkdir(parents=True)
    writer = StreamWriter(paths[0])
    channel = writer.add_channel("/raw/line", "x-fti-raw")
    for number in range(200_000):
        writer.write(channel, number, b"")
    writer.flush()
    writer.abandon()
    for path in paths[1:]:
        shutil.copy(paths[0], path)
    return paths
