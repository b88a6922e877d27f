"""One start of the user-mode kernel for all tests on real SocketCAN: it costs as much as what runs in it."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest

from tests.helpers import ROOT

RUNNER = ROOT / "tests" / "vcan" / "run"
NOT_INSTALLED = 77


@pytest.fixture(scope="session")
def inside(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the probes saw inside, by probe."""
    out = tmp_path_factory.mktemp("vcan")
    command = [str(RUNNER), str(out), sys.executable, "-m", "tests.vcan.probe", str(out / "found.json")]
    done = subprocess.run(command, check=False, cwd=ROOT, capture_output=True, text=True, timeout=100)
    if done.returncode == NOT_INSTALLED:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stdout + done.stderr
    result: dict[str, Any] = json.loads((out / "found.json").read_text())
    return result
