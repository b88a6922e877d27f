"""A bench: one flight with emulator, recorder and unit under test, in one folder, with one shutdown sequence.

links           ptys of the emulator
session/NAME    the recorded session, with the truth of the flight
*.toml          scenario and configurations of the flight
*_stdout.txt    output of each program; *_stderr.txt
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace, TracebackType
from typing import TypeVar

from fti.testing.emulator import Emulator
from fti.testing.errors import BenchError
from fti.testing.process import BenchProcess
from fti.testing.recorder import Recorder
from fti.testing.slots import FlightSlots
from fti.testing.unit import UnitUnderTest

POLL_S = 0.02
ResultT = TypeVar("ResultT")


class Bench:
    """A context: leaving it ends every program and moves the truth into the session.

    folder : of all results, made if missing; slots : limit of simultaneous flights on this machine; None : no limit
    """

    def __init__(self, folder: Path, slots: FlightSlots | None = None) -> None:
        self.folder = folder.absolute()
        self.folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        #: The path of a socket must be short, and that of a test folder is long.
        self.run_folder = Path(tempfile.mkdtemp(prefix="fti_bench_"))
        self.slots = contextlib.ExitStack()
        self._slots = slots
        self.emulator = Emulator(self)
        self.recorder = Recorder(self)
        self.unit = UnitUnderTest(self)
        self.is_closed = False

    def __enter__(self) -> Bench:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def processes(self) -> list[BenchProcess]:
        """Every program that was started."""
        bench_processes = [part.process for part in (self.emulator, self.recorder) if part.process]
        return [*self.unit.programs, *bench_processes]

    @property
    def placeholders(self) -> dict[str, SimpleNamespace]:
        """Values of ``{emulator.LINK.path}`` etc. in arguments and environment of the unit under test."""
        parts = {"emulator": self.emulator.links, "recorder": self.recorder.links}
        return {name: SimpleNamespace(**links) for name, links in parts.items()}

    def take_slot(self) -> None:
        """Wait for a slot for a flight on this machine; once for each bench."""
        if self._slots:
            self.slots.enter_context(self._slots.hold())
            self._slots = None

    def wait_for(self, condition: Callable[[], ResultT], timeout_s: float, what: Callable[[], str]) -> ResultT:
        """Wait until a condition holds while every program runs.  Raises BenchError, which names the condition."""
        deadline = time.monotonic() + timeout_s
        while not (found := condition()):
            self.check_running()
            if time.monotonic() > deadline:
                raise BenchError(f"waited {timeout_s:g} s for {what()}")
            time.sleep(POLL_S)
        return found

    def check_running(self) -> None:
        """Raise BenchError when a program that the flight needs has ended."""
        for program in [*self.unit.programs, *filter(None, [self.recorder.process])]:
            if program.exit_code is not None:
                raise BenchError(
                    f"{program.title} ended with exit code {program.exit_code} before the flight was over\n"
                    f"{program.last_lines()}"
                )

    def end_flight(self) -> None:
        """End the unit under test, then the emulator, then the recorder, so that it records the last messages."""
        with contextlib.ExitStack() as stack:  # in reverse order, each even if another fails
            stack.callback(self.slots.close)
            stack.callback(self.recorder.end)
            stack.callback(self.emulator.end)
            stack.callback(self.unit.end)

    def close(self) -> None:
        """End every program that is still running."""
        if not self.is_closed:
            self.is_closed = True
            with _remove_folder(self.run_folder):
                self.end_flight()

    def sections(self) -> Iterator[tuple[str, str]]:
        """Title and last lines of each program, for the report of a failure."""
        for program in self.processes:
            if text := program.last_lines():
                yield f"{program.title} ({program.stdout.parent})", text


@contextlib.contextmanager
def _remove_folder(folder: Path) -> Iterator[None]:
    try:
        yield
    finally:
        shutil.rmtree(folder, ignore_errors=True)
