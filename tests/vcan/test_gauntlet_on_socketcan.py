"""The gauntlet on CAN buses of the kernel: emulator, daemon and score in one start of the user-mode kernel."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.heartbeat import run_undisturbed
from tests.helpers import ROOT
from tests.vcan.conftest import EXIT_NOT_INSTALLED, vm_command

pytestmark = [pytest.mark.e2e, pytest.mark.alone, pytest.mark.socketcan, pytest.mark.timeout(4500)]


def test_the_daemon_reports_what_the_scenario_expects(tmp_path: Path) -> None:
    def fly(attempt: int) -> dict[str, Any]:
        folder = tmp_path / str(attempt)
        folder.mkdir()
        command = vm_command("tests.vcan.probe_gauntlet", folder)
        roomy = {**os.environ, "UML_TIMEOUT": "1400", "UML_MEM": "2G"}
        done = subprocess.run(command, check=False, cwd=ROOT, capture_output=True, text=True, timeout=1450, env=roomy)
        if done.returncode == EXIT_NOT_INSTALLED:
            pytest.skip(done.stderr.strip())
        assert done.returncode == 0, done.stdout + done.stderr
        content: dict[str, Any] = json.loads((folder / "found.json").read_text())
        return content

    content = run_undisturbed(fly, lambda content: bool(content["code"] == 0))
    assert content["code"] == 0, content["said"]
    assert "holds: " in content["said"]
    assert all(count > 500 for count in content["frames"].values())
