"""Independent runs of one function over all cores of this machine, or over a cluster: ``run_all``.

A run is a function of its argument alone (a seed, a tuple with one), so its process does not affect the result, and
results have the order of the arguments.  Function and argument must be picklable: a function of a module, or a
``functools.partial`` of one.

Runs begin in this process.  If more than one is left after ``LOCAL_LIMIT_S``, worker processes do them: one for each
core, spawned (never forked), with single-threaded linear algebra.  They end when their parent ends, for any reason;
Ctrl-C reaches the parent only.  On a cluster: ``with on_cluster("tcp://10.0.0.1:8786"):`` gives the runs to that Dask
scheduler; its workers need the same ``fti``.
"""

from __future__ import annotations

import asyncio
import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextvars import ContextVar
from itertools import islice
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, NamedTuple, TypeVar

from fti.errors import FtiError, MissingError

#: Called with the completed share, 0 to 1.
Progress = Callable[[float], None]
Argument = TypeVar("Argument")
Output = TypeVar("Output")

#: A process takes about two seconds to start, so shorter work is done in this process.
LOCAL_LIMIT_S = 3.0
#: Limits each process to one thread, so that processes do not compete for cores.
SINGLE_THREAD_ENV = {"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
#: Timeout of the answer of a cluster and of the end of a process [s].
CLUSTER_TIMEOUT_S, END_TIMEOUT_S = 10.0, 5.0

_client: ContextVar[Any] = ContextVar("_client", default=None)


@contextlib.contextmanager
def on_cluster(scheduler: str | None) -> Iterator[None]:
    """Context in which the cluster of a Dask scheduler does the runs; None: this machine.

    Raises MissingError without the package ``distributed``, and for a cluster that does not answer or has no workers.
    """
    with contextlib.nullcontext() if scheduler is None else _connect(scheduler) as client:
        token = _client.set(client)
        try:
            yield
        finally:
            _client.reset(token)


def _connect(scheduler: str) -> Any:
    """A client of the cluster.

    The scheduler is queried first without a client: a client without connection prints a traceback or waits at exit.
    """
    try:
        from distributed import Client  # noqa: PLC0415 - an extra, for who has a cluster
    except ImportError:
        raise MissingError("a cluster needs the package distributed: pip install 'fti[dask]'") from None
    try:
        identity = asyncio.run(asyncio.wait_for(_identity(scheduler), CLUSTER_TIMEOUT_S))
    except (OSError, ValueError) as error:  # ValueError: no address
        why = str(error) or f"no answer within {CLUSTER_TIMEOUT_S:g} s"
        raise MissingError(f"no Dask scheduler answers at {scheduler!r}: {why}") from error
    if not identity["workers"]:
        raise MissingError(f"the Dask scheduler at {scheduler} has no workers: dask worker {scheduler}")
    return Client(scheduler, timeout=CLUSTER_TIMEOUT_S, set_as_default=False)


async def _identity(scheduler: str) -> Any:
    """Identity of a Dask scheduler; its connection has a shorter timeout than its answer."""
    from distributed import rpc  # noqa: PLC0415 - see above

    async with rpc(scheduler, timeout=CLUSTER_TIMEOUT_S / 2) as server:
        return await server.identity()


def run_all(task: Callable[[Argument], Output], arguments: Iterable[Argument], progress: Progress) -> list[Output]:
    """Results of ``task`` for each argument, in their order; progress : called with the completed share.

    Raises errors of ``fti.errors`` that the task raises.  After any other error a process prints it on standard error
    and ends; this raises RuntimeError.
    """
    todo, client = list(arguments), _client.get()
    found: dict[int, Output] = {}
    for number, result in _run_locally(task, todo) if client is None else _run_on_cluster(task, todo, client):
        found[number] = result
        progress(len(found) / len(todo))
    return [found[number] for number in range(len(todo))]


def _run_locally(task: Callable[[Any], Output], todo: Sequence[Any]) -> Iterator[tuple[int, Output]]:
    """Results with the indices of their arguments, in order of completion."""
    cores = len(os.sched_getaffinity(0))
    begin = time.monotonic()
    for number, argument in enumerate(todo):
        left = len(todo) - number
        if min(left, cores) > 1 and time.monotonic() - begin > LOCAL_LIMIT_S:
            yield from _run_in_processes(task, list(enumerate(todo))[number:], min(left, cores))
            return
        yield number, task(argument)


class _Worker(NamedTuple):
    """A worker process, and the parent's end of the pipe to it."""

    process: SpawnProcess
    pipe: Connection

    def hand_out(self, numbered: tuple[int, Any]) -> None:
        """Send an argument with its index; ``answer`` reports a process that has ended."""
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            self.pipe.send(numbered)

    def answer(self) -> tuple[int, Any]:
        """Index of an argument and its result."""
        try:
            number, result = self.pipe.recv()
        except (EOFError, ConnectionResetError):
            self.process.join(END_TIMEOUT_S)
            raise RuntimeError(f"a worker process ended by itself ({self.process.exitcode})") from None
        if isinstance(result, FtiError):
            raise result
        return number, result

    def end(self) -> None:
        """Kill the process."""
        self.pipe.close()
        self.process.terminate()
        self.process.join(END_TIMEOUT_S)
        self.process.close()


def _run_in_processes(
    task: Callable[[Any], Output], todo: Sequence[tuple[int, Any]], cores: int
) -> Iterator[tuple[int, Output]]:
    workers: list[_Worker] = []
    try:
        with _worker_environment():
            for _ in range(cores):
                workers.append(_start(task))  # noqa: PERF401 - those that have started are ended when one does not
        yield from _distribute(workers, todo)
    finally:
        for worker in workers:
            worker.end()


def _distribute(workers: Sequence[_Worker], todo: Sequence[tuple[int, Any]]) -> Iterator[tuple[int, Any]]:
    """Give the next argument to each process that has answered."""
    waiting = iter(todo)
    busy = {worker.pipe: worker for worker in workers}
    for worker in workers:
        worker.hand_out(next(waiting))
    for _ in todo:
        pipe = wait(list(busy))[0]
        assert isinstance(pipe, Connection)
        answer = busy[pipe].answer()
        for numbered in islice(waiting, 1):
            busy[pipe].hand_out(numbered)
        yield answer


@contextlib.contextmanager
def _worker_environment() -> Iterator[None]:
    """Processes started here inherit ``SINGLE_THREAD_ENV`` and ignore Ctrl-C from their first instruction."""
    before = {name: os.environ.get(name) for name in SINGLE_THREAD_ENV}
    resource_tracker.ensure_running()  # the first start of a process would start it too, and enable Ctrl-C again
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    os.environ.update(SINGLE_THREAD_ENV)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _start(task: Callable[[Any], Any]) -> _Worker:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(task, theirs), daemon=True)
    process.start()
    theirs.close()  # so that the parent detects the end of the process
    return _Worker(process, ours)


def _work(task: Callable[[Any], Any], pipe: Connection) -> None:
    """Worker process: run the task until the parent ends."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            number, argument = pipe.recv()
            pipe.send((number, _run_task(task, argument)))


def _end_with_parent() -> None:
    """End also in the middle of a run: workers of a killed command would load the machine for minutes."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _run_task(task: Callable[[Any], Any], argument: object) -> Any:
    try:
        return task(argument)
    except FtiError as error:
        return error


def _run_on_cluster(task: Callable[[Any], Output], todo: Sequence[Any], client: Any) -> Iterator[tuple[int, Output]]:
    from distributed import as_completed  # noqa: PLC0415 - see above

    futures = client.map(task, todo, pure=False)
    numbers = {future.key: number for number, future in enumerate(futures)}
    for future in as_completed(futures, loop=client.loop):  # otherwise it searches a client of the whole process
        yield numbers[future.key], future.result()
