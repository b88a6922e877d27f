"""The publish process: forwards the messages of the bus to the sinks of ``[publish]``.

Each sink has a queue and a thread.  The bus, and every sink, go on while one of them is slow, gone or wrong.  A library
that ends the process ends no other one; the supervisor starts it again.
"""

from __future__ import annotations

import select
from pathlib import Path

from fti.bus.client import Subscriber
from fti.clock import SystemClock
from fti.config import Publish
from fti.errors import MissingError
from fti.messages.control import PublishReport, Stop
from fti.messages.outputs import Event
from fti.publish.fan_out import FanOut
from fti.publish.make_sinks import make_sinks
from fti.publish.message import SessionIdentity
from fti.service.control_channel import ControlChannel
from fti.service.publish.sink_worker import END_S, SinkWorker, end_workers

PROCESS = "publish"
REPORT_PERIOD_S = 1.0


class PublishProcess:
    """Runs the sinks of a configuration until the supervisor sends stop or has ended.

    bus : socket of the bus; clock : for events; channel : to the supervisor
    """

    def __init__(
        self, publish: Publish, identity: SessionIdentity, bus: Path, *, clock: SystemClock, channel: ControlChannel
    ) -> None:
        self._bus, self._clock, self._channel = bus, clock, channel
        sinks = make_sinks(publish, identity, self._report)
        self._fan_out = FanOut(sink.queue for sink in sinks)
        self._workers = [SinkWorker(sink.name, sink.sink, sink.queue, self._report) for sink in sinks]

    def run(self) -> None:
        """See the class."""
        for worker in self._workers:
            worker.start()
        subscriber = self._subscribe()
        while not self._is_over():
            self._channel.send(PublishReport({worker.name: worker.health() for worker in self._workers}))
        if subscriber:
            subscriber.close()
        self._end_workers()

    def _subscribe(self) -> Subscriber | None:
        try:
            return Subscriber(self._bus, PROCESS, lambda topic, payload, sent_ns: self._fan_out.publish(topic, payload))
        except MissingError:  # the supervisor has just ended, which the channel reports
            return None

    def _is_over(self) -> bool:
        """Wait at most ``REPORT_PERIOD_S`` for a message; is the end requested?"""
        select.select([self._channel], [], [], REPORT_PERIOD_S)
        messages = self._channel.receive(lambda error: self._report("error", PROCESS, str(error)))
        return any(isinstance(message, Stop) for message in messages) or self._channel.has_ended

    def _end_workers(self) -> None:
        """Send what waits, and disconnect; a sink that blocks longer is left behind."""
        for name in end_workers(self._workers):
            self._report("warning", f"publish {name}", f"did not end within {END_S:g} s; its last messages are lost")

    def _report(self, level: str, source: str, text: str) -> None:
        self._channel.send(Event(t_ns=self._clock.now_ns(), level=level, source=source, text=text))
