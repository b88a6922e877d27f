"""The run directory: where ``watch``, ``mark`` and ``send`` find a daemon.

``$XDG_RUNTIME_DIR/fti/<name>/`` (or ``/tmp/fti-<uid>/<name>/``) holds ``fti.json`` (pid, session, addresses) and
``fti.sock``, the control socket of the owner alone (0600).  A lock (``flock``) on the directory says that it is taken.
"""

from __future__ import annotations

import fcntl
import itertools
import json
import os
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

from fti.errors import MissingError

INFO = "fti.json"
SOCKET = "fti.sock"
#: What an address of a Unix socket holds [B].
LONGEST_SOCKET = 107
ADVICE = "choose another one with --run-dir"


@dataclass(frozen=True, slots=True)
class DaemonInfo:
    """What a client must know of a running daemon; ``display`` and ``zenoh`` are None when switched off."""

    pid: int
    name: str
    session: str
    display: str | None
    zenoh: str | None
    epoch_ns: int
    sock: str


def base() -> Path:
    """The folder that holds the run directories of this user."""
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    return Path(runtime) / "fti" if runtime else Path(tempfile.gettempdir()) / f"fti-{os.getuid()}"


@dataclass(frozen=True, slots=True)
class RunDir:
    """A run directory that is ours: nobody else gets it before ``withdraw`` or the end of this process."""

    path: Path
    lock_fd: int

    @property
    def socket(self) -> Path:
        """Where the control socket is."""
        return self.path / SOCKET

    def withdraw(self) -> None:
        """Remove what ``publish`` and the control socket left, and let others have the directory."""
        for name in (INFO, SOCKET):
            (self.path / name).unlink(missing_ok=True)
        os.close(self.lock_fd)


def make(name: str, run_dir: str | None) -> RunDir:
    """The run directory of a daemon, created for the owner alone.

    A second daemon of the same name gets one with a number, also when both start at the same moment.  Raises
    MissingError when the directory cannot be made, its path is too long, or the one asked for is in use.
    """
    if run_dir is None:
        candidates = (base() / (name if n == 1 else f"{name}_{n}") for n in itertools.count(1))
        return next(claimed for claimed in map(_claim, candidates) if claimed)
    claimed = _claim(Path(run_dir))
    if claimed is None:
        raise MissingError(f"{run_dir}: another daemon is running there")
    return claimed


def _claim(path: Path) -> RunDir | None:
    """The directory, made and locked; None when another daemon has it."""
    if len(os.fsencode(path / SOCKET)) > LONGEST_SOCKET:
        raise MissingError(f"{path / SOCKET}: too long for a control socket (limit {LONGEST_SOCKET} bytes); {ADVICE}")
    try:
        path.mkdir(parents=True, exist_ok=True, mode=0o700)
        lock_fd = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise MissingError(f"{path}: the run directory cannot be made: {error.strerror}") from None
    try:
        fcntl.flock(lock_fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(lock_fd)
        if isinstance(error, BlockingIOError):
            return None
        raise MissingError(f"{path}: the run directory cannot be locked: {error.strerror}; {ADVICE}") from None
    return RunDir(path, lock_fd)


def publish(path: Path, info: DaemonInfo) -> None:
    """Write ``fti.json`` so that a reader sees the old one or the new one, never half of it."""
    draft = path / (INFO + ".new")
    draft.write_text(json.dumps(asdict(info)))
    draft.replace(path / INFO)


def find_daemon(run_dir: str | None = None) -> DaemonInfo:
    """The daemon of a run directory, or the only one of this user.  Raises MissingError when there is none."""
    if run_dir:
        return _read(Path(run_dir) / INFO)
    running = [info for info in map(_try_read, sorted(base().glob(f"*/{INFO}"))) if info]
    if not running:
        raise MissingError("no daemon is running; start one with: fti run CONFIG")
    if len(running) > 1:
        names = ", ".join(str(Path(info.sock).parent) for info in running)
        raise MissingError(f"several daemons are running; choose one with --run-dir: {names}")
    return running[0]


def _read(path: Path) -> DaemonInfo:
    info = _try_read(path)
    if info is None:
        raise MissingError(f"{path.parent}: no daemon is running there")
    return info


def _try_read(path: Path) -> DaemonInfo | None:
    try:
        info = DaemonInfo(**json.loads(path.read_text()))
    except (OSError, ValueError, TypeError):
        return None
    return info if _is_running(info.pid) else None


def _is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except PermissionError:  # it runs, and is another user's
        return True
    except OSError:
        return False
    return True
