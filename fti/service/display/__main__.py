"""The display process: subscribes to the bus, serves the page, forwards marks and commands to the supervisor.

It can be killed at any time without effect on the other processes.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from fti.clock import SystemClock
from fti.errors import FtiError, MissingError
from fti.messages.control import FromDisplay, PageFault, PageKey, PagePort, Stop, ToDisplay
from fti.service.control_channel import ControlChannel, ControlMessageError, open_inherited_channel
from fti.service.display.bus_feed import subscribe
from fti.service.display.tcp_user import user_of_connection
from fti.terminal_text import escape_controls
from fti.web.commands import CommandGate
from fti.web.live_state import LiveState
from fti.web.server import PageServer

EXIT_WRONG = 2
PROCESS = "display"
#: Retry period while another program uses the port [s].
RETRY_S = 2.0


def receive(channel: ControlChannel) -> list[ToDisplay]:
    """The messages of the supervisor; one that is not understood is reported to it."""

    def refuse(error: ControlMessageError) -> None:
        channel.send(PageFault(str(error)))

    return channel.receive(refuse)


async def wait_for_end(channel: ControlChannel, update: Callable[[ToDisplay], None]) -> None:
    """Wait until the supervisor sends stop or has ended, or for SIGTERM.  update : receives its messages"""
    loop = asyncio.get_running_loop()
    ended = asyncio.Event()

    def on_control() -> None:
        messages = receive(channel)
        for message in messages:
            update(message)
        if channel.has_ended or any(isinstance(message, Stop) for message in messages):
            ended.set()

    loop.add_reader(channel.fileno(), on_control)
    loop.add_signal_handler(signal.SIGTERM, ended.set)
    await ended.wait()
    loop.remove_reader(channel.fileno())
    loop.remove_signal_handler(signal.SIGTERM)


async def receive_key(channel: ControlChannel) -> str | None:
    """The command key, the first message of the supervisor; None at stop, or when the supervisor has ended."""
    loop = asyncio.get_running_loop()
    readable = asyncio.Event()
    loop.add_reader(channel.fileno(), readable.set)
    try:
        while not channel.has_ended:
            await readable.wait()
            readable.clear()
            messages = receive(channel)
            if any(isinstance(message, Stop) for message in messages):
                return None
            if keys := [message.key for message in messages if isinstance(message, PageKey)]:
                return keys[0]
    finally:
        loop.remove_reader(channel.fileno())
    return None


async def serve(bus: Path, port: int, channel: ControlChannel) -> None:
    """Serve the page until the supervisor ends it; report the port to the supervisor."""
    key = await receive_key(channel)
    if key is None:
        return
    clock = SystemClock(0)  # only time differences are needed
    live = LiveState(clock.now_ns())
    server = PageServer(live, clock.now_ns, CommandGate(key, channel.send, clock.now_ns), user_of_connection)
    subscriber = await asyncio.to_thread(subscribe, live, bus, PROCESS, clock)
    starting = asyncio.create_task(start_page(server, port, channel.send), name="start-page")
    try:
        await wait_for_end(channel, server.board.update)
    finally:
        starting.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await starting
        await server.stop()
        subscriber.close()


async def start_page(server: PageServer, port: int, report: Callable[[FromDisplay], object]) -> None:
    """Start serving, and report the port.

    While another program uses the port, this is reported once and retried; the recording continues without the page.
    """
    is_reported = False
    while True:
        try:
            report(PagePort(await server.start(port)))
            return
        except MissingError as error:
            if not is_reported:
                report(PageFault(f"{error}; recording continues without the page; retrying"))
            is_reported = True
        await asyncio.sleep(RETRY_S)


def main(argv: Sequence[str] | None = None) -> int:
    """``python -m fti.service.display``: started by the supervisor alone."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--bus", required=True, type=Path)
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--control-fd", type=int, required=True)
    args = parser.parse_args(argv)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the supervisor decides when it ends
    try:
        asyncio.run(serve(args.bus, args.port, open_inherited_channel(args.control_fd)))
    except FtiError as error:
        print(escape_controls(f"fti display: {error}"), file=sys.stderr)  # noqa: T201 - the supervisor passes it on
        return EXIT_WRONG
    return 0


if __name__ == "__main__":
    sys.exit(main())
