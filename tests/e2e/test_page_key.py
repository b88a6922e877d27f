"""The key of the page: printed to a terminal, and where no other user can read it."""

from __future__ import annotations

import contextlib
import os
import signal
import stat
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.harness import FTI, Daemon
from tests.processes import children_of

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(300)]

CONFIG = '[session]\nname = "key"\ndirectory = "out"\nmin_free_mb = 10\n[display]\nport = 0\n'


@contextlib.contextmanager
def daemon_on(stdout: int, folder: Path) -> Iterator[Daemon]:
    """A daemon that prints there."""
    (folder / "key.toml").write_text(CONFIG)
    command = [*FTI, "run", str(folder / "key.toml"), "--out", str(folder), "--run-dir", str(folder / "run")]
    process = subprocess.Popen(command, stdout=stdout, text=True)
    try:
        yield Daemon(process, folder / "run")
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(120)


def read_until(fd: int, end: bytes) -> str:
    """What is printed, until a line has come that begins so."""
    data = b""
    while (b"\n" + end) not in b"\n" + data or not data.endswith(b"\n"):
        data += os.read(fd, 4096)
    return data.decode().replace("\r\n", "\n")


def test_a_terminal_gets_the_key_and_nobody_else(tmp_path: Path) -> None:
    terminal, end = os.openpty()
    try:
        with daemon_on(end, tmp_path) as running:
            key = running.page.partition("#key=")[2]
            assert f"display at {running.page}\n" in read_until(terminal, b"display at ")
            assert running.page == f"{running.display}#key={key}"
            assert is_hidden(key, running)
            modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in running.run_dir.iterdir()}
            assert modes == dict.fromkeys(("bus.sock", "fti.json", "fti.sock", "page.html"), 0o600)
    finally:
        os.close(terminal)
        os.close(end)
    assert not list((tmp_path / "run").iterdir())
    assert not [path for path in tmp_path.rglob("*") if path.is_file() and key.encode() in path.read_bytes()]


def test_a_pipe_gets_the_address_alone(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    try:
        with daemon_on(writer, tmp_path) as running:
            assert f"display at {running.display}\n" in read_until(reader, b"display at ")
    finally:
        os.close(reader)
        os.close(writer)


def is_hidden(key: str, running: Daemon) -> bool:
    """No process of the daemon has the key on its command line or in its environment."""
    pids = [running.process.pid, *children_of(running.process.pid)]
    data = b"".join((Path(f"/proc/{pid}") / name).read_bytes() for pid in pids for name in ("cmdline", "environ"))
    return b"fti.service.display" in data and len(key) >= 43 and key.encode() not in data
