"""The daemon in one call: the supervisor and the signals that stop it."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import Awaitable, Callable, Iterator
from typing import TYPE_CHECKING

from fti.errors import FtiError, RecordingError
from fti.interrupts import InterruptHandler
from fti.service import limits
from fti.service.children import Child

if TYPE_CHECKING:
    from fti.config import Config
    from fti.service.supervisor.event_publisher import Announce
    from fti.service.supervisor.process import Supervisor

#: A task that runs beside the daemon from the start of the recording on; the daemon ends when the task has ended.
Companion = Callable[["Supervisor"], Awaitable[None]]


@contextlib.contextmanager
def early_recorder() -> Iterator[Child]:
    """Spawn the recorder before anything else is loaded, so that it is ready when the configuration is."""
    limits.raise_open_files()
    child = Child("recorder", has_standby=True)
    child.prepare()
    try:
        yield child
    finally:
        child.dismiss()


async def serve(
    config: Config,
    *,
    recorder: Child,
    announce: Announce,
    run_dir: str | None = None,
    duration_s: float | None = None,
    companion: Companion | None = None,
    shows_key: bool = False,
) -> bool:
    """Run one session.  Ctrl-C and SIGTERM shut it down in order.

    recorder   : see ``early_recorder``
    duration_s : stop after this time [s]; None: at a signal
    companion  : runs beside the daemon (the emulator of a demonstration); the first signal cancels it, and the daemon
                 stops after it, so that everything the companion sends is recorded
    shows_key  : print the page's address with the command key; only for a terminal
    Returns True when a signal stopped it.  Raises RecordingError when not everything was recorded.
    """
    # Installed before anything is created; the callback runs in the loop, when the supervisor exists.
    signalled = _stop_on_signals(lambda: stop())  # noqa: PLW0108
    from fti.clock import choose_epoch_ns  # noqa: PLC0415 - while this is loaded, the recorder starts
    from fti.service.supervisor.process import Supervisor  # noqa: PLC0415

    config = limits.adapt_to_limits(config, announce)
    supervisor = Supervisor(
        config, choose_epoch_ns(), run_dir, recorder, _suppress_output_errors(announce), shows_key=shows_key
    )
    companion_task = _start_companion(supervisor, companion) if companion else None

    def stop() -> None:
        if companion_task and not companion_task.cancelling() and not companion_task.done():
            companion_task.cancel()
        else:
            supervisor.stop()

    try:
        await supervisor.run(duration_s)
    finally:
        if companion_task:
            companion_task.cancel()
            await asyncio.gather(companion_task, return_exceptions=True)
    if supervisor.failed:
        raise FtiError("the recorder cannot start; see the messages above")
    if supervisor.loss:
        raise RecordingError(supervisor.loss)
    if companion_task and not companion_task.cancelled() and (error := companion_task.exception()):
        raise error
    return signalled.is_set()


def _suppress_output_errors(announce: Announce) -> Announce:
    """A closed terminal, or a log on a full disk, must not disturb the recording."""

    def announce_safely(line: str) -> None:
        with contextlib.suppress(OSError, ValueError):
            announce(line)

    return announce_safely


def _stop_on_signals(stop_supervisor: Callable[[], None]) -> asyncio.Event:
    signalled = asyncio.Event()

    def stop() -> None:
        signalled.set()
        stop_supervisor()

    loop, before = asyncio.get_running_loop(), signal.getsignal(signal.SIGINT)
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop)
    if isinstance(before, InterruptHandler) and before.interrupted:
        loop.call_soon(stop)
    return signalled


def _start_companion(supervisor: Supervisor, companion: Companion) -> asyncio.Task[None]:
    """Run the companion after the recording has started; the session stops when it ends, fails or is cancelled."""

    async def run_companion() -> None:
        await supervisor.recording_started.wait()
        await companion(supervisor)

    task = asyncio.create_task(run_companion(), name="companion")
    task.add_done_callback(lambda _: supervisor.stop())
    return task
