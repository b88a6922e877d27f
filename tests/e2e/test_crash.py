"""Kill -9 of each process, of all of them, and the orderly end: what is in the files."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from random import Random

import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader

from fti.logger.reading.recording import Recording
from fti.messages.frames import RawFrame
from tests.e2e.feeder import Feeder
from tests.e2e.harness import END_S, Daemon, daemon, fti
from tests.e2e.heartbeat import Heartbeats
from tests.e2e.recorder_kills import Frames, read_as_it_lies, read_finished
from tests.helpers import until
from tests.processes import children_of, command_of

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(600)]
KILL_TOLERANCE_NS = 50_000_000
RESTART_NS = 1_000_000_000
SEED = 20261121


def _feed(feeder: Feeder, running: Daemon) -> None:
    """Start to feed when both links are open, so that nothing is sent to nobody."""
    until(lambda: running.health().get("links", {}).get("line", {}).get("state") == "silent", what="an open line")
    feeder.start()
    until(lambda: len(feeder.sent_lines) > 50, what="fed frames")


def _bytes(session: Path, link: str) -> bytes:
    return b"".join(f.data for f in Recording.open(session).frames() if f.link == link)


def _assert_complete(session: Path, feeder: Feeder) -> None:
    """Every byte that was sent is in the recording, in order, and every seq is there."""
    expected = b"".join(feeder.sent_lines)
    assert _bytes(session, "line") == expected
    assert _bytes(session, "eth") == expected
    seqs = [f.seq for f in Recording.open(session).frames()]
    assert seqs == list(range(seqs[-1] + 1))


def _assert_readable(session: Path) -> None:
    """The official reader accepts every file, checksums and all."""
    count = {path.name: 0 for path in session.glob("*.mcap")}
    for path in session.glob("*.mcap"):
        with path.open("rb") as stream:
            count[path.name] = sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages())
    raw = {name: n for name, n in count.items() if "_derived_" not in name}
    assert raw
    assert min(raw.values()) > 0, count  # a derived file may have been killed before its first message


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_leaves_finished_files(tmp_path: Path, number: int) -> None:
    with Feeder(tmp_path / "links") as feeder:
        with daemon(feeder.config, tmp_path / "out", "--links", str(feeder.links)) as running:
            session = running.session
            _feed(feeder, running)
            feeder.stop()
            assert running.stop(number) == 130
        _assert_readable(session)
        _assert_complete(session, feeder)
        verified = fti("verify", str(session))
        assert verified.returncode == 0, verified.stdout + verified.stderr


def _kill_navigation(running: Daemon) -> None:
    os.kill(running.pid_of("navigation"), signal.SIGKILL)


def _kill_display(running: Daemon) -> None:
    os.kill(running.pid_of("display"), signal.SIGKILL)


def _freeze_navigation(running: Daemon) -> None:
    pid = running.pid_of("navigation")
    os.kill(pid, signal.SIGSTOP)
    time.sleep(2.0)  # so long nobody reads the ring
    os.kill(pid, signal.SIGCONT)


@pytest.mark.parametrize("harm", [_kill_navigation, _kill_display, _freeze_navigation])
def test_nothing_downstream_touches_the_recording(tmp_path: Path, harm: Callable[[Daemon], None]) -> None:
    with Feeder(tmp_path / "links") as feeder:
        with daemon(feeder.config, tmp_path / "out", "--links", str(feeder.links)) as running:
            session = running.session
            _feed(feeder, running)
            harm(running)
            if harm is not _freeze_navigation:
                name = "navigation" if harm is _kill_navigation else "display"
                until(lambda: running.health()["processes"][name]["restarts"] == 1, what="a restart")
            fed = len(feeder.sent_lines)
            until(lambda: len(feeder.sent_lines) > fed + 100, what="more frames")
            feeder.stop()
            running.stop()
        _assert_readable(session)
        _assert_complete(session, feeder)


@pytest.mark.alone
def test_a_killed_recorder_loses_at_most_its_last_moments_and_comes_back(
    tmp_path: Path, heartbeats: Heartbeats
) -> None:
    with Feeder(tmp_path / "links") as feeder:
        with daemon(feeder.config, tmp_path / "out", "--links", str(feeder.links)) as running:
            session = running.session
            _feed(feeder, running)
            pid, epoch = running.pid_of("recorder"), running.info["epoch_ns"]
            until(lambda: len(feeder.sent_lines) > 400, what="the stand-in")
            killed = time.monotonic_ns() + epoch
            os.kill(pid, signal.SIGKILL)
            last = _last_time(next(iter(sorted(session.glob("*_000.mcap")))))
            until(lambda: running.health()["processes"]["recorder"]["restarts"] == 1, what="a restart")
            fed = len(feeder.sent_lines)
            until(lambda: len(feeder.sent_lines) > fed + 100, what="more frames")
            feeder.stop()
            running.stop()
        heartbeats.stop()
        assert killed - last - heartbeats.paused_ns(last - epoch, killed - epoch) < KILL_TOLERANCE_NS
        _assert_readable(session)
        first, second = (_frames_of(session, n) for n in ("000", "001"))
        assert first[-1].seq < second[0].seq
        assert second[0].t_rx_ns - killed < RESTART_NS
        assert _bytes(session, "line").endswith(feeder.sent_lines[-1])


def _recorders(running: Daemon) -> set[int]:
    """The recorder and its stand-in."""
    return {pid for pid in children_of(running.process.pid) if "fti.service.recorder" in command_of(pid)}


def _kill_recorder(running: Daemon, feeder: Feeder) -> int:
    """Kill it when a stand-in waits, which takes over; when that was, on the monotonic clock [ns]."""
    before = running.pid_of("recorder")
    (stand_in,) = until(lambda: _recorders(running) - {before}, what="the stand-in")
    fed = len(feeder.sent_lines)
    killed = time.monotonic_ns()
    os.kill(before, signal.SIGKILL)
    assert until(lambda: pid if (pid := running.pid_of("recorder")) != before else None, what="the next") == stand_in
    until(lambda: len(feeder.sent_lines) > fed + 50, what="more frames")
    return killed


@pytest.mark.alone
def test_every_death_of_several_is_taken_over_by_the_stand_in(
    tmp_path: Path, scale: int, heartbeats: Heartbeats
) -> None:
    """With --scale full within a second, 20 times, two seconds apart."""
    deaths, pause_s = (4, 0.0) if scale == 1 else (20, 2.0)
    killed: list[int] = []
    with Feeder(tmp_path / "links") as feeder:
        with daemon(feeder.config, tmp_path / "out", "--links", str(feeder.links)) as running:
            session, epoch = running.session, running.info["epoch_ns"]
            _feed(feeder, running)
            for _ in range(deaths):
                time.sleep(pause_s)
                killed.append(_kill_recorder(running, feeder) + epoch)
            feeder.stop()
            assert running.stop() == 130
        heartbeats.stop()
    firsts = [_frames_of(session, f"{number:03}")[0].t_rx_ns for number in range(1, deaths + 1)]
    late = [b - a - heartbeats.paused_ns(a - epoch, b - epoch) for a, b in zip(killed, firsts, strict=True)]
    assert scale == 1 or max(late) < RESTART_NS


def test_recorder_and_stand_in_killed_with_nobody_reading_the_output(tmp_path: Path) -> None:
    with Feeder(tmp_path / "links") as feeder:
        with daemon(feeder.config, tmp_path / "out", "--links", str(feeder.links)) as running:
            session = running.session
            assert running.process.stdout
            running.process.stdout.close()
            killed = until(lambda: pids if len(pids := _recorders(running)) == 2 else None, what="the stand-in")
            for pid in killed:
                os.kill(pid, signal.SIGKILL)
            until(lambda: _recorders(running) - killed, what="another recorder")
            _feed(feeder, running)
            feeder.stop()
            running.process.send_signal(signal.SIGINT)
            running.process.wait(timeout=END_S)
        assert _bytes(session, "line") == b"".join(feeder.sent_lines)
        events = [data for _, _, _, _, data in Recording.open(session).messages("/fti/event", kind="raw")]
        assert any(b"ended with signal 9" in data for data in events)


def _frames_of(session: Path, number: str) -> list[RawFrame]:
    return list(Recording.open(session / f"{session.name}_{number}.mcap").frames())


def _last_time(path: Path) -> int:
    """Time of the last message that the official stream reader finds in a file without an end."""
    last = 0
    with path.open("rb") as stream:
        try:
            for record in StreamReader(stream).records:
                if isinstance(record, Message):
                    last = max(last, record.log_time)
        except EndOfFile:
            pass
    return last


@pytest.mark.alone
def test_a_power_cut_is_closed_by_the_next_start(tmp_path: Path, scale: int, heartbeats: Heartbeats) -> None:
    """Again and again in one directory, each time at another moment; nothing that was whole in a file is lost."""
    chance, cut, lost = Random(SEED), list[tuple[Path, Frames]](), list[tuple[int, int]]()
    for turn in range(scale):
        with Feeder(tmp_path / f"links{turn}") as feeder:
            with _power(feeder, tmp_path) as running:
                session, epoch = running.session, running.info["epoch_ns"]
                _feed(feeder, running)
                time.sleep(chance.uniform(0, 0.5))  # the moment of the cut
                killed = time.monotonic_ns() + epoch
                running.kill_all()
            feeder.stop()
        raw = session / f"{session.name}_000.mcap"
        lost.append((_last_time(raw) - epoch, killed - epoch))
        cut.append((raw, read_as_it_lies(raw)))
    heartbeats.stop()
    assert max(end - begin - heartbeats.paused_ns(begin, end) for begin, end in lost) < KILL_TOLERANCE_NS
    with Feeder(tmp_path / "links") as feeder, _power(feeder, tmp_path, "--duration", "1") as running:
        running.wait()
    assert any("closed" in line and str(cut[-1][0].parent) in line for line in running.lines)
    assert len({raw.parent for raw, _ in cut}) == scale
    for raw, before in cut:
        _assert_readable(raw.parent)
        after = read_finished(raw)
        assert {seq: after.get(seq) for seq in before} == before


def _power(feeder: Feeder, folder: Path, *arguments: str) -> AbstractContextManager[Daemon]:
    return daemon(feeder.config, folder / "out", "--links", str(feeder.links), *arguments)
