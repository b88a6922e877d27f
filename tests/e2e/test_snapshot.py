"""Snapshots of a running daemon, beside the recording and instead of it; and a recorder that the machine prefers."""

from __future__ import annotations

import contextlib
import io
import json
import os
import signal
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from fti import config as configuration
from fti.cli.main import main
from fti.errors import ConfigError
from fti.logger.reading.recording import Recording
from fti.messages.frames import TICK_LINK, RawFrame
from fti.service import realtime
from tests.e2e.feeder import Feeder
from tests.e2e.harness import Daemon, daemon, fti
from tests.helpers import until

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(900)]
BEFORE_S, AFTER_S = 0.6, 0.3
SECOND_NS = 1_000_000_000
TIMEOUT_S = 30.0


@pytest.fixture
def feeder(tmp_path: Path) -> Iterator[Feeder]:
    with Feeder(tmp_path / "links") as new_feeder:
        yield new_feeder


def _configure(feeder: Feeder, *, mode: str = "continuous", after_s: float = AFTER_S, more: str = "") -> None:
    text = feeder.config.read_text().replace("min_free_mb = 10\n", f'min_free_mb = 10\nmode = "{mode}"\n')
    text = text.replace("[display]\n", "[display]\nenabled = false\n")
    feeder.config.write_text(f"{text}\n[snapshot]\nbefore_s = {BEFORE_S}\nafter_s = {after_s}\n{more}")


def _snapshot(running: Daemon) -> dict[str, Any]:
    content: dict[str, Any] = running.health()["snapshot"] or {}
    return content


def _await_memory(running: Daemon) -> None:
    """The memory holds more than a trigger asks for."""
    until(lambda: _snapshot(running).get("held_s", 0) > BEFORE_S, TIMEOUT_S, "a full memory")


def _command(*arguments: str) -> tuple[int, str]:
    """Run a command in this process; exit code and what it printed."""
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        code = main(list(arguments))
    return code, printed.getvalue()


def _trigger(running: Daemon, text: str) -> None:
    assert _command("mark", "--trigger", text, "--run-dir", str(running.run_dir))[0] == 0


def _await_file(running: Daemon) -> None:
    until(lambda: (s := _snapshot(running)).get("file") and s["state"] == "waiting", TIMEOUT_S, "a snapshot")


def _triggered_ns(recording: Recording) -> list[int]:
    events = recording.messages("/fti/event", kind="raw")
    return [log for _, log, _, _, data in events if json.loads(data)["name"] == "trigger"]


def _stamped(frames: Iterator[RawFrame], begin_ns: int, end_ns: int) -> list[RawFrame]:
    return [frame for frame in frames if begin_ns <= frame.t_rx_ns <= end_ns]


def _prefer(feeder: Feeder, cpu: int, folder: Path) -> bool:
    """Configure what the machine permits; what it does not, ``fti run`` refuses as the check does."""
    settings = f"[recorder]\ncpu = [{cpu}]\nscheduler = 'fifo'\npriority = 17\nlock_memory = true\nfreeze_gc = true\n"
    plain = feeder.config.read_text()
    _configure(feeder, more=settings)
    try:
        realtime.check(configuration.load(feeder.config))
    except ConfigError as error:
        done = fti("run", str(feeder.config), "--out", str(folder / "out"))
        assert (done.returncode, done.stderr.strip()) == (2, str(error))
        feeder.config.write_text(plain)
        _configure(feeder)
        return False
    return True


def _check_tuning(running: Daemon, cpu: int) -> None:
    pid = running.pid_of("recorder")
    tasks = [int(task.name) for task in Path(f"/proc/{pid}/task").iterdir()]
    assert len(tasks) > 2
    assert {os.sched_getscheduler(task) for task in tasks} == {os.SCHED_FIFO}
    assert {task: os.sched_getparam(task).sched_priority for task in tasks} == {t: 17 - (t != pid) for t in tasks}
    assert all(os.sched_getaffinity(task) == {cpu} for task in tasks)
    status = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    assert int(status["VmLck"].split()[0]) > 10_000  # KiB
    assert os.sched_getscheduler(running.pid_of("navigation")) == os.SCHED_OTHER


def test_a_snapshot_holds_exactly_what_the_recording_holds_of_that_time(feeder: Feeder, tmp_path: Path) -> None:
    """By a recorder that the machine prefers, where it permits that; else it is refused."""
    cpu = max(os.sched_getaffinity(0))
    preferred = _prefer(feeder, cpu, tmp_path)
    with daemon(feeder.config, tmp_path / "out", "--links", str(feeder.links)) as running:
        session = running.session
        feeder.start()
        if preferred:
            _check_tuning(running, cpu)
        _await_memory(running)
        _trigger(running, "flutter at 120 kt")
        _await_file(running)
        assert running.health()["session"]["mode"] == "continuous"
        feeder.stop()
        assert running.stop() == 130
    recording = Recording.open(session)
    (file,) = recording.snapshot_files
    (t_ns,) = _triggered_ns(recording)
    begin_ns, end_ns = t_ns - round(BEFORE_S * SECOND_NS), t_ns + round(AFTER_S * SECOND_NS)
    snapshot = list(Recording.open(file).frames())
    assert snapshot == _stamped(recording.frames(), begin_ns, end_ns)
    assert {frame.link for frame in snapshot} == {"line", "eth", TICK_LINK}
    assert sum(frame.link == "eth" for frame in snapshot) > 50
    (event,) = Recording.open(file).messages("/fti/event", kind="snapshot")
    assert (event[1], json.loads(event[4])["message"]) == (t_ns, "flutter at 120 kt")
    assert _command("verify", str(session))[0] == 0
    assert _command("verify", str(file))[0] == 0


def test_in_mode_snapshot_every_frame_is_in_a_snapshot_or_not_triggered(feeder: Feeder, tmp_path: Path) -> None:
    _configure(feeder, mode="snapshot")
    with daemon(feeder.config, tmp_path / "out", "--links", str(feeder.links)) as running:
        session = running.session
        feeder.start()
        _await_memory(running)
        _trigger(running, "one")
        _await_file(running)
        first = _snapshot(running)["file"]
        _await_memory(running)
        _trigger(running, "two")
        until(lambda: _snapshot(running)["file"] != first, TIMEOUT_S, "another file")
        _await_file(running)
        assert running.health()["session"]["mode"] == "snapshot"
        feeder.stop()
        assert running.stop() == 130
    assert any("mode snapshot" in line for line in running.lines)
    recording = Recording.open(session)
    assert recording.metadata["fti"]["mode"] == "snapshot"
    assert len(recording.snapshot_files) == 2
    assert not [t for t, *_ in recording.messages("/raw/", kind="raw")]
    datagrams = [frame.data for frame in recording.frames() if frame.link == "eth"]
    code, printed = _command("verify", str(session), "--json")
    proof = json.loads(printed)
    assert code == 0, printed
    account, left_out = proof["accounts"]["/raw/eth"], len(feeder.sent_lines) - len(datagrams)
    assert account["recorded"] == {"frames": len(datagrams), "bytes": 10 * len(datagrams)}
    assert account["dropped"] == {"not_triggered": {"frames": left_out, "bytes": 10 * left_out}}
    _check_parts(datagrams, feeder.sent_lines)
    assert "SNAPSHOT" in printed
    assert "SNAPSHOT" in _command("info", str(session))[1]


def _check_parts(datagrams: list[bytes], expected: list[bytes]) -> None:
    """Two rows of what was sent, and something before, between and behind them is not there."""
    numbers = [int(data) for data in datagrams]
    assert [expected[n] for n in numbers] == datagrams
    assert numbers == sorted(set(numbers))
    jumps = [b - a for a, b in pairwise(numbers) if b != a + 1]
    assert len(jumps) == 1
    assert numbers[0] > 0
    assert numbers[-1] < len(expected) - 1


def test_what_a_killed_recorder_had_written_of_a_snapshot_is_there(feeder: Feeder, tmp_path: Path) -> None:
    _configure(feeder, mode="snapshot", after_s=3600.0)
    with daemon(feeder.config, tmp_path / "out", "--links", str(feeder.links)) as running:
        session = running.session
        feeder.start()
        _await_memory(running)
        _trigger(running, "boom")
        until(lambda: _snapshot(running)["file"], TIMEOUT_S, "a snapshot")
        file = Path(_snapshot(running)["file"])
        until(lambda: file.stat().st_size > 10_000, TIMEOUT_S, "frames in it")
        os.kill(running.pid_of("recorder"), signal.SIGKILL)
        until(lambda: running.health()["processes"]["recorder"]["restarts"] == 1, TIMEOUT_S, "a stand-in")
        until(lambda: _snapshot(running).get("held_s"), TIMEOUT_S, "a memory")
        _trigger(running, "again")
        until(lambda: _snapshot(running)["file"], TIMEOUT_S, "another snapshot")
        feeder.stop()
        assert running.stop() == 130
    recording = Recording.open(session)
    assert [path.name[-7:-5] for path in recording.snapshot_files] == ["00", "01"]
    assert not recording.find_unfinished_files()
    assert sum(frame.link == "eth" for frame in Recording.open(file).frames()) > 50
    code, printed = _command("verify", str(session))
    assert code == 3, printed
    assert "never_written" in printed or "ended without a final ledger" in printed
