#!/usr/bin/env python3
"""Run pip install, and show its progress:  python packaging/pip_install.py PYTHON [OPTION] ... REQUIREMENT ...

Installs for the interpreter PYTHON.  On a terminal one line is updated; elsewhere there is a line every ten seconds.
Warnings and errors of pip are printed, without those about package indexes that do not exist.
"""

import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

PERIOD_S = 10.0
REFRESH_S = 0.2
#: Exit code after Ctrl-C.
INTERRUPTED = 130
CLEAR = "\033[K"
IRRELEVANT = re.compile(r"WARNING: Location '.*' is ignored")


class Progress:
    """What pip has done so far.  environment : the folder that it installs into; total : packages, 0 if unknown"""

    def __init__(self, environment: Path, total: int) -> None:
        self._environment, self._total = environment, total
        self._begin_s, self._present = time.monotonic(), self._count_installed()
        self._found = self._ignored = 0
        self._is_installing = False

    def on_line(self, line: str) -> None:
        """A line of pip's output."""
        self._ignored += line.startswith("Ignoring ")  # for another Python or system
        self._found += line.startswith(("Collecting ", "Requirement already satisfied"))
        self._is_installing |= line.startswith("Installing collected packages")

    def describe(self) -> str:
        """The step, how far it is, and the time since the begin."""
        step, count = ("fetching", self._found) if not self._is_installing else ("installing", self._installed())
        of = f" package {count} of {self._total - self._ignored}" if self._total else ""
        return f"  {step}{of}, {time.monotonic() - self._begin_s:.0f} s"

    def _installed(self) -> int:
        return min(self._count_installed() - self._present, self._total - self._ignored)

    def _count_installed(self) -> int:
        return sum(1 for _ in self._environment.glob("lib/python*/site-packages/*.dist-info"))


def count_packages(arguments: list[str]) -> int:
    """Packages in the locked requirements among the arguments."""
    files = [Path(name) for option, name in pairwise(arguments) if option == "--requirement"]
    return sum(len(re.findall(r"^\S+==", file.read_text(), re.MULTILINE)) for file in files)


def show(progress: Progress, ended: threading.Event) -> None:
    """Show the progress until the end."""
    period_s, line = (REFRESH_S, f"\r{{}}{CLEAR}") if sys.stdout.isatty() else (PERIOD_S, "{}\n")
    while not ended.wait(period_s):
        print(line.format(progress.describe()), end="", flush=True)
    clear_line()


def clear_line() -> None:
    """Clear the line of the progress on a terminal."""
    if sys.stdout.isatty():
        print(f"\r{CLEAR}", end="", flush=True)


def pass_errors(lines: Iterable[str]) -> None:
    """Print what pip writes to standard error."""
    for line in lines:
        if not IRRELEVANT.match(line):
            clear_line()
            print(line, end="", file=sys.stderr, flush=True)


def main() -> int:
    """Run pip; returns its exit code."""
    python, *arguments = sys.argv[1:]
    options = ["--python", python, "--disable-pip-version-check", "install", "--root-user-action", "ignore"]
    command = [sys.executable, "-m", "pip", *options, "--progress-bar", "off", *arguments]
    progress, ended = Progress(Path(python).parent.parent, count_packages(arguments)), threading.Event()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as pip:
        threads = [
            threading.Thread(target=show, args=(progress, ended)),
            threading.Thread(target=pass_errors, args=(pip.stderr,)),
        ]
        for thread in threads:
            thread.start()
        try:
            for line in pip.stdout or ():
                progress.on_line(line)
        except KeyboardInterrupt:
            pip.terminate()  # it has got Ctrl-C, too, if that came from the terminal
            return INTERRUPTED
        finally:
            ended.set()
            for thread in threads:
                thread.join()
    return pip.returncode


if __name__ == "__main__":
    sys.exit(main())
