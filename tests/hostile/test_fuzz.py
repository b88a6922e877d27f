"""Every command that reads files, with every kind of damage: an error message, never a traceback or excessive memory.

Quick: some 60 pairs, each command and many kinds at least once; ``--scale full``: 2640 pairs.
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from itertools import cycle
from pathlib import Path
from typing import Any

import pytest

from tests.helpers import ROOT
from tests.hostile.commands import FILE_COMMANDS, SESSION_COMMANDS
from tests.hostile.damage import DAMAGES
from tests.hostile.files import FILE_DAMAGES

Pair = tuple[str, Any, int]
SESSION_PAIRS, FILE_PAIRS = 42, 18
#: Of each process; the libraries of all commands together take two fifths of it [kB].
MAX_PEAK_KB = 800 * 1024
MAX_LINES = 8
FULL_TIMES = 40


def _pairs(count: int, rng: random.Random, commands: list[Any], damages: list[str], seed: int) -> list[Pair]:
    """So many pairs, in which commands and damages take turns."""
    rng.shuffle(damages)
    return [(damage, command, seed) for damage, command, _ in zip(cycle(damages), cycle(commands), range(count))]


def session_pairs(times: int) -> list[Pair]:
    rng, found = random.Random(14), list[Pair]()
    for seed in range(times):
        found += _pairs(SESSION_PAIRS, rng, list(SESSION_COMMANDS), list(DAMAGES), seed)
    return found


def file_pairs(times: int) -> list[Pair]:
    rng, found = random.Random(14), list[Pair]()
    for seed in range(times):
        for kind, commands in FILE_COMMANDS.items():
            names = [f"{kind}: {name}" for name in FILE_DAMAGES[kind]]
            found += _pairs(-(-FILE_PAIRS // len(FILE_COMMANDS)), rng, list(range(len(commands))), names, seed)
    return found


def run(pairs: list[Pair], folder: Path) -> tuple[list[dict[str, Any]], int]:
    """What became of each pair, and the peak of memory [kB]."""
    process = subprocess.run(
        [sys.executable, "-m", "tests.hostile.worker", str(folder)],
        input="\n".join(map(json.dumps, pairs)),
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        check=False,
    )
    assert process.returncode == 0, process.stderr[-3000:]
    *results, peak = map(json.loads, process.stdout.splitlines())
    assert len(results) == len(pairs)
    return results, peak


@pytest.mark.parametrize("make", [session_pairs, file_pairs])
@pytest.mark.timeout(3600)
def test_no_file_ends_a_command_in_a_traceback(make: Any, scale: int, tmp_path: Path) -> None:
    results, peak = run(make(FULL_TIMES if scale > 1 else 1), tmp_path)
    unexpected = [result for result in results if result["traceback"] or result["code"] not in (0, 1, 2, 3)]
    assert not unexpected, "\n".join(f"{one['pair']}: {one['code']} {one['traceback'][-600:]}" for one in unexpected)
    for one in results:
        assert "Traceback" not in one["stderr"], one
        assert one["stderr"].count("\n") <= MAX_LINES, one
        assert one["code"] in (0, 1) or one["stderr"], f"{one['pair']}: {one['code']} without a sentence"
    assert peak < MAX_PEAK_KB
