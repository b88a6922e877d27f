"""Flights at a time, over processes."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
from pathlib import Path

from fti.testing.slots import FlightSlots
from tests.helpers import until

HOLD = """
import sys, time
from pathlib import Path
from fti.testing.slots import FlightSlots
with FlightSlots(Path(sys.argv[1]), int(sys.argv[2])).hold():
    print("taken", flush=True)
    time.sleep(600)
"""


def holder(folder: Path, count: int) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", HOLD, str(folder), str(count)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def test_who_is_one_too_many_waits_until_another_has_ended(tmp_path: Path) -> None:
    holders = [holder(tmp_path, 2) for _ in range(2)]
    try:
        assert [one.stdout.readline() for one in holders if one.stdout] == ["taken\n"] * 2
        third = holder(tmp_path, 2)
        holders.append(third)
        assert third.stdout
        until(lambda: Path(f"/proc/{third.pid}/fd").is_dir() and len(_locks(third.pid)) == 2, what="the third looks")
        assert not select.select([third.stdout], [], [], 0.0)[0]
        os.kill(holders[0].pid, signal.SIGKILL)  # its slot is free again, whatever it dies of
        assert third.stdout.readline() == "taken\n"
    finally:
        for one in holders:
            one.kill()
            one.communicate()


def _locks(pid: int) -> list[str]:
    texts = [str(file.readlink()) for file in Path(f"/proc/{pid}/fd").iterdir() if file.is_symlink()]
    return [name for name in texts if name.endswith(".lock")]


def test_slots_are_free_after_use(tmp_path: Path) -> None:
    slots = FlightSlots(tmp_path / "new", 1)
    for _ in range(3):
        with slots.hold():
            assert len(_locks(os.getpid())) == 1
        assert not _locks(os.getpid())


def test_a_process_does_not_wait_for_itself(tmp_path: Path) -> None:
    slots = FlightSlots(tmp_path, 1)
    with slots.hold(), slots.hold():
        assert len(_locks(os.getpid())) == 1
    assert not _locks(os.getpid())


def test_there_is_always_one(tmp_path: Path) -> None:
    assert FlightSlots(tmp_path).count >= 1
    assert FlightSlots(tmp_path, 7).count == 7
