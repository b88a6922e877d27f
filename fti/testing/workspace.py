"""What the parts of a bench share: folders, a slot of this machine, and the programs that a flight needs."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from fti.testing.errors import BenchError
from fti.testing.process import BenchProcess
from fti.testing.slots import FlightSlots

POLL_S = 0.02
ResultT = TypeVar("ResultT")


class Workspace:
    """Folders, slot and needed programs of one flight.

    folder     : of all results, made if missing; slots : limit of simultaneous flights on this machine; None : no limit
    run_folder : for sockets: their path must be short, and that of a test folder is long
    truth      : the truth file of the flight, until the recorder moves it
    needed     : programs that must run until the end of the flight
    """

    def __init__(self, folder: Path, slots: FlightSlots | None) -> None:
        self.folder = folder.absolute()
        self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        self.run_folder = Path(tempfile.mkdtemp(prefix="fti_bench_"))
        self.truth = self.folder / "flight_truth_000.mcap"
        self.needed: list[BenchProcess] = []
        self._slots = slots
        self._slot = contextlib.ExitStack()

    def take_slot(self) -> None:
        """Wait for a slot for a flight on this machine; once for each bench."""
        if self._slots:
            self._slot.enter_context(self._slots.hold())
            self._slots = None

    def release_slot(self) -> None:
        """Release the slot."""
        self._slot.close()

    def wait_for(self, condition: Callable[[], ResultT], timeout_s: float, what: Callable[[], str]) -> ResultT:
        """Wait until a condition holds while every program runs.  Raises BenchError, which names the condition."""
        deadline = time.monotonic() + timeout_s
        while not (found := condition()):
            self._check_running()
            if time.monotonic() > deadline:
                raise BenchError(f"waited {timeout_s:g} s for {what()}")
            time.sleep(POLL_S)
        return found

    def _check_running(self) -> None:
        for program in self.needed:
            if program.exit_code is not None:
                raise BenchError(
                    f"{program.title} ended with exit code {program.exit_code} before the flight was over\n"
                    f"{program.last_lines()}"
                )

    def remove_run_folder(self) -> None:
        """Remove the sockets."""
        shutil.rmtree(self.run_folder, ignore_errors=True)
