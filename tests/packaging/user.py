"""A user who installed the program: a home of his own, no right to write to the program, nothing of the repository."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

NOBODY = 65534
#: Interpreters to install for; an ordinary user must be able to run it.
INTERPRETERS = (getattr(sys, "_base_executable", sys.executable), "/usr/bin/python3")
TIMEOUT_S = 900.0  # the first start compiles, beside other tests


def user_id() -> int:
    """The user who runs the program: root becomes another one."""
    return NOBODY if os.geteuid() == 0 else os.geteuid()


def is_new_enough(python: str) -> bool:
    """The user may run this interpreter, and it is Python 3.11 or newer."""
    check = "import sys, venv; sys.exit(sys.version_info < (3, 11))"
    try:
        return subprocess.run([python, "-c", check], user=user_id(), cwd="/", check=False).returncode == 0
    except OSError:
        return False


def interpreter() -> str:
    """An interpreter, new enough, that the user may run.  Raises AssertionError when there is none."""
    for python in INTERPRETERS:
        if is_new_enough(python):
            return python
    raise AssertionError(f"none of {', '.join(INTERPRETERS)} is Python 3.11 or newer that user {user_id()} may run")


@contextlib.contextmanager
def make_home() -> Iterator[Path]:
    """A home of the user, in a folder of /tmp that everybody can enter."""
    with tempfile.TemporaryDirectory(prefix="fti-user-") as name:
        Path(name).chmod(0o755)
        home = Path(name, "home")
        home.mkdir()
        os.chown(home, user_id(), -1)
        yield home


@dataclass(frozen=True)
class User:
    """home : his folder, where he works; programs : the folder of the installed ``fti``"""

    home: Path
    programs: Path

    @property
    def _environment(self) -> Mapping[str, str]:
        return {"HOME": str(self.home), "PATH": f"{self.programs}:/usr/bin:/bin", "LANG": "C.UTF-8"}

    def start(self, *command: str) -> subprocess.Popen[str]:
        """Start a command in his folder."""
        return subprocess.Popen(
            [self.programs / command[0], *command[1:]],
            cwd=self.home,
            env=self._environment,
            user=user_id(),
            group=user_id(),
            extra_groups=[],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, *command: str, codes: tuple[int, ...] = (0,)) -> str:
        """Run a command that must end with one of the exit codes; returns its output."""
        process = self.start(*command)
        out, errors = process.communicate(timeout=TIMEOUT_S)
        assert process.returncode in codes, f"{' '.join(command)}: exit code {process.returncode}\n{out}\n{errors}"
        return out

    @contextlib.contextmanager
    def running(self, *command: str, ready: str) -> Iterator[None]:
        """Run a command beside the block, from its line ``ready`` on; it ends by itself."""
        process = self.start(*command)
        try:
            assert process.stdout
            assert process.stdout.readline().strip() == ready, process.communicate()
            yield
            out, errors = process.communicate(timeout=TIMEOUT_S)
            assert process.returncode == 0, f"{' '.join(command)}:\n{out}\n{errors}"
        finally:
            process.kill()
            process.wait()
