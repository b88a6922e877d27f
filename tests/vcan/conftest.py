"""One start of the user-mode kernel for all tests on real SocketCAN: it costs as much as what runs in it."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.helpers import KERNELS, ROOT

RUNNER = ROOT / "tests" / "vcan" / "run"
EXIT_NOT_INSTALLED = 77


def vm_command(module: str, out: Path, target: str = "found.json") -> list[str]:
    """The command that runs a module inside, which writes the target, a file or folder in ``out``.

    It has the kernels that were compiled outside, where it can write: numba takes none from elsewhere, and to compile
    them takes most of a minute inside.
    """
    cache = out / "kernels"
    if KERNELS.is_dir():
        shutil.copytree(KERNELS, cache)
    return [str(RUNNER), str(out), "env", f"NUMBA_CACHE_DIR={cache}", sys.executable, "-m", module, str(out / target)]


@pytest.fixture(scope="session")
def vm_results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the probes saw inside, by probe."""
    out = tmp_path_factory.mktemp("vcan")
    done = subprocess.run(
        vm_command("tests.vcan.probe", out), check=False, cwd=ROOT, capture_output=True, text=True, timeout=100
    )
    if done.returncode == EXIT_NOT_INSTALLED:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stdout + done.stderr
    result: dict[str, Any] = json.loads((out / "found.json").read_text())
    return result
