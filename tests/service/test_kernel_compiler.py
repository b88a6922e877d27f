"""Compiling what a configuration needs, once on a machine and beside what flies."""

from __future__ import annotations

import signal
import subprocess
import sys
from types import SimpleNamespace
from typing import Any, Self

import pytest

from fti import config as configuration
from fti import kernel
from fti.config import Config, Nav
from fti.service.navigation import __main__ as navigation
from fti.service.navigation import kernel_compiler
from tests.helpers import ROOT


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The input of compiler processes."""
    texts: list[str] = []

    class Compiler:
        """A process that keeps what it reads, and ends at once."""

        def __init__(self, command: list[str], **_: Any) -> None:
            assert command == [sys.executable, "-m", "fti.service.navigation.kernel_compiler"]
            self.stdin = SimpleNamespace(write=texts.append, close=lambda: None)

        def __enter__(self) -> Self:
            return self

        def __exit__(self, *_: object) -> None: ...

        def poll(self) -> int:
            return 0

    monkeypatch.setattr(subprocess, "Popen", Compiler)
    return texts


@pytest.fixture
def demo() -> Config:
    return configuration.load(ROOT / "configs" / "demo.toml")


def without(config: Config, *parts: str) -> Config:
    """The configuration, and navigation without some of its parts."""
    return config.model_copy(update={"nav": config.nav.model_copy(update=dict.fromkeys(parts))})


def test_nothing_is_started_where_the_code_is_on_disk(
    demo: Config, started: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernel, "is_cached", lambda _: True)
    kernel_compiler.ensure_kernels_compiled(demo)
    assert started == []


def test_what_is_missing_is_compiled_elsewhere_for_this_configuration(
    demo: Config, started: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernel, "is_cached", lambda _: False)
    kernel_compiler.ensure_kernels_compiled(demo)
    kernel_compiler.ensure_kernels_compiled(without(demo, "filter"))
    kernel_compiler.ensure_kernels_compiled(without(demo, "filter", "terrain", "approach"))
    assert [Config.model_validate_json(text).nav.filter is None for text in started] == [False, True, True]


def test_a_daemon_that_navigates_by_nothing_starts_without_kernels(
    demo: Config, started: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernel, "is_cached", lambda _: False)
    assert navigation._load_kernels(demo.model_copy(update={"nav": Nav()}), lambda: True)
    assert started == []
    tested = without(demo, "filter", "approach", "terrain")  # its receivers are tested by their ranges
    assert navigation._load_kernels(tested, lambda: True)
    assert len(started) == 1


def test_the_process_compiles_what_navigation_uses(demo: Config) -> None:
    command = [sys.executable, "-m", "fti.service.navigation.kernel_compiler"]
    done = subprocess.run(command, input=demo.model_dump_json(), capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert all(kernel.is_cached(one) for one in kernel_compiler._kernels(demo))


def test_the_process_is_killed_when_its_result_is_no_longer_needed(
    demo: Config, monkeypatch: pytest.MonkeyPatch
) -> None:
    processes, start = list[subprocess.Popen[str]](), subprocess.Popen

    def popen(*arguments: Any, **keys: Any) -> subprocess.Popen[str]:
        processes.append(start(*arguments, **keys))
        return processes[0]

    monkeypatch.setattr(subprocess, "Popen", popen)
    monkeypatch.setattr(kernel, "is_cached", lambda _: False)
    assert not navigation._load_kernels(demo, lambda: False)
    assert [process.wait() for process in processes] == [-signal.SIGKILL]
