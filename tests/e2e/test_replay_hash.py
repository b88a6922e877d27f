"""A session of every kind of link through a replay and a daemon: the same bytes, by hash; a crash in between.

One minute beside the quick tests, ten with ``--scale full``.  How late the frames were is printed, and judged in
``benchmarks/timing.py``, where nothing else runs.
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from fti.canframe import pack_can
from fti.logger.log_layout import LogSettings
from fti.logger.raw_log import RawLog, RawTopic
from fti.logger.reading.recording import Recording
from fti.logger.session import SessionFolder
from tests.e2e.harness import FTI, START_S, daemon, free_udp_port, fti
from tests.helpers import until

pytestmark = [pytest.mark.e2e, pytest.mark.replay, pytest.mark.timeout(3600)]

START_NS = 1_700_000_000_000_000_000
MINUTE_S, TEN_MINUTES_S = 60.0, 600.0
#: Messages a second: together what the aircraft's lines, buses and networks carry on a slow day.
LINKS = {"line": ("serial", 50.0), "eth": ("udp", 100.0), "adapter": ("can", 100.0), "bus": ("can", 50.0)}
SERIAL_BYTES = 60  # at 115200 baud: a quarter of the line


BUS = """
[[link]]
name = "bus"
kind = "can"
interface = "udp_multicast"
channel = "239.74.163.{host}"
settings = {{ port = {port} }}
"""


def config(folder: Path) -> Path:
    host = random.SystemRandom().randrange(2, 250)
    bus = BUS.format(host=host, port=free_udp_port()) if "bus" in LINKS else ""
    text = f"""
[session]
name = "every"
directory = "unused"
min_free_mb = 10

[[link]]
name = "line"
kind = "serial"
port = "/dev/unused"

[[link]]
name = "eth"
kind = "udp"
bind = "127.0.0.1:{free_udp_port()}"

[[link]]
name = "adapter"
kind = "can"
interface = "slcan"
channel = "/dev/unused"
bitrate = 500000

{bus}
[display]
port = 0
"""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "every.toml").write_text(text)
    return folder / "every.toml"


def record_session(folder: Path, seconds: float, text: str) -> Path:
    """A recording of all links, and of something that the daemon had sent."""
    session, rng = SessionFolder.create(folder, "made", START_NS), random.Random(1)
    topics = [RawTopic(link, kind, {}) for link, (kind, _) in LINKS.items()]
    attachments = [("config.toml", "text/plain", text.encode())]
    log = RawLog(session, topics, LogSettings(split_s=300, split_mb=100, attachments=attachments))
    log.write_sent("line", 0, START_NS, b"what the daemon had sent")
    due = [
        (k / hz + rng.uniform(0, 0.5 / hz), link) for link, (_, hz) in LINKS.items() for k in range(round(seconds * hz))
    ]
    for seq, (t, link) in enumerate(sorted(due), 1):
        log.write_frame(link, seq, START_NS + round(t * 1e9), message(link, rng))
        if seq % 10 == 0:
            log.flush()
    log.close()
    return session.path


def message(link: str, rng: random.Random) -> bytes:
    if LINKS[link][0] == "can":
        return pack_can(rng.randrange(0x800), rng.randbytes(rng.randint(0, 8)))
    return rng.randbytes(SERIAL_BYTES if link == "line" else rng.randint(1, 1400))


@contextmanager
def replaying(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen([*FTI, "replay", *arguments], stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


def test_recording_a_replay_of_every_link_gives_the_same(tmp_path: Path, scale: int) -> None:
    seconds = MINUTE_S if scale == 1 else TEN_MINUTES_S
    file, links, report = config(tmp_path), tmp_path / "links", tmp_path / "report.json"
    original = record_session(tmp_path, seconds, file.read_text())
    with replaying(str(original), "--links", str(links), "--wait", "3", "--report", str(report)) as replay:
        until(lambda: (links / "adapter").is_symlink() or replay.poll() is not None, START_S, "the ports")
        with daemon(file, tmp_path / "out", "--links", str(links), "--origin", "replay") as running:
            session = running.session
            replay.wait(seconds + START_S)
            assert replay.returncode == 0
            running.stop()
    compared = fti("compare", str(original), str(session))
    print(compared.stdout)
    assert compared.returncode == 0, compared.stdout
    assert compared.stdout.count("EQUAL") == len(LINKS)
    print(json.dumps(json.loads(report.read_text())["lateness"]))  # told, not judged: the machine may be busy


def test_after_a_crash_the_next_replay_takes_the_ports_over(tmp_path: Path) -> None:
    """kill -9 leaves symlinks that lead nowhere; the daemon comes back by itself when there are ports again."""
    file, links = config(tmp_path), tmp_path / "links"
    original = record_session(tmp_path, 3.0, file.read_text())
    arguments = (str(original), "--links", str(links), "--wait", "2")
    with replaying(*arguments, "--loop") as first, daemon(file, tmp_path / "out", "--links", str(links)) as running:
        session = running.session
        until(lambda: frames(session) > 50, START_S, "frames of the first replay")
        first.send_signal(signal.SIGKILL)
        first.wait()
        assert (links / "line").is_symlink()
        assert not (links / "line").exists()
        with replaying(*arguments) as second:
            assert second.wait(START_S) == 0
        running.stop()
    received = b"".join(f.data for f in Recording.open(session).frames() if f.link == "line")
    whole = b"".join(f.data for f in Recording.open(original).frames() if f.link == "line")
    assert received.endswith(whole)
    assert len(received) > len(whole)
    assert not list(links.iterdir())


def frames(session: Path) -> int:
    return sum(1 for f in Recording.open(session).frames() if f.link in LINKS)
