"""The end of a child: waited for, asked to hurry, killed, or left to the medium that holds it."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

from fti.service.children import Child, ProcessState
from fti.service.control_channel import ControlMessage
from fti.service.supervisor.event_publisher import Announce

POLL_PERIOD_S = 0.02
#: A recorder that has said that it stopped ends within this time, if its media let it.
HELD_TIMEOUT_S = 10.0


async def await_recorder(recorder: Child, recorded: asyncio.Event, announce: Announce) -> int:
    """Its exit code.  One that has finished, and is held by a medium that does not answer, is left to that.

    recorded : it has said that it stopped
    """
    held_since = time.monotonic()
    while recorder.process and recorder.process.poll() is None:
        if not recorded.is_set():
            held_since = time.monotonic()
        elif time.monotonic() - held_since > HELD_TIMEOUT_S:
            announce("warning: recorder: has finished, and ends when a medium that holds it answers")
            recorder.process = None
            return 0
        await asyncio.sleep(POLL_PERIOD_S)
    return recorder.process.returncode if recorder.process else 0


async def end_child(
    child: Child, timeout_s: float, announce: Announce, urgent_message: Callable[[], ControlMessage | None]
) -> None:
    """Wait for a child that was told to end; kill it when that takes longer than ``timeout_s``.

    urge : what it is to be told now, so that it ends sooner; None while there is time
    """
    deadline, killed = time.monotonic() + timeout_s, False
    while child.process and child.process.poll() is None:
        if child.channel and (message := urgent_message()):
            child.channel.send(message)
        if time.monotonic() > deadline:
            if killed:  # it ends when the medium that holds it answers
                child.process = None
                break
            announce(f"error: {child.name}: did not end within {timeout_s:g} s and was killed")
            child.kill()
            deadline, killed = time.monotonic() + timeout_s, True
        await asyncio.sleep(POLL_PERIOD_S)
    child.state = ProcessState.STOPPED


def describe_exit(code: int) -> str:
    """An exit code in words."""
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def describe_restart(child: Child, code: int) -> str:
    """That a child has died, and when it is started again."""
    text = f"ended with {describe_exit(code)}; it is started again"
    if child.early_deaths and child.delay_s:
        return f"{text} in {child.delay_s:g} s, as it died {child.early_deaths} times soon after its start"
    return text
