"""Type=notify: systemd is notified when bytes are being recorded, and not before."""

from __future__ import annotations

import os
import socket
import subprocess
from pathlib import Path

import pytest

from tests.e2e.harness import FTI

pytestmark = pytest.mark.timeout(900)
CONFIG = """
[session]
name = "notified"
directory = "out"
min_free_mb = 10

[display]
enabled = false
"""


def test_ready_means_recording(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(CONFIG)
    address = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(address))
        listener.settimeout(30)
        arguments = ["run", str(tmp_path / "c.toml"), "--duration", "1", "--run-dir", str(tmp_path / "run")]
        environment = {**os.environ, "NOTIFY_SOCKET": str(address)}
        with subprocess.Popen([*FTI, *arguments], env=environment, stdout=subprocess.PIPE, text=True) as daemon:
            assert listener.recv(100) == b"READY=1"
            assert list((tmp_path / "out").glob("notified_*/*_000.mcap"))
            daemon.communicate(timeout=120)
            assert daemon.returncode == 0
