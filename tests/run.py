"""Every test, as ``make test`` runs it on two cores; with ``--quick`` the fast ones, in a minute.

    python -m tests.run [--quick] [--save-times]

Each part runs in several pytest processes. Each of them collects only its own files, which are shared out by the times
of an earlier run (``tests/times.json``).  The quick tests wait for conditions and never for a time: while one waits for
a process of its own, others continue.  The flights and a replay take minutes of real time and less than a core.  They
are judged by the time at which things happen, so they run apart from the quick tests: beside those, ptys and disks
stood still for a second now and then, which a score cannot tell from a device.  Then come the end-to-end tests that
wait most of the time, three at a time; then those that judge moments or need both cores, one after another.

A few tests that fail beside others are run again alone: a machine that stands still for a moment is not a defect.
Their names are printed; one that fails beside others often has a race, in the test or in the product.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from tests.helpers import KERNELS, ROOT
from tests.progress import TIMES, State, expected_s

PYTEST = [sys.executable, "-m", "pytest", "-q", "-o", "console_output_style=classic", "-p", "tests.progress"]
#: Once, before several processes would do it side by side.
WARM_UP = """
from fti import config
from fti.nav.inertial import strapdown
from fti.service.navigation.kernel_compiler import ensure_kernels_compiled
from tests.terrain_kernels import warm_up

warm_up(), strapdown.warm_up(), ensure_kernels_compiled(config.load("configs/demo.toml"))
"""
PASSED, FAILED, INTERRUPTED, NO_TESTS = 0, 1, 130, 5
#: So many failed tests of a part are run again; of the flights, which two tests judge each, twice as many.
MAX_RETRIES = 3
PRINT_PERIOD_S, POLL_S = 10.0, 0.2
#: Expected time of the tests of ``--quick`` on two workers [s].
QUICK_S = 30.0
NICE = -5  # of flights and replays; only root may have it below 0


@dataclass(frozen=True, slots=True)
class Part:
    """Some of the tests.

    files : paths or names of tests, relative to the root; workers : processes at a time; nice : their priority
    retries : so many failed tests are run again alone
    """

    title: str
    files: tuple[str, ...]
    markers: str = ""
    workers: int = 1
    nice: int = 0
    retries: int = MAX_RETRIES


# ------------------------------------------------------------------------------------------------------ which tests


def test_files() -> list[str]:
    return sorted(str(file.relative_to(ROOT)) for file in (ROOT / "tests").rglob("test_*.py"))


def marked(marker: str, *, wholly: bool = False) -> list[str]:
    """Files that have tests with a marker; wholly : all of their tests have it."""
    pattern = rf"^pytestmark = .*mark\.{marker}\b" if wholly else rf"mark\.{marker}\b"
    return [file for file in test_files() if re.search(pattern, (ROOT / file).read_text(), re.MULTILINE)]


def quick_files() -> list[str]:
    """Files that have tests which are not end-to-end tests."""
    return sorted({*test_files()} - {*marked("e2e", wholly=True)})


def parts() -> list[list[Part]]:
    """All parts; those of one list run at the same time."""
    waiting = "e2e and not flight and not replay and not alone"
    return [
        [Part("quick tests", tuple(quick_files()), "not e2e", workers=4)],
        [
            Part("flights", tuple(marked("flight")), "flight", nice=NICE, retries=2 * MAX_RETRIES),
            Part("replays", tuple(marked("replay")), "replay", nice=NICE),
        ],
        [Part("end-to-end tests", tuple(marked("e2e")), waiting, workers=3)],
        [Part("tests that run alone", tuple(marked("alone")), "alone", retries=0)],
    ]


def fast_part() -> Part:
    """As many files as the limit of time allows, the fastest first."""
    files = sorted(quick_files(), key=expected_s)
    sums = itertools.accumulate(map(expected_s, files))
    chosen = [file for file, total in zip(files, sums, strict=True) if total <= 2 * QUICK_S]
    return Part(f"fast tests ({len(chosen)} of {len(files)} files)", tuple(chosen), "not e2e", workers=2)


def share_out(files: Sequence[str], workers: int) -> list[list[str]]:
    """Files of each worker: the longest first, each to the worker that has least so far."""
    shares: list[list[str]] = [[] for _ in range(workers)]
    loads = [0.0] * workers
    for file in sorted(files, key=expected_s, reverse=True):
        worker = loads.index(min(loads))
        shares[worker].append(file)
        loads[worker] += expected_s(file)
    return [share for share in shares if share]


# ------------------------------------------------------------------------------------------------------- one part


class Worker:
    """A pytest process, with its output and its state in files."""

    def __init__(self, arguments: Sequence[str], folder: Path, nice: int) -> None:
        self._output, self._progress = folder / "output.txt", folder / "progress.json"
        folder.mkdir()
        with self._output.open("wb") as stream:
            self.process = subprocess.Popen(
                [*PYTEST, *arguments, "-p", "no:cacheprovider", "--progress", str(self._progress)],
                cwd=ROOT,
                stdout=stream,
                stderr=subprocess.STDOUT,
            )
        with contextlib.suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, self.process.pid, nice)

    def state(self) -> State:
        if self._progress.exists():
            result: State = json.loads(self._progress.read_text())
            return result
        return State(ended=0, count=0, ended_s=0.0, count_s=0.0, failed=[], files={})

    def print_output(self) -> None:
        """All of it after a failure, otherwise the last line."""
        text = self._output.read_text(errors="replace").rstrip()
        if self.process.returncode in (PASSED, NO_TESTS):
            text = text.rpartition("\n")[2]
        print(text, flush=True)


def run_part(part: Part) -> int:
    """Run a part, print its progress, run a few failed tests again alone; returns the exit code."""
    begin = time.monotonic()
    print(f"== {part.title}: {len(part.files)} files, processes: {part.workers}", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        shares = share_out(part.files, part.workers)
        options = ("-m", part.markers) if part.markers else ()
        workers = [Worker((*options, *files), Path(folder, str(n)), part.nice) for n, files in enumerate(shares)]
        _wait(part.title, workers, begin)
        codes = {worker.process.returncode for worker in workers} - {PASSED, NO_TESTS}
        for worker in workers:
            worker.print_output()
        failed = sorted(nodeid for worker in workers for nodeid in worker.state()["failed"])
        _note_times({file: s for worker in workers for file, s in worker.state()["files"].items()})
    print(f"== {part.title}: {_minutes(time.monotonic() - begin)}, {len(failed)} failed", flush=True)
    if codes == {FAILED} and 0 < len(failed) <= part.retries:
        return _retry(part, failed)
    return max(codes, default=PASSED)


def _retry(part: Part, failed: list[str]) -> int:
    code = run_part(Part(f"{part.title} that failed, alone", tuple(failed), part.markers, retries=0))
    names = [nodeid.removeprefix(f"{ROOT}/") for nodeid in failed]
    if code == PASSED:
        print(f"== {part.title}: these failed beside others and passed alone: {', '.join(names)}", flush=True)
    return code


def _wait(title: str, workers: Sequence[Worker], begin: float) -> None:
    printed = begin
    while any(worker.process.poll() is None for worker in workers):
        time.sleep(POLL_S)
        if time.monotonic() - printed >= PRINT_PERIOD_S:
            printed = time.monotonic()
            print(_progress(title, [worker.state() for worker in workers], printed - begin), flush=True)


def _progress(title: str, states: Sequence[State], elapsed_s: float) -> str:
    ended, count, failed = (sum(sizes) for sizes in zip(*map(_sizes, states), strict=True))
    share = sum(s["ended_s"] for s in states) / max(sum(s["count_s"] for s in states), 1e-9)
    left = f", about {_minutes(elapsed_s / share - elapsed_s)} left" if share > 0.02 else ""
    return f"   {title}: {ended} of {count} tests, {share:.0%}, {_minutes(elapsed_s)}{left}, {failed} failed"


def _sizes(state: State) -> tuple[int, int, int]:
    return state["ended"], state["count"], len(state["failed"])


def _minutes(seconds: float) -> str:
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


# ------------------------------------------------------------------------------------------------------- everything

_times: dict[str, float] = {}


def _note_times(values: dict[str, float]) -> None:
    """For a file with tests in two parts the longer time."""
    _times.update({file: max(seconds, _times.get(file, 0.0)) for file, seconds in values.items()})


def main() -> int:
    """Every part runs, unless the run is interrupted; the first failure is the exit code."""
    parser = argparse.ArgumentParser(description="Run the tests.")
    parser.add_argument("--quick", action="store_true", help="the fast tests only, in about a minute")
    parser.add_argument("--save-times", action="store_true", help="renew tests/times.json, on a calm machine")
    arguments = parser.parse_args()
    interrupts: list[int] = []  # every process of the group gets the signal; each ends in good order
    signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # tests side by side use the processors already
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # each of thousands of processes would compile what it imports
    os.environ.setdefault("NUMBA_CACHE_DIR", str(KERNELS))
    print("== compiled kernels", flush=True)
    subprocess.run([sys.executable, "-c", WARM_UP], cwd=ROOT, check=False)
    codes = [run_at_once(step) for step in ([[fast_part()]] if arguments.quick else parts()) if not interrupts]
    if arguments.save_times:
        TIMES.write_text(json.dumps({k: round(v, 1) for k, v in sorted(_times.items())}, indent=0) + "\n")
    return INTERRUPTED if interrupts else next((code for code in codes if code), PASSED)


def run_at_once(step: Sequence[Part]) -> int:
    """Parts at the same time; the first failure is the exit code."""
    with ThreadPoolExecutor(len(step)) as pool:
        return next((code for code in pool.map(run_part, step) if code), PASSED)


if __name__ == "__main__":
    sys.exit(main())
