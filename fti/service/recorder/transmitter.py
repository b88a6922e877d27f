"""What the recorder sends: the questions that are repeated, and commands.  It never understands them."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import Callable, Mapping

from fti.clock import SECOND_NS, Clock
from fti.errors import LinkError, PartialSendError
from fti.links import Link
from fti.service.control_channel import ControlMessage
from fti.service.fault_guard import FailureHandler, keep_running
from fti.service.startup import LinkStartup

#: A command that its device, or a line on which others talk, does not take for so long is given up [s].
COMMAND_TIMEOUT_S = 3.0


class Transmitter:
    """Sends on the links of a recorder.

    orders : what is asked again and again, by link
    tell   : says ``{"sent": {"id", "fault", "partly", "t_ns"}}`` of each command, exactly once; partly : something has
             gone out, or yet may, though there was a fault
    """

    def __init__(
        self,
        links: Mapping[str, Link],
        orders: Mapping[str, LinkStartup],
        clock: Clock,
        *,
        tell: Callable[[ControlMessage], object],
        report: FailureHandler,
    ) -> None:
        self._links, self._orders, self._clock = links, orders, clock
        self._tell, self._report = tell, report
        self._tasks: set[asyncio.Task[None]] = set()
        self._stopped = False

    def start(self) -> None:
        """Begin to ask."""
        for name, order in self._orders.items():
            for period_s, data in order.polls:
                make = functools.partial(self._poll, self._links[name], period_s, bytes.fromhex(data))
                self._keep(asyncio.create_task(keep_running(f"poll {name}", make, self._report), name=f"poll {name}"))

    def handle_command(self, request: ControlMessage) -> None:
        """Send a command: ``{"link", "data", "id"}``, data in hexadecimal; ``until_ns`` when it can be too late."""
        if not self._stopped:
            self._keep(asyncio.create_task(self._send(request), name="send"))

    async def stop(self) -> None:
        """Nothing is sent any more."""
        self._stopped = True
        tasks = list(self._tasks)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _keep(self, task: asyncio.Task[None]) -> None:
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _poll(self, link: Link, period_s: float, data: bytes) -> None:
        while True:
            await asyncio.sleep(period_s)
            try:
                await link.send(data)
            except LinkError:
                continue  # the state of the link tells it; the next period asks again

    async def _send(self, request: ControlMessage) -> None:
        fault, partly = None, False
        try:
            await self._find(request["link"]).send(bytes.fromhex(request["data"]), self._time_left(request))
        except (LinkError, ValueError) as error:
            fault, partly = str(error), isinstance(error, PartialSendError)
        except Exception as error:  # noqa: BLE001  what a link should not raise
            self._report("send", error)
            fault, partly = f"{type(error).__name__}: {error}", True  # nobody knows how far it came
        self._tell({"sent": {"id": request["id"], "fault": fault, "partly": partly, "t_ns": self._clock.now_ns()}})

    def _time_left(self, request: ControlMessage) -> float:
        """How long sending may take [s].  Raises ValueError when it is too late: nobody waits for it any more."""
        until_ns = request.get("until_ns")
        if until_ns is None:
            return COMMAND_TIMEOUT_S
        left_ns = until_ns - self._clock.now_ns()
        if left_ns <= 0:
            raise ValueError(f"it came to the recorder {-left_ns / SECOND_NS:.1f} s after it was given up")
        return float(min(COMMAND_TIMEOUT_S, left_ns / SECOND_NS))

    def _find(self, name: str) -> Link:
        if name not in self._links:
            raise ValueError(f"there is no link {name!r}")
        return self._links[name]
