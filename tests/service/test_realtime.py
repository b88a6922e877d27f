"""Real-time settings of the recorder: permitted, refused with an error, and limited by the kernel."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fti.config import Config, RecorderTuning, Session
from fti.errors import ConfigError
from fti.service import realtime
from tests.helpers import ROOT

CONFIG = '[session]\nname = "x"\n[recorder]\n'
#: Runs what follows without the capabilities that permit anything, and with small limits; as any user.
POWERLESS = """
import ctypes, os, resource, sys
for capability in (14, 23, 24):  # CAP_IPC_LOCK, CAP_SYS_NICE, CAP_SYS_RESOURCE: gone with the next program
    ctypes.CDLL(None).prctl(24, capability, 0, 0, 0)  # PR_CAPBSET_DROP; who is not root has none
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
resource.setrlimit(resource.RLIMIT_MEMLOCK, (65536, 65536))
os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
"""


def powerless(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", POWERLESS, *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        cwd=ROOT,
    )


def config(**table: object) -> Config:
    tuning = RecorderTuning.model_validate(table)
    return Config(session=Session(name="x"), recorder=tuning, path="here.toml")


def test_nothing_is_asked_for_by_default() -> None:
    realtime.check(config())
    before = os.sched_getaffinity(0), os.sched_getscheduler(0)
    assert realtime.apply(RecorderTuning()) == []
    assert (os.sched_getaffinity(0), os.sched_getscheduler(0)) == before


def test_a_processor_that_is_not_there_is_named_with_those_that_are() -> None:
    before = os.sched_getaffinity(0)
    there = min(before)
    with pytest.raises(ConfigError) as caught:
        realtime.check(config(cpu=(there, 9999)))
    output = str(caught.value)
    assert output.startswith("here.toml: recorder.cpu[1] = 9999:")
    assert f"allowed are {', '.join(map(str, sorted(before)))}" in output
    assert os.sched_getaffinity(0) == before
    realtime.check(config(cpu=(there,)))
    assert os.sched_getaffinity(0) == before


@pytest.mark.parametrize(
    ("table", "named"),
    [
        (
            'scheduler = "fifo"\npriority = 33\n',
            ["recorder.scheduler = 'fifo'", "33", "CAP_SYS_NICE", "LimitRTPRIO=33"],
        ),
        ("lock_memory = true\n", ["recorder.lock_memory = true", "64 KiB", "CAP_IPC_LOCK", "LimitMEMLOCK=infinity"]),
    ],
)
@pytest.mark.parametrize("command", ["check", "run"])
def test_what_is_not_permitted_is_refused_before_anything_is_made(
    tmp_path: Path, command: str, table: str, named: list[str]
) -> None:
    file, out = tmp_path / "c.toml", tmp_path / "out"
    file.write_text(CONFIG + table)
    places = ["--out", str(out), "--run-dir", str(tmp_path / "run")] if command == "run" else []
    done = powerless("-m", "fti.cli.main", command, str(file), *places)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    for part in [str(file), *named]:
        assert part in done.stderr
    assert sorted(tmp_path.iterdir()) == [file]


def fifo_is_permitted() -> bool:
    try:
        realtime.check(config(scheduler="fifo"))
    except ConfigError:
        return False
    return True


#: The reader, and a thread that it starts.
LEVELS = """
import gc, os, threading
from fti.config import RecorderTuning
from fti.service import realtime
print(realtime.apply(RecorderTuning(scheduler="fifo", priority=10, freeze_gc=True)), gc.isenabled())
def step():
    realtime.step_below_reader()
    print(os.sched_getscheduler(0), os.sched_getparam(0).sched_priority)
thread = threading.Thread(target=step)
thread.start()
thread.join()
print(os.sched_getscheduler(0), os.sched_getparam(0).sched_priority)
"""


def test_the_reader_is_above_every_other_thread() -> None:
    command = [sys.executable, "-c", LEVELS]
    output = subprocess.run(
        command, capture_output=True, text=True, timeout=120, check=True, cwd=ROOT
    ).stdout.splitlines()
    if fifo_is_permitted():
        assert output == ["[] False", f"{os.SCHED_FIFO} 9", f"{os.SCHED_FIFO} 10"]
    else:
        assert output == ["['[recorder]: Operation not permitted'] False", "0 0", "0 0"]


def test_where_nothing_is_left_to_others_fifo_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    throttle = tmp_path / "sched_rt_runtime_us"
    throttle.write_text("-1\n")
    monkeypatch.setattr(realtime, "RT_RUNTIME_PATH", throttle)
    monkeypatch.setattr(realtime, "_set_fifo", lambda priority: None)
    with pytest.raises(ConfigError, match=r"recorder\.scheduler = 'fifo'.*is -1"):
        realtime.check(config(scheduler="fifo"))
    throttle.write_text("950000\n")
    realtime.check(config(scheduler="fifo"))
