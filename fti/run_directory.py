"""The run directory: where ``watch``, ``mark``, ``send`` and ``page`` find a daemon.

``$XDG_RUNTIME_DIR/fti/<name>/`` (or ``/tmp/fti-<uid>/<name>/``) holds three files, for the owner alone (0600):

    fti.json    pid, session, addresses, that of the page with the command key
    fti.sock    the control socket
    page.html   redirects a browser to the page with its key

Daemon and clients use a directory only when it belongs to their user and nobody else can write to it
(``private_folder``), and a socket only when its other end is a process of this user or of root.

A daemon holds a lock (``flock``) on its directory.  Clients query a second lock without taking it; a process number
could belong to another process later.
"""

from __future__ import annotations

import contextlib
import fcntl
import itertools
import json
import os
import socket
import struct
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from fti.bus.frame import SOCKET_NAME
from fti.errors import MissingError
from fti.peer_credentials import Peer
from fti.private_folder import make_own, open_own, path_within, read_file, remove_file, write_file

INFO = "fti.json"
SOCKET = "fti.sock"
PAGE = "page.html"
#: Redirects a browser; without it the key would be on its command line, which every user can read.
REDIRECT = '<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url={url}"><title>fti</title>\n'
#: Maximum length of the address of a Unix socket [B].
MAX_SOCKET_PATH_BYTES = 107
ADVICE = "choose another one with --run-dir"
_LOCK = struct.Struct("hhqqi4x")  # struct flock: type, whence, start, length, pid


@dataclass(frozen=True, slots=True)
class DaemonInfo:
    """A running daemon, for its clients; ``display`` and ``zenoh`` are None when switched off.

    display : address of the read-only page, for all users; page : address with the key, for the owner
    """

    pid: int
    name: str
    session: str
    display: str | None
    zenoh: str | None
    epoch_ns: int
    sock: str
    page: str | None = None


def base() -> Path:
    """The folder that holds the run directories of this user."""
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    return Path(runtime) / "fti" if runtime else Path(tempfile.gettempdir()) / f"fti-{os.getuid()}"


@dataclass(frozen=True, slots=True)
class RunDirectory:
    """A locked run directory; the lock lasts until ``withdraw`` or the end of this process."""

    path: Path
    fd: int

    @property
    def control_socket(self) -> Path:
        """Path of the control socket."""
        return self.path / SOCKET

    def publish(self, info: DaemonInfo) -> None:
        """Write the files by which clients find the daemon and the owner's browser finds the page."""
        if info.page:
            write_file(self.fd, PAGE, REDIRECT.format(url=info.page).encode())
        else:
            remove_file(self.fd, PAGE)
        write_file(self.fd, INFO, json.dumps(asdict(info)).encode())

    def bind(self, name: str = SOCKET) -> socket.socket:
        """Bind a Unix socket in the directory, for the owner alone.  Raises MissingError."""
        remove_file(self.fd, name)
        sock = socket.socket(socket.AF_UNIX)
        before = os.umask(0o177)
        try:
            sock.bind(path_within(self.fd, name))
        except OSError as error:
            sock.close()
            raise MissingError(f"{self.path / name}: cannot create the socket: {error.strerror}; {ADVICE}") from None
        finally:
            os.umask(before)
        return sock

    def withdraw(self) -> None:
        """Remove the files of ``publish`` and ``bind``, and release the directory."""
        for name in (INFO, SOCKET, PAGE, SOCKET_NAME):
            remove_file(self.fd, name)
        os.close(self.fd)


def make(name: str, run_dir: str | None) -> RunDirectory:
    """The run directory of a daemon, created for the owner alone.

    A second daemon of the same name gets one with a number, also when both start at the same moment.  Raises
    MissingError when the directory cannot be created, is not safe, is in use, or its path is too long.
    """
    if run_dir is None:
        os.close(_open_or_explain(base()))
        candidates = (base() / (name if n == 1 else f"{name}_{n}") for n in itertools.count(1))
        return next(claimed for claimed in map(_claim, candidates) if claimed)
    claimed = _claim(Path(run_dir))
    if claimed is None:
        raise MissingError(f"{run_dir}: another daemon is running there")
    return claimed


def _claim(path: Path) -> RunDirectory | None:
    """Create and lock the directory; None when another daemon has it."""
    if len(os.fsencode(path / SOCKET)) > MAX_SOCKET_PATH_BYTES:
        raise MissingError(
            f"{path / SOCKET}: too long for a control socket (limit {MAX_SOCKET_PATH_BYTES} bytes); {ADVICE}"
        )
    fd = _open_or_explain(path)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        fcntl.fcntl(fd, fcntl.F_OFD_SETLK, _LOCK.pack(fcntl.F_RDLCK, os.SEEK_SET, 0, 0, 0))
    except OSError as error:
        os.close(fd)
        if isinstance(error, BlockingIOError):
            return None
        raise MissingError(f"{path}: the run directory cannot be locked: {error.strerror}; {ADVICE}") from None
    return RunDirectory(path, fd)


def _open_or_explain(path: Path) -> int:
    try:
        return make_own(path)
    except OSError as error:
        raise MissingError(f"{path}: the run directory cannot be created: {error.strerror}") from None
    except MissingError as error:
        raise MissingError(f"{error}; or {ADVICE}") from None


def find_daemon(run_dir: str | None = None) -> DaemonInfo:
    """The daemon of a run directory, or the only daemon of this user.  Raises MissingError if none runs."""
    if run_dir:
        info = _read(Path(run_dir))
        if info is None:
            raise MissingError(f"{run_dir}: no daemon is running there; start it with: fti run CONFIG")
        return info
    running = [info for info in map(_read, _candidates()) if info]
    if not running:
        raise MissingError("no daemon is running; start one with: fti run CONFIG")
    if len(running) > 1:
        names = ", ".join(str(Path(info.sock).parent) for info in running)
        raise MissingError(f"several daemons are running; choose one with --run-dir: {names}")
    return running[0]


def connect(path: Path, timeout_s: float) -> socket.socket:
    """Connect to a socket in a run directory.

    Raises MissingError when the directory or the listening process belongs to another user (other than root), OSError
    when no process listens.
    """
    with _opened(path.parent) as fd:
        sock = socket.socket(socket.AF_UNIX)
        try:
            sock.settimeout(timeout_s)
            sock.connect(path_within(fd, path.name))
            if not (peer := Peer.from_socket(sock)).is_trusted:
                raise MissingError(f"{path}: the socket belongs to {peer}, another user; {ADVICE}")
        except BaseException:
            sock.close()
            raise
        return sock


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[int]:
    fd = open_own(path)
    try:
        yield fd
    finally:
        os.close(fd)


def _candidates() -> list[Path]:
    """The run directories of this user, in order."""
    try:
        with _opened(base()) as fd, os.scandir(fd) as entries:
            return [base() / entry.name for entry in sorted(entries, key=lambda entry: entry.name) if entry.is_dir()]
    except OSError:
        return []


def _read(path: Path) -> DaemonInfo | None:
    """The published information of the daemon in a directory; None if no daemon runs there."""
    try:
        with _opened(path) as fd:
            return DaemonInfo(**json.loads(read_file(fd, INFO))) if _is_taken(fd) else None
    except (OSError, ValueError, TypeError):
        return None


def _is_taken(fd: int) -> bool:
    """A daemon has locked the directory.  The lock is only queried: taking it could fail a daemon that starts."""
    question = _LOCK.pack(fcntl.F_WRLCK, os.SEEK_SET, 0, 0, 0)
    found: int = _LOCK.unpack(fcntl.fcntl(fd, fcntl.F_OFD_GETLK, question))[0]
    return found != fcntl.F_UNLCK
