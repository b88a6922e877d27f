"""The pytest plugin: options, fixtures, and the output of the programs of a bench in the report of a failure.

pytest loads it wherever fti is installed, therefore it imports only pytest before a fixture is used.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from fti.testing.bench import Bench
    from fti.testing.emulator import Emulator
    from fti.testing.recorder import Recorder
    from fti.testing.slots import FlightSlots
    from fti.testing.unit import UnitUnderTest


KEEP, FLIGHTS = "--fti-keep", "--fti-flights"
_NOT_IN_NAMES = re.compile(r"[^A-Za-z0-9_.-]+")
_MAX_NAME = 100
#: Benches of this process, for the report of a failure.
_benches = pytest.StashKey["list[Bench]"]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("fti", "flights of fti.testing")
    group.addoption(
        KEEP, metavar="DIR", type=Path, help="keep the folder of each flight below DIR, also of passed tests"
    )
    group.addoption(
        FLIGHTS,
        metavar="N",
        type=_count,
        help="at most N flights at a time, over all workers of pytest-xdist (default: one for each two processors)",
    )


def _count(text: str) -> int:
    number = int(text)
    if number < 1:
        raise ValueError(text)
    return number


def pytest_configure(config: pytest.Config) -> None:
    """Begin with an empty list of benches."""
    config.stash[_benches] = []


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add the last output of the programs of the bench to a failure."""
    report = yield
    benches = item.config.stash[_benches]
    if report.failed:
        report.sections += [section for bench in benches for section in bench.sections()]
    if report.when == "teardown":
        benches[:] = [bench for bench in benches if not bench.is_closed]
    return report


@pytest.fixture(scope="session")
def fti_bench_factory(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], AbstractContextManager[Bench]]:
    """Make a bench for a fixture of your own: ``with fti_bench_factory("nominal") as bench: ... yield flight``."""
    keep: Path | None = request.config.getoption(KEEP)
    slots = _slots(request.config, tmp_path_factory)

    @contextmanager
    def make(name: str) -> Iterator[Bench]:
        from fti.testing.bench import Bench

        name = _NOT_IN_NAMES.sub("_", name)[-_MAX_NAME:]
        folder = tmp_path_factory.mktemp(f"fti_{name[:30]}") if keep is None else _new_folder(keep.absolute(), name)
        with Bench(folder, slots) as bench:
            request.config.stash[_benches].append(bench)
            yield bench

    return make


def _slots(config: pytest.Config, tmp_path_factory: pytest.TempPathFactory) -> FlightSlots:
    """The slots, shared by the workers of pytest-xdist, whose base folders have one parent."""
    from fti.testing.slots import FlightSlots

    base = tmp_path_factory.getbasetemp()
    shared = base.parent if hasattr(config, "workerinput") else base
    return FlightSlots(shared / "fti_slots", config.getoption(FLIGHTS))


def _new_folder(parent: Path, name: str) -> Path:
    """A new folder of that name, with a number if it exists."""
    number = 0
    while True:
        folder = parent / (f"{name}_{number}" if number else name)
        try:
            folder.mkdir(parents=True, mode=0o700)
        except FileExistsError:
            number += 1
        else:
            return folder


@pytest.fixture
def fti_bench(
    request: pytest.FixtureRequest, fti_bench_factory: Callable[[str], AbstractContextManager[Bench]]
) -> Iterator[Bench]:
    """The bench of this test: emulator, recorder, unit under test and their folder; it ends with the test."""
    with fti_bench_factory(request.node.name) as bench:
        yield bench


@pytest.fixture
def fti_emulator(fti_bench: Bench) -> Emulator:
    """Flies a scenario on ports of this machine: ``start(SCENARIO, config=..., duration_s=...)``, then ``fly()``."""
    return fti_bench.emulator


@pytest.fixture
def fti_recorder(fti_bench: Bench) -> Recorder:
    """Records the output of the unit under test: ``start(CONFIG)``."""
    return fti_bench.recorder


@pytest.fixture
def fti_unit(fti_bench: Bench) -> UnitUnderTest:
    """Starts the unit under test: ``start([PROGRAM, "--port", "{emulator.LINK.port}"], ready_text="ready")``."""
    return fti_bench.unit
