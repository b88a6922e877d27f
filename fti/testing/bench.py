"""A bench: one flight with emulator, recorder and unit under test, in one folder, with one shutdown sequence.

links           ptys of the emulator
session/NAME    the recorded session, with the truth of the flight
*.toml          scenario and configurations of the flight
*_stdout.txt    output of each program; *_stderr.txt
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace, TracebackType

from fti.testing.emulator import Emulator
from fti.testing.process import BenchProcess
from fti.testing.recorder import Recorder
from fti.testing.slots import FlightSlots
from fti.testing.unit import UnitUnderTest
from fti.testing.workspace import Workspace


class Bench:
    """A context: leaving it ends every program and moves the truth into the session.

    folder : of all results, made if missing; slots : limit of simultaneous flights on this machine; None : no limit
    """

    def __init__(self, folder: Path, slots: FlightSlots | None = None) -> None:
        self._workspace = Workspace(folder, slots)
        self.folder = self._workspace.folder
        self.recorder = Recorder(self._workspace)
        self.emulator = Emulator(self._workspace, self.recorder, self._end_flight)
        self.unit = UnitUnderTest(self._workspace, self._placeholders)
        self.is_closed = False

    def __enter__(self) -> Bench:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _placeholders(self) -> dict[str, SimpleNamespace]:
        """Values of ``{emulator.LINK.path}`` etc. in arguments and environment of the unit under test."""
        parts = {"emulator": self.emulator.links, "recorder": self.recorder.links}
        return {name: SimpleNamespace(**links) for name, links in parts.items()}

    def _end_flight(self) -> None:
        """End the unit under test, then the emulator, then the recorder, so that it records the last messages."""
        with contextlib.ExitStack() as stack:  # in reverse order, each even if another fails
            stack.callback(self._workspace.release_slot)
            stack.callback(self.recorder.end)
            stack.callback(self.emulator.end)
            stack.callback(self.unit.end)

    def close(self) -> None:
        """End every program that is still running."""
        if not self.is_closed:
            self.is_closed = True
            with contextlib.ExitStack() as stack:
                stack.callback(self._workspace.remove_run_folder)
                self._end_flight()

    @property
    def processes(self) -> list[BenchProcess]:
        """Every program that was started."""
        bench_processes = [part.process for part in (self.emulator, self.recorder) if part.process]
        return [*self.unit.programs, *bench_processes]

    def sections(self) -> Iterator[tuple[str, str]]:
        """Title and last lines of each program, for the report of a failure."""
        for program in self.processes:
            if text := program.last_lines():
                yield f"{program.title} ({program.stdout.parent})", text
