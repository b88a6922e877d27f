"""Small files with very much data: no command needs more memory than for a large session."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers import ROOT
from tests.hostile.bombs import BOMBS, write
from tests.hostile.commands import SESSION_COMMANDS, filled

#: Of a process with everything that a command imports [MB].
MAX_PEAK_MB = 500
#: Each bomb with the command that took most, and what is said; in ``--scale full`` all commands.
PAIRS = (
    ("messages", "info", 3, "more than 524288 messages"),
    ("messages", "verify", 1, ""),
    ("zeros", "export", 3, "unpacks to"),
    ("declared", "verify", 1, ""),
    ("topics", "info", 3, "more than 4096 topics"),
    ("topics", "verify", 1, ""),
    ("topics", "recover", 3, "more than 4096 topics"),
    ("schemas", "recover", 3, "its schemas have more than"),
    ("long topics", "info", 3, "a topic has 100001 characters"),
    ("channel tables", "recover", 3, "channel records have more than"),
    ("long events", "info", 0, ""),
    ("columns", "export", 3, "more than 131072 columns"),
    ("lists", "export", 3, "at most 4194304 are read"),
    ("lengths", "sync", 3, "contains no configuration"),
    ("long name", "info", 3, "a field is longer than its record"),
    ("metadata", "info", 3, "its metadata have more than"),
    ("gap notes", "verify", 3, "more than 131072 notes of gaps"),
)
COMMANDS = ("info", "verify", "recover", "export", "sync", "compare", "pack", "score", "latency", "reprocess")
CHILD = """
import json, sys
from fti.cli.main import main
from tests.hostile.worker import peak_kb
code = main(json.loads(sys.argv[1]))
print(json.dumps([code, peak_kb() // 1024]))
"""


def run(bomb: str, command: str, folder: Path) -> tuple[int, int, str]:
    """Exit code, peak of memory [MB] and what was said."""
    out = folder / "out"
    out.mkdir(exist_ok=True)
    arguments = filled(SESSION_COMMANDS[command], {"SESSION": write(bomb, folder / "x"), "OUT": out})
    process = subprocess.run(
        [sys.executable, "-c", CHILD, json.dumps(arguments)],
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        check=False,
    )
    assert process.returncode == 0, process.stderr[-3000:]
    code, peak_mb = json.loads(process.stdout.splitlines()[-1])
    return code, peak_mb, process.stdout + process.stderr


@pytest.mark.parametrize(("bomb", "command", "code", "stated"), PAIRS)
def test_a_small_file_that_holds_very_much(bomb: str, command: str, code: int, stated: str, tmp_path: Path) -> None:
    found, peak_mb, printed = run(bomb, command, tmp_path)
    assert (found, peak_mb < MAX_PEAK_MB) == (code, True), (peak_mb, printed[-1000:])
    assert stated in printed


@pytest.mark.parametrize("bomb", BOMBS)
def test_every_command_over_every_one(bomb: str, scale: int, tmp_path: Path) -> None:
    for number, command in enumerate(COMMANDS if scale > 1 else ()):
        folder = tmp_path / str(number)
        folder.mkdir()
        code, peak_mb, printed = run(bomb, command, folder)
        assert code in (0, 1, 2, 3), printed
        assert peak_mb < MAX_PEAK_MB, (command, peak_mb)
