"""The zenoh process: forwards the messages of the bus to zenoh clients, which can only read.

It runs when ``[bus]`` enables it.  The Rust library zenoh may panic (for example with a real-time clock before 1970 or
after 2106); a separate process protects the others.  After a failure it retries every five seconds.
"""

from __future__ import annotations

import argparse
import select
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from fti.bus.client import Subscriber
from fti.bus.zenoh_endpoint import ZenohEndpoint
from fti.clock import SystemClock, describe_wrong_time
from fti.errors import FtiError
from fti.messages.control import Ready, Stop
from fti.messages.outputs import Event
from fti.service.control_channel import ControlChannel, open_inherited_channel
from fti.service.fault_guard import catch_failures

PROCESS = "zenoh"
RETRY_S = 5.0


class ZenohRelay:
    """Forwards messages from the bus to zenoh.

    bus : socket of the bus; session, port : of the endpoint; clock : for events; channel : to the supervisor
    """

    def __init__(self, bus: Path, session: str, port: int, *, clock: SystemClock, channel: ControlChannel) -> None:
        self._bus, self._session, self._port = bus, session, port
        self._clock, self._channel = clock, channel
        self._endpoint: ZenohEndpoint | None = None
        self._subscriber: Subscriber | None = None
        self._failed = False
        self._reported = ""

    def run(self) -> None:
        """Forward until the supervisor sends stop or has ended."""
        while True:
            if self._endpoint is None:
                with catch_failures(PROCESS, self._report):
                    self._open()
            if self._is_over():
                break
            if self._failed:
                self._close()
        self._close()

    def _open(self) -> None:
        if describe_wrong_time():
            raise FtiError("zenoh needs a real-time clock between 1970 and 2106")
        self._endpoint = ZenohEndpoint.open(self._port, self._session)
        self._failed = False
        self._subscriber = Subscriber(self._bus, PROCESS, self._publish, self._set_alive)

    def _close(self) -> None:
        subscriber, self._subscriber = self._subscriber, None
        endpoint, self._endpoint = self._endpoint, None
        with catch_failures(PROCESS, self._report):
            if subscriber:
                subscriber.close()
            if endpoint:
                endpoint.close()

    def _publish(self, topic: str, payload: bytes, sent_ns: int) -> None:
        if self._endpoint and not self._failed:
            with catch_failures(PROCESS, self._report):
                self._endpoint.publish(topic, payload)

    def _set_alive(self, process: str, is_alive: bool) -> None:
        if self._endpoint and not self._failed:
            with catch_failures(PROCESS, self._report):
                self._endpoint.set_alive(process, is_alive)

    def _is_over(self) -> bool:
        """Wait at most ``RETRY_S`` for a message; is the end requested?"""
        select.select([self._channel], [], [], RETRY_S)
        messages = self._channel.receive(lambda error: self._report("control", error))
        return any(isinstance(message, Stop) for message in messages) or self._channel.has_ended

    def _report(self, unit: str, error: Exception) -> None:
        """Report a failure, unless it is the same as the last one."""
        self._failed = True
        text = f"zenoh clients receive no data: {error}"
        if text != self._reported:
            self._reported = text
            self._channel.send(Event(t_ns=self._clock.now_ns(), level="warning", source=unit, text=text))


def main(argv: Sequence[str] | None = None) -> int:
    """``python -m fti.service.zenoh``: started by the supervisor alone."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--bus", required=True, type=Path)
    parser.add_argument("--session", required=True)
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--epoch-ns", type=int, required=True)
    parser.add_argument("--control-fd", type=int, required=True)
    args = parser.parse_args(argv)
    for number in (signal.SIGINT, signal.SIGTERM):  # the supervisor decides when it ends
        signal.signal(number, signal.SIG_IGN)
    channel = open_inherited_channel(args.control_fd)
    relay = ZenohRelay(args.bus, args.session, args.port, clock=SystemClock(args.epoch_ns), channel=channel)
    channel.send(Ready())
    relay.run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
