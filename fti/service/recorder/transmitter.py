"""Sends polls and commands on the links, without interpreting them."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import Callable, Mapping

from fti.clock import Clock
from fti.constants import SECOND_NS
from fti.errors import LinkError, PartialSendError
from fti.links import Link
from fti.messages.control import SendBytes, SendResult
from fti.service.fault_guard import FailureHandler, keep_running
from fti.service.startup import LinkStartup

#: A command that cannot be sent within this time (busy line, blocked port) fails [s].
COMMAND_TIMEOUT_S = 3.0


class Transmitter:
    """Sends on the links of a recorder.

    startup_by_link : polls by link
    send_reply : sends the result exactly once for each command
    """

    def __init__(
        self,
        links: Mapping[str, Link],
        startup_by_link: Mapping[str, LinkStartup],
        clock: Clock,
        *,
        send_reply: Callable[[SendResult], object],
        report: FailureHandler,
    ) -> None:
        self._links, self._startup_by_link, self._clock = links, startup_by_link, clock
        self._send_reply, self._report = send_reply, report
        self._tasks: set[asyncio.Task[None]] = set()
        self._stopped = False

    def start(self) -> None:
        """Start polling."""
        for name, startup in self._startup_by_link.items():
            for period_s, data in startup.polls:
                make = functools.partial(self._poll, self._links[name], period_s, bytes.fromhex(data))
                self._track(asyncio.create_task(keep_running(f"poll {name}", make, self._report), name=f"poll {name}"))

    def handle_command(self, request: SendBytes) -> None:
        """Send a command."""
        if not self._stopped:
            self._track(asyncio.create_task(self._send(request), name="send"))

    async def stop(self) -> None:
        """Stop sending."""
        self._stopped = True
        tasks = list(self._tasks)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _track(self, task: asyncio.Task[None]) -> None:
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _poll(self, link: Link, period_s: float, data: bytes) -> None:
        while True:
            await asyncio.sleep(period_s)
            try:
                await link.send(data)
            except LinkError:
                continue  # the state of the link shows it; the next period polls again

    async def _send(self, request: SendBytes) -> None:
        fault, partly = None, False
        try:
            await self._find(request.link).send(bytes.fromhex(request.data), self._remaining_s(request.until_ns))
        except (LinkError, ValueError) as error:
            fault, partly = str(error), isinstance(error, PartialSendError)
        except Exception as error:  # noqa: BLE001  unexpected
            self._report("send", error)
            fault, partly = f"{type(error).__name__}: {error}", True  # a part may have been sent
        self._send_reply(SendResult(request.id, fault, partly, self._clock.now_ns()))

    def _remaining_s(self, until_ns: int | None) -> float:
        """Time left for sending [s].  Raises ValueError after the deadline."""
        if until_ns is None:
            return COMMAND_TIMEOUT_S
        remaining_ns = until_ns - self._clock.now_ns()
        if remaining_ns <= 0:
            raise ValueError(f"it reached the recorder {-remaining_ns / SECOND_NS:.1f} s after its deadline")
        return float(min(COMMAND_TIMEOUT_S, remaining_ns / SECOND_NS))

    def _find(self, name: str) -> Link:
        if name not in self._links:
            raise ValueError(f"unknown link {name!r}")
        return self._links[name]
