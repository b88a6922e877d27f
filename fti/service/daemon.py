"""The daemon in one call: a supervisor, and the signals that end it."""

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

#: What else runs with the daemon, from its first recorded moment on; the daemon ends when it has ended.
Companion = Callable[["Supervisor"], Awaitable[None]]


@contextlib.contextmanager
def early_recorder() -> Iterator[Child]:
    """The recorder, started before anything else is loaded: it is ready when the configuration is."""
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
    """Run one session to its end.  Ctrl-C and SIGTERM end it in good order.

    recorder   : see ``early_recorder``
    duration_s : end after so long [s]; None runs until a signal comes
    companion  : runs beside the daemon (the emulator of a demonstration); the first signal cancels it, and the daemon
                 ends after it, so that all that the companion sends is recorded
    shows_key  : the line with the page's address has the key to command from it; for a terminal alone
    Returns True when a signal ended it.  Raises RecordingError when not everything was recorded.
    """
    # Before there is anything to be left behind; a callback of the loop, it comes when there is a supervisor.
    signalled = _stop_on_signals(lambda: stop())  # noqa: PLW0108
    from fti.clock import choose_epoch_ns  # noqa: PLC0415 - while this is loaded, the recorder starts
    from fti.service.supervisor.process import Supervisor  # noqa: PLC0415

    config = limits.fit(config, announce)
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
        raise FtiError("the recorder cannot start; what it said stands above")
    if supervisor.loss:
        raise RecordingError(supervisor.loss)
    if companion_task and not companion_task.cancelled() and (error := companion_task.exception()):
        raise error
    return signalled.is_set()


def _suppress_output_errors(announce: Announce) -> Announce:
    """A terminal that is gone, or a log on a full medium, must not disturb the recording."""

    def tell(line: str) -> None:
        with contextlib.suppress(OSError, ValueError):
            announce(line)

    return tell


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
    """A companion that fails or ends takes the session with it, also one that is cancelled before it begins."""

    async def accompany() -> None:
        await supervisor.recording.wait()
        await companion(supervisor)

    task = asyncio.create_task(accompany(), name="companion")
    task.add_done_callback(lambda _: supervisor.stop())
    return task
