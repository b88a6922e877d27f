"""Ends a child: wait, send an urgent message, kill, or abandon it when a blocked medium holds it."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

from fti.messages.control import ControlMessage
from fti.service.children import Child, ProcessState
from fti.service.supervisor.event_publisher import Announce

POLL_PERIOD_S = 0.02
#: A recorder that has reported its stop ends within this time, unless a medium blocks it.
HELD_TIMEOUT_S = 10.0


async def await_recorder(recorder: Child, recorded: asyncio.Event, announce: Announce) -> int:
    """Wait for the recorder; returns its exit code.  It is abandoned when a blocked medium holds it after its stop.

    recorded : set when it has reported its stop
    """
    held_since = time.monotonic()
    while recorder.process and recorder.process.poll() is None:
        if not recorded.is_set():
            held_since = time.monotonic()
        elif time.monotonic() - held_since > HELD_TIMEOUT_S:
            announce("warning: recorder: has finished; its process ends when a blocked medium responds")
            recorder.process = None
            return 0
        await asyncio.sleep(POLL_PERIOD_S)
    return recorder.process.returncode if recorder.process else 0


async def end_child(
    child: Child, timeout_s: float, announce: Announce, urgent_message: Callable[[], ControlMessage | None]
) -> None:
    """Wait for a child that was asked to end; kill it after ``timeout_s``.

    urgent_message : returns a message that makes it end sooner, or None
    """
    deadline, killed = time.monotonic() + timeout_s, False
    while child.process and child.process.poll() is None:
        if child.channel and (message := urgent_message()):
            child.channel.send(message)
        if time.monotonic() > deadline:
            if killed:  # it ends when the blocked medium responds
                child.process = None
                break
            announce(f"error: {child.name}: did not end within {timeout_s:g} s and was killed")
            child.kill()
            deadline, killed = time.monotonic() + timeout_s, True
        await asyncio.sleep(POLL_PERIOD_S)
    child.state = ProcessState.STOPPED


def describe_exit(code: int) -> str:
    """An exit code as a text."""
    return f"signal {-code}" if code < 0 else f"exit code {code}"


def describe_restart(child: Child, code: int) -> str:
    """A text about the exit of a child and its restart."""
    text = f"ended with {describe_exit(code)}; it is restarted"
    if child.early_deaths and child.delay_s:
        return f"{text} in {child.delay_s:g} s: {child.early_deaths} exits soon after the start"
    return text
