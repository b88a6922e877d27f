"""What holds for every test: its scale, no skips in the checks of a change, and nothing left behind."""

from __future__ import annotations

import asyncio
import gc
import inspect
import os
import time
from collections.abc import AsyncIterator, Generator

import hypothesis
import pytest

from tests.helpers import KERNELS, POLL_S
from tests.leaks import open_resources

SCALES = {"quick": 1, "full": 20}
EXAMPLES = {"quick": 60, "full": 2000}  # of a property
GRACE_S = 3.0  # what was told to end may take this long

os.environ.setdefault("FTI_TRACEBACK", "1")  # no test takes an error that nobody expects for a sentence
os.environ.setdefault("NUMBA_CACHE_DIR", str(KERNELS))  # also for the processes that tests start

before_key = pytest.StashKey[dict[str, str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--scale", choices=sorted(SCALES), default="quick", help="how many runs statistical tests do")
    parser.addoption("--no-skips", action="store_true", help="a skipped test is a failure")


def pytest_configure(config: pytest.Config) -> None:
    hypothesis.settings.register_profile(
        "fti",
        max_examples=EXAMPLES[config.getoption("--scale")],
        deadline=None,  # no timed assertion: this may be a busy machine
        suppress_health_check=[hypothesis.HealthCheck.too_slow],
        derandomize=config.getoption("--no-skips"),  # the check of a change does not depend on luck
    )
    hypothesis.settings.load_profile("fti")


@pytest.fixture(scope="session")
def scale(request: pytest.FixtureRequest) -> int:
    """Factor on the number of runs, flights or frames: 1, or 20 with ``--scale full``."""
    return SCALES[request.config.getoption("--scale")]


# ---------------------------------------------------------------------------------------------------------- skips


def _refuse_skip(report: pytest.TestReport | pytest.CollectReport) -> None:
    if report.outcome == "skipped" and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        report.outcome = "failed"
        report.longrepr = f"nothing may be skipped here (--no-skips): {reason}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    if item.config.getoption("--no-skips"):
        _refuse_skip(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    report = yield
    if collector.config.getoption("--no-skips"):
        _refuse_skip(report)
    return report


# ---------------------------------------------------------------------------------------------------------- leaks


@pytest.fixture(autouse=True)
def _nothing_left_behind(request: pytest.FixtureRequest) -> None:
    """Remember what is held before the test's own fixtures; compared when all of them are gone."""
    request.node.stash[before_key] = open_resources()
    if inspect.iscoroutinefunction(getattr(request.node, "function", None)):
        request.getfixturevalue("_no_task_left_behind")


@pytest.fixture
async def _no_task_left_behind() -> AsyncIterator[None]:
    """Tasks that run when the test and its fixtures have ended."""
    yield
    left = [t for t in asyncio.all_tasks() if t is not asyncio.current_task()]
    if left:
        await asyncio.wait(left, timeout=GRACE_S)
    left = [t for t in left if not t.done()]
    assert not left, f"tasks left behind: {', '.join(f'{t.get_name()} {t.get_coro()}' for t in left)}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None, None, None]:
    yield
    before = item.stash.get(before_key, None)
    if before is not None and (left := _left_behind(before)):
        pytest.fail(f"left behind: {'; '.join(left)}", pytrace=False)


def _left_behind(before: dict[str, str]) -> list[str]:
    """What is held now and was not before, after a time of grace."""
    deadline = time.monotonic() + GRACE_S
    while left := [what for key, what in open_resources().items() if key not in before]:
        if time.monotonic() > deadline:
            break
        gc.collect()
        time.sleep(POLL_S)
    return left
