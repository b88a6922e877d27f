"""Runs over processes and over a cluster: the same results in the same order, and nothing left when one fails."""

from __future__ import annotations

import asyncio
import functools
import os
import re
import signal
import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fti import parallel_runs
from fti.cli.main import main
from fti.errors import ConfigError, MissingError
from fti.parallel_runs import on_cluster, run_all
from fti.study import StudyResult, triple_buffer
from tests.helpers import ROOT, until
from tests.processes import command_of
from tests.study.tasks import kill_on_second, raise_on_third, square


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two processes from the second argument on."""
    monkeypatch.setattr(parallel_runs, "LOCAL_LIMIT_S", 0.0)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})


def test_results_come_in_the_order_of_the_arguments_from_other_processes() -> None:
    shares: list[float] = []
    before = dict(os.environ)
    outputs = run_all(square, range(6), shares.append)
    assert [value for value, _, _ in outputs] == [0, 1, 4, 9, 16, 25]
    assert {pid for _, pid, _ in outputs} - {os.getpid()}, "all was done here"
    assert {threads for _, pid, threads in outputs if pid != os.getpid()} == {"1"}
    assert shares == pytest.approx([k / 6 for k in range(1, 7)])
    assert dict(os.environ) == before


def test_short_work_is_done_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel_runs, "LOCAL_LIMIT_S", 3600.0)
    assert {pid for _, pid, _ in run_all(square, range(5), lambda _: None)} == {os.getpid()}
    assert run_all(square, [], lambda _: None) == []


def test_an_error_of_ours_comes_through_and_others_end_it(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ConfigError, match="the third"):
        run_all(functools.partial(raise_on_third, error=ConfigError), range(6), lambda _: None)
    with pytest.raises(RuntimeError, match="ended by itself"):
        run_all(functools.partial(raise_on_third, error=ZeroDivisionError), range(6), lambda _: None)
    assert "ZeroDivisionError: the third" in capfd.readouterr().err


def test_a_process_that_is_killed_is_no_wait_for_ever() -> None:
    with pytest.raises(RuntimeError, match=r"ended by itself \(-9\)"):
        run_all(kill_on_second, [0, 1, 2, 3], lambda _: None)


SCRIPT = """
import sys
from fti import parallel_runs
from tests.study.tasks import wait_minute
import asyncio
import functools
parallel_runs.LOCAL_LIMIT_S = -1.0
parallel_runs.os.sched_getaffinity = lambda _: {{0, 1}}
if __name__ == "__main__":
    try:
        parallel_runs.run_all(functools.partial(wait_minute, {file!r}), range(4), print)
    except KeyboardInterrupt:
        sys.exit(130)
"""


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_processes_end_with_the_study(tmp_path: Path, end: signal.Signals) -> None:
    """Ctrl-C, which a terminal sends to all of them, without a word from any; and when it is killed."""
    file, script = tmp_path / "pids", tmp_path / "script.py"
    file.touch()
    script.write_text(SCRIPT.format(file=str(file)))
    environ = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen([sys.executable, script], env=environ, stderr=subprocess.PIPE, process_group=0) as started:
        until(lambda: len(file.read_text().splitlines()) == 2, what="two processes at work")
        if end == signal.SIGINT:
            os.killpg(started.pid, end)
            assert (started.communicate()[1], started.returncode) == (b"", 130)
        else:
            started.kill()
    for pid in map(int, file.read_text().splitlines()):
        until(lambda pid=pid: not command_of(pid), what=f"the end of {pid}")  # type: ignore[misc]


class FakeFuture:
    def __init__(self, key: str, value: object) -> None:
        self.key, self._value = key, value

    def result(self) -> object:
        return self._value


class FakeClient:
    """Fake of ``distributed.Client``; it does the last argument first."""

    loop = "its own loop"

    def __init__(self, address: str, *, timeout: float, set_as_default: bool) -> None:
        assert address == "tcp://somebody:8786"  # another address has no client: it could not connect
        assert (timeout > 0.0, set_as_default) == (True, False)

    def __enter__(self) -> FakeClient:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def map(self, task: Callable[[Any], object], todo: list[Any], *, pure: bool) -> list[FakeFuture]:
        assert not pure  # the same seed twice is two runs
        return [FakeFuture(f"task-{k}", task(argument)) for k, argument in enumerate(todo)]


class FakeRpc:
    """Fake of ``distributed.rpc`` with the identity of a scheduler."""

    def __init__(self, address: str, *, timeout: float) -> None:
        assert timeout > 0.0
        self._address = address

    async def __aenter__(self) -> FakeRpc:
        return self

    async def __aexit__(self, *_: object) -> None:
        return None

    async def identity(self) -> dict[str, Any]:
        match self._address:
            case "tcp://nobody:1":
                raise OSError("Timed out trying to connect")
            case "nonsense":
                raise ValueError("missing port number")
            case "tcp://mute:1":
                await asyncio.sleep(60.0)
        return {"workers": {} if self._address == "tcp://idle:1" else {"tcp://worker:1": {}}}


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    """A package ``distributed`` whose workers are here."""

    def as_completed(futures: list[FakeFuture], *, loop: str) -> list[FakeFuture]:
        assert loop == FakeClient.loop  # without it the real one asks for a client of the whole process: there is none
        return futures[::-1]

    fake = types.SimpleNamespace(Client=FakeClient, rpc=FakeRpc, as_completed=as_completed)
    monkeypatch.setitem(sys.modules, "distributed", fake)


@pytest.mark.usefixtures("cluster")
@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("tcp://nobody:1", "no Dask scheduler answers at 'tcp://nobody:1': Timed out"),
        ("nonsense", "no Dask scheduler answers at 'nonsense': missing port number"),
        ("tcp://mute:1", "no Dask scheduler answers at 'tcp://mute:1': no answer within 0.05 s"),
        ("tcp://idle:1", "the Dask scheduler at tcp://idle:1 has no workers: dask worker tcp://idle:1"),
    ],
)
def test_a_cluster_that_is_not_there_is_a_sentence(address: str, message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel_runs, "CLUSTER_TIMEOUT_S", 0.05)
    with pytest.raises(MissingError, match=re.escape(message)), on_cluster(address):
        pytest.fail("there is no cluster")


@pytest.mark.usefixtures("cluster")
def test_a_cluster_does_the_runs() -> None:
    shares: list[float] = []
    with on_cluster("tcp://somebody:8786"):
        assert [value for value, _, _ in run_all(square, range(4), shares.append)] == [0, 1, 4, 9]
    assert shares == [0.25, 0.5, 0.75, 1.0]


def test_the_command_names_the_cluster_and_says_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def runs(runs: int, seed: int, progress: Callable[[float], None]) -> list[StudyResult]:
        run_all(square, range(runs), progress)
        return []

    monkeypatch.setattr(triple_buffer, "study", runs)
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(["study", "triple_buffer", "--scheduler", "tcp://somebody:8786"]) == 2
    assert "pip install 'fti[dask]'" in capsys.readouterr().err
