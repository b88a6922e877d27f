"""Every test, as ``make test`` runs it on two cores.

    python -m tests.run

The quick tests wait for conditions and never for a time: while one waits for a process of its own, three others go on.
Behind them the flights and a replay, minutes of real time and less than a core, judge when things happen; beside the
quick tests ptys and media stood still for a second now and then, which no score can tell from a device. Then come the
end-to-end tests that wait most of the time, three at a time, file by file; then those that judge moments or need both
cores, one after another.  Only the files that have a marker are collected for it.

A few tests that fail beside others are run again alone: a machine that stands still for a moment is no defect.  Their
names are printed; one that fails beside others often has a race, in the test or in the product.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO

from tests.helpers import KERNELS, ROOT

PYTEST = [sys.executable, "-m", "pytest"]
QUICK, WAITING = ("-n", "4"), ("-n", "3", "--dist", "loadfile")
NICE = -5
#: Once, before five processes would do it side by side.
WARM_UP = """
from fti import config
from fti.nav.inertial import strapdown
from fti.service.navigation.kernel_compiler import compile_first
from fti.terrain import kernel_warmup

warm.warm_up(), strapdown.warm_up(), compile_first(config.load("configs/demo.toml"))
"""
INTERRUPTED = 130
#: Exit code of pytest when tests have failed; so many of them are run again at most.
FAILED, MAX_AGAIN = 1, 3


@dataclass(frozen=True, slots=True)
class Part:
    """Some of the tests.  arguments : of pytest; nice : only root may have it below 0, for others it is 0 then."""

    title: str
    arguments: tuple[str, ...]
    nice: int = 0

    def run(self, out: IO[bytes] | None = None) -> int:
        """Run it to its end, what it says into a file if there is one; returns the exit code."""
        begin = time.monotonic()
        told = subprocess.STDOUT if out else None
        print(f"== {self.title}: begins", flush=True)
        process = subprocess.Popen([*PYTEST, *self.arguments], cwd=ROOT, stdout=out, stderr=told)
        with contextlib.suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, process.pid, self.nice)
        code = process.wait()
        print(f"== {self.title}: {time.monotonic() - begin:.0f} s, exit code {code}", flush=True)
        return code


def run_with_retry(part: Part) -> int:
    """Run it; a few tests that fail are run again alone, and what they come to is the exit code."""
    with tempfile.TemporaryDirectory() as folder:
        part = replace(part, arguments=(*part.arguments, "-o", f"cache_dir={folder}"))
        code, names = part.run(), last_failed(Path(folder))
        if code != FAILED or not 0 < len(names) <= MAX_AGAIN:
            return code
        alone = (*part.arguments, "-n", "0", "--last-failed")
        again = replace(part, title=f"{part.title} that failed, alone", arguments=alone).run()
    if again == 0:
        print(f"== {part.title}: these failed beside others and passed alone: {', '.join(names)}", flush=True)
    return again


def last_failed(cache: Path) -> list[str]:
    """The tests that a run of pytest with this cache noted as failed."""
    file = cache / "v/cache/lastfailed"
    return sorted(json.loads(file.read_text())) if file.exists() else []


def files_with_marker(marker: str) -> list[str]:
    """Files that have tests with a marker."""
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    return [str(file.relative_to(ROOT)) for file in files if f"mark.{marker}" in file.read_text()]


def run_in_parallel(told: Part, *others: Part) -> list[int]:
    """Several parts at a time, the first as ``run_with_retry``; what the others say is printed in the end.

    Returns exit codes.
    """
    with contextlib.ExitStack() as stack:
        said = [stack.enter_context(tempfile.NamedTemporaryFile(suffix=".txt")) for _ in others]
        pool = stack.enter_context(ThreadPoolExecutor(len(others)))
        going_on = [pool.submit(other.run, file.file) for other, file in zip(others, said, strict=True)]
        codes = [run_with_retry(told), *(other.result() for other in going_on)]
        for file in said:
            print(Path(file.name).read_text(), flush=True)
    return codes


def main() -> int:
    """Every part happens, unless they are interrupted; the first failure is the exit code."""
    interrupts: list[int] = []  # every process of the group is told; each ends in good order
    signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # tests side by side have the processors already
    os.environ.setdefault("NUMBA_CACHE_DIR", str(KERNELS))
    print("== compiled kernels", flush=True)
    subprocess.run([sys.executable, "-c", WARM_UP], cwd=ROOT, check=False)
    quick = Part("quick tests", (*QUICK, "-m", "not e2e"))
    flights = Part("flights", ("-m", "flight", *files_with_marker("flight")), NICE)
    replays = Part("replays", ("-m", "replay", *files_with_marker("replay")), NICE)
    others = "e2e and not flight and not replay and not alone"
    together = Part("end to end", (*WAITING, "-m", others, *files_with_marker("e2e")))
    moments = Part("one after another", ("-m", "alone", *files_with_marker("alone")))
    steps: list[Callable[[], list[int]]] = [
        lambda: [run_with_retry(quick)],
        lambda: run_in_parallel(flights, replays),
        lambda: [run_with_retry(together)],
        lambda: [moments.run()],
    ]
    codes = [code for step in steps if not interrupts for code in step()]
    return INTERRUPTED if interrupts else next((code for code in codes if code), 0)


if __name__ == "__main__":
    sys.exit(main())
