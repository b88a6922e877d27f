"""Progress of one pytest process, for ``tests.run``: a file that says how far it is, renewed every second.

A pytest plugin, loaded with ``-p tests.progress --progress FILE``.  The times of the test files of an earlier run are
the weights; the longest files run first.
"""

from __future__ import annotations

import collections
import functools
import json
import time
from pathlib import Path
from typing import TypedDict

import pytest

from tests.helpers import ROOT

TIMES = ROOT / "tests" / "times.json"
#: Of a file that is not in the table [s].
UNKNOWN_FILE_S = 2.0
PERIOD_S = 1.0


class State(TypedDict):
    """Ended tests, of how many; their expected time [s], of how much; names of failed ones; time of each file [s]."""

    ended: int
    count: int
    ended_s: float
    count_s: float
    failed: list[str]
    files: dict[str, float]


@functools.cache
def known_times() -> dict[str, float]:
    """Seconds of each test file, by its path."""
    return dict(json.loads(TIMES.read_text())) if TIMES.exists() else {}


def expected_s(file: str) -> float:
    """Time of a test file in an earlier run [s]."""
    return known_times().get(file, UNKNOWN_FILE_S)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--progress", type=Path, help="file for the progress of this process")


def pytest_configure(config: pytest.Config) -> None:
    if file := config.getoption("--progress"):
        config.pluginmanager.register(Progress(file, config.rootpath))


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Longest files first; the tests of a file keep their order."""
    items.sort(key=lambda item: -expected_s(file_of(item.nodeid)))


def file_of(nodeid: str) -> str:
    """Path of the file of a test."""
    return nodeid.split("::", maxsplit=1)[0]


class Progress:
    """Writes the state of this process."""

    def __init__(self, file: Path, root: Path) -> None:
        self._file, self._root = file, root
        self._weights: dict[str, float] = {}
        files: dict[str, float] = collections.defaultdict(float)
        self._state = State(ended=0, count=0, ended_s=0.0, count_s=0.0, failed=[], files=files)
        self._written = 0.0

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        counts = collections.Counter(file_of(item.nodeid) for item in session.items)
        self._weights = {file: expected_s(file) / count for file, count in counts.items()}
        self._state["count"] = len(session.items)
        self._state["count_s"] = sum(map(expected_s, counts))
        self._write()

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self._note_failure(report.nodeid)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._state["files"][file_of(report.nodeid)] += report.duration
        if report.failed:
            self._note_failure(report.nodeid)
        if report.when == "teardown":
            self._state["ended"] += 1
            self._state["ended_s"] += self._weights.get(file_of(report.nodeid), 0.0)
            if time.monotonic() - self._written >= PERIOD_S:
                self._write()

    def pytest_sessionfinish(self) -> None:
        self._write()

    def _note_failure(self, nodeid: str) -> None:
        name = f"{self._root}/{nodeid}"
        if name not in self._state["failed"]:
            self._state["failed"].append(name)

    def _write(self) -> None:
        """In one step, so that a reader finds a whole text."""
        draft = self._file.with_suffix(".draft")
        draft.write_text(json.dumps(self._state))
        draft.replace(self._file)
        self._written = time.monotonic()
