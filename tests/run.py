"""Every test, as ``make test`` runs it on two cores.

    python -m tests.run

The flights take minutes of real time and less than a core; they judge when things happen.  So they go on beside the
quick tests, which wait for conditions and never for a time, and which give way to them (nice; as root, other work on
the machine does, too).  Then come the end-to-end tests that wait most of the time, two at a time, file by file; then
those that judge moments or need both cores, one after another.  Only the files that have a marker are collected for it.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.helpers import KERNELS, ROOT

PYTEST = [sys.executable, "-m", "pytest"]
TWO_AT_A_TIME = ["-n", "2"]
GIVING_WAY = ["nice", "-n", "5"]
FIRST = -5
#: Once, before five processes would do it side by side.
WARM_UP = """
from fti import config
from fti.nav.inertial import strapdown
from fti.service.compiling import compile_first
from fti.terrain import warm

warm.warm_up(), strapdown.warm_up(), compile_first(config.load("configs/demo.toml"))
"""
INTERRUPTED = 130


def marked(marker: str) -> list[str]:
    """Files that have tests with a marker."""
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    return [str(file.relative_to(ROOT)) for file in files if f"mark.{marker}" in file.read_text()]


def run(title: str, *command: str) -> int:
    """Run a part to its end; returns the exit code."""
    print(f"== {title}", flush=True)
    return subprocess.run(command, cwd=ROOT, check=False).returncode


def main() -> int:
    """Every part happens, unless they are interrupted; the first failure is the exit code."""
    interrupts: list[int] = []  # every process of the group is told; each ends in good order
    signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # two tests at a time have the processors already
    os.environ.setdefault("NUMBA_CACHE_DIR", str(KERNELS))
    run("compiled kernels", sys.executable, "-c", WARM_UP)
    with tempfile.NamedTemporaryFile(suffix=".txt") as said:
        flights = subprocess.Popen(
            [*PYTEST, "-m", "flight", *marked("flight")], cwd=ROOT, stdout=said, stderr=subprocess.STDOUT
        )
        with contextlib.suppress(PermissionError):  # only root may prefer something
            os.setpriority(os.PRIO_PROCESS, flights.pid, FIRST)
        codes = [run("quick tests, and flights beside them", *GIVING_WAY, *PYTEST, *TWO_AT_A_TIME, "-m", "not e2e")]
        codes.append(flights.wait())
        print("== flights", Path(said.name).read_text(), sep="\n", flush=True)
    together = ["-m", "e2e and not flight and not alone", *TWO_AT_A_TIME, "--dist", "loadfile", *marked("e2e")]
    for title, arguments in (("end to end", together), ("one after another", ["-m", "alone", *marked("alone")])):
        if not interrupts:
            codes.append(run(title, *PYTEST, *arguments))
    return INTERRUPTED if interrupts else next((code for code in codes if code), 0)


if __name__ == "__main__":
    sys.exit(main())
