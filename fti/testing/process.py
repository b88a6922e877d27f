"""A program of the bench: runs in its own process group, writes its output to files, and is always ended."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from fti.testing.errors import BenchError

LAST_LINES = 30
MAX_SHOWN_BYTES = 20_000
PR_SET_PDEATHSIG = 1
FTI = (sys.executable, "-m", "fti.cli.main")
_LIBC = ctypes.CDLL(None)


class BenchProcess:
    """One program, started by the constructor.

    name : of its files in the folder: NAME_stdout.txt, NAME_stderr.txt; title : in messages
    environment, cwd : None : those of this process.  Raises BenchError when it cannot be started.
    """

    def __init__(
        self,
        title: str,
        name: str,
        command: Sequence[str],
        folder: Path,
        *,
        environment: Mapping[str, str] | None = None,
        cwd: Path | None = None,
    ) -> None:
        self.title, self.command = title, list(command)
        self.stdout, self.stderr = (folder / f"{name}_{stream}.txt" for stream in ("stdout", "stderr"))
        self.was_killed = False
        with self.stdout.open("wb") as out, self.stderr.open("wb") as err:
            try:
                self._process = subprocess.Popen(
                    self.command,
                    stdin=subprocess.DEVNULL,
                    stdout=out,
                    stderr=err,
                    env=None if environment is None else dict(environment),
                    cwd=cwd,
                    start_new_session=True,  # Ctrl-C reaches only pytest, which ends all programs in order
                    preexec_fn=_end_with_parent,  # noqa: PLW1509  one system call, no lock is taken
                )
            except OSError as error:
                raise BenchError(f"{title}: {self.command[0]}: cannot be started: {error.strerror}") from None

    @property
    def pid(self) -> int:
        """Process number."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """None while it runs; negative: the signal that ended it."""
        return self._process.poll()

    @property
    def output(self) -> str:
        """Its output on stdout and stderr so far."""
        return _text(self.stdout) + _text(self.stderr)

    def last_lines(self, count: int = LAST_LINES) -> str:
        """The last lines of both streams, each with a heading; "" without output."""
        parts = list[str]()
        for file in (self.stdout, self.stderr):
            if lines := _text(file).splitlines():
                stream, shown = file.stem.rpartition("_")[2], lines[-count:]
                parts += [f"-- {stream}, the last {len(shown)} of {len(lines)} lines", *shown]
        return "\n".join(parts)

    def ends_within(self, timeout_s: float) -> int | None:
        """Wait for its end; returns the exit code, None while it runs."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout_s)
        return self.exit_code

    def end(self, number: int, timeout_s: float) -> int:
        """End it: the signal first, and after timeout_s SIGKILL for it and its children.  Returns the exit code."""
        if self.exit_code is None:
            self._process.send_signal(number)
            try:
                self._process.wait(timeout_s)
            except subprocess.TimeoutExpired:
                self.was_killed = True
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)
        return self._process.wait()


def quiet_environment() -> dict[str, str]:
    """Environment of emulator and recorder, with unbuffered output."""
    return {**os.environ, "PYTHONUNBUFFERED": "1"}


def _end_with_parent() -> None:
    """Between fork and exec: the kernel ends this program when pytest is killed."""
    _LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def _text(file: Path) -> str:
    """The end of a text file that a program may be writing."""
    with file.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(max(size - MAX_SHOWN_BYTES, 0))
        return stream.read().decode("utf-8", "replace")
