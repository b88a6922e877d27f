"""``make`` alone lists the targets; ``make demo`` ends without an error when Ctrl-C ends the demonstration."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.helpers import ROOT


def make(folder: Path, *targets: str) -> subprocess.CompletedProcess[str]:
    # the tests may be called by make: what it hands to a make below it makes that one print its folder
    env = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    return subprocess.run(
        ["make", *targets], cwd=folder, env=env, capture_output=True, text=True, check=False, timeout=60
    )


def test_make_lists_every_target_in_one_line_each(tmp_path: Path) -> None:
    text = Path(shutil.copy(ROOT / "Makefile", tmp_path)).read_text()
    listed = [line.split()[:2] for line in make(tmp_path).stdout.splitlines()]
    phony = re.search(r"^\.PHONY: help (.+)$", text, re.MULTILINE)
    assert phony and listed == [["make", target] for target in phony[1].split()]


@pytest.mark.parametrize(("code", "holds"), [(0, True), (130, True), (2, False)])
def test_an_interrupted_demonstration_is_no_error_of_make(tmp_path: Path, code: int, holds: bool) -> None:
    shutil.copy(ROOT / "Makefile", tmp_path)
    for name in ("requirements.lock", "pyproject.toml", ".venv/bin/fti", ".venv/.installed"):  # the last is the newest
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f'#!/bin/sh\n[ "$*" = demo ] && exit {code}\n')
        file.chmod(0o755)
    done = make(tmp_path, "demo")
    assert (done.returncode == 0) == holds, done.stderr
