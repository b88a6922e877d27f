"""Pages of the documentation as tests execute them: consoles, files, and what the commands print."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from tests.helpers import ROOT

MARK = "@@ next command @@"


@dataclass(frozen=True)
class Console:
    """A console of a page: commands and their outputs."""

    commands: list[str]
    printed: list[str]


def blocks(page: str, kind: str) -> list[str]:
    """The blocks of a kind of code."""
    return re.findall(rf"^```{kind}\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)


def consoles(page: str) -> list[Console]:
    """All consoles of a page."""
    found = [re.split(r"^\$ (.*)\n", block, flags=re.MULTILINE)[1:] for block in blocks(page, "console")]
    return [Console(parts[::2], parts[1::2]) for parts in found]


def execute(console: Console, folder: Path, within_s: float) -> list[str]:
    """Output of each command, in one shell in the folder."""
    commands = f"\necho '{MARK}'\n".join(console.commands)
    functions = 'fti() { "$PYTHON" -m fti.cli.main "$@"; }\npython() { "$PYTHON" "$@"; }\n'
    script = f"{functions}{commands}\nwait\n"
    environment = {**os.environ, "PYTHON": sys.executable, "XDG_RUNTIME_DIR": str(folder), "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=within_s,
        check=False,
        text=True,
    )
    return done.stdout.split(f"{MARK}\n")


def compare(printed: str, expected: str) -> None:
    """Line by line; "..." is anything, within a line or, alone, any lines."""
    pattern = re.escape(expected).replace(r"\.\.\.", ".*?")
    assert re.fullmatch(pattern, printed, re.DOTALL), f"printed:\n{printed}\nthe page says:\n{expected}"
