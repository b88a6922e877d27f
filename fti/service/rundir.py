"""The run directory: where ``watch``, ``mark`` and ``send`` find a daemon.

``$XDG_RUNTIME_DIR/fti/<name>/`` (or ``/tmp/fti-<uid>/<name>/``) holds ``fti.json`` (pid, session, addresses) and
``fti.sock``, the control socket of the owner alone (0600).
"""

from __future__ import annotations

import itertools
import json
import os
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

from fti.errors import MissingError

INFO = "fti.json"
SOCKET = "fti.sock"


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


def make(name: str, run_dir: str | None) -> Path:
    """The run directory of a daemon, created for the owner alone.

    A second daemon of the same name gets one with a number.  Raises MissingError when the directory cannot be made or
    the one asked for is in use.
    """
    path = Path(run_dir) if run_dir else _first_free(name)
    if run_dir and _try_read(path / INFO):
        raise MissingError(f"{path}: another daemon is running there")
    try:
        path.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as error:
        raise MissingError(f"{path}: the run directory cannot be made: {error.strerror}") from None
    return path


def _first_free(name: str) -> Path:
    candidates = (base() / (name if n == 1 else f"{name}_{n}") for n in itertools.count(1))
    return next(path for path in candidates if _try_read(path / INFO) is None)


def publish(path: Path, info: DaemonInfo) -> None:
    """Write ``fti.json`` so that a reader sees the old one or the new one, never half of it."""
    draft = path / (INFO + ".new")
    draft.write_text(json.dumps(asdict(info)))
    draft.replace(path / INFO)


def withdraw(path: Path) -> None:
    """Remove what ``publish`` and the control socket left."""
    for name in (INFO, SOCKET):
        (path / name).unlink(missing_ok=True)


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
