"""The set-up of ``.venv`` shows its progress, and what pip warns of."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.helpers import ROOT, TIMEOUT_S

LOCK = """
numpy==2.2 \\
    --hash=sha256:0
pywin32==3 ; sys_platform == "win32" \\
    --hash=sha256:0
rich==14 \\
    --hash=sha256:0
"""
#: Takes the place of pip: it prints what pip 24 prints, and waits for a file before it goes on.
PIP = """
import pathlib, sys, time
def wait(name):
    while not pathlib.Path(name).exists():
        time.sleep(0.01)
warn = "WARNING: Location 'file:///mirror/simple/rich/' is ignored: it is neither a file nor a directory."
print(warn, "WARNING: Retrying after connection broken", sep="\\n", file=sys.stderr)
print("Ignoring pywin32: markers 'sys_platform == \\"win32\\"' don't match your environment")
print("Collecting numpy==2.2 (from -r requirements.lock (line 2))", flush=True)
wait("fetched")
print("Collecting rich==14 (from -r requirements.lock (line 6))")
print("Installing collected packages: numpy, rich", flush=True)
site = pathlib.Path("env/lib/python3.11/site-packages")
(site / "numpy-2.2.dist-info").mkdir(parents=True)
wait("installed")
print("ERROR: Could not install packages due to an OSError: No space left on device", file=sys.stderr)
sys.exit(int(sys.argv[-1] == "fails"))
"""


@contextlib.contextmanager
def set_up(folder: Path, *arguments: str) -> Iterator[tuple[int, subprocess.Popen[str]]]:
    """The set-up with that pip on a terminal: the person's end, and the process."""
    for name, text in {"requirements.lock": LOCK, "pip/__init__.py": "", "pip/__main__.py": PIP}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    person, terminal = os.openpty()
    script = str(ROOT / "packaging" / "pip_install.py")
    process = subprocess.Popen(
        [sys.executable, script, "env/bin/python", "--requirement", "requirements.lock", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        stdout=terminal,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    os.close(terminal)
    try:
        yield person, process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        os.close(person)


@pytest.mark.parametrize("code", [0, 1])
def test_the_set_up_shows_packages_and_errors(tmp_path: Path, code: int) -> None:
    with set_up(tmp_path, *["fails"] * code) as (person, process):
        read_until(person, "  fetching package 1 of 2, ")
        (tmp_path / "fetched").touch()
        read_until(person, "  installing package 1 of 2, ")
        (tmp_path / "installed").touch()
        _, errors = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == code
    assert [line.split(": ")[:2] for line in errors.splitlines()] == [
        ["WARNING", "Retrying after connection broken"],
        ["ERROR", "Could not install packages due to an OSError"],
    ]


def test_ctrl_c_ends_the_set_up(tmp_path: Path) -> None:
    with set_up(tmp_path) as (person, process):
        read_until(person, "  fetching package 1 of 2, ")
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(TIMEOUT_S) == 130


def read_until(person: int, text: str) -> None:
    printed, deadline = "", time.monotonic() + TIMEOUT_S
    while text not in printed:
        assert time.monotonic() < deadline, printed
        printed += os.read(person, 4096).decode()
