"""The wheel, built once; and how a test runs what builds and installs it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.helpers import ROOT

Build = Callable[..., str]
TIMEOUT_S = 1200.0  # downloads and compresses half a gigabyte beside other tests


@pytest.fixture(scope="session")
def build() -> Build:
    """Run a command that must succeed; returns its output."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

    def run(*command: str | Path) -> str:
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
        assert done.returncode == 0, f"{command}:\n{done.stdout}{done.stderr}"
        return done.stdout

    return run


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory, build: Build) -> Path:
    """The wheel, built from the source archive."""
    *_, path = build(
        sys.executable, ROOT / "packaging" / "build_wheel.py", tmp_path_factory.mktemp("dist")
    ).splitlines()
    return Path(path)
