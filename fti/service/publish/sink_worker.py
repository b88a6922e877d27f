"""The thread of one sink: connects, sends what its queue has, and connects again after a failure."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence

from fti.messages.health import SinkHealth
from fti.publish.message import PublishedMessage
from fti.publish.sink import Sink
from fti.publish.sink_queue import SinkQueue
from fti.service.fault_guard import ReportEvent, catch_failures

#: Delay before the next attempt to connect: doubled after each failure [s].
FIRST_RETRY_S, MAX_RETRY_S = 0.5, 15.0
#: After a connection that has lasted so long the next delay is the first one again [s].
WORKS_S = 15.0
#: A sink is called at least this often [s], so that it can serve its peers.
IDLE_S = 0.5
#: Time for the last messages at the end [s].
END_S = 2.0


class SinkWorker:
    """Sends the messages of a queue with a sink, in a thread of its own.

    name : of the sink in the configuration; report : reports an event, from any thread
    """

    def __init__(self, name: str, sink: Sink, queue: SinkQueue, report: ReportEvent) -> None:
        self.name, self.queue = name, queue
        self._sink, self._report = sink, report
        self._ending = threading.Event()
        self._sent, self._connects = 0, 0
        self._open_s = 0.0
        self._is_open, self._fault, self._reported = False, "", ""
        self._thread = threading.Thread(target=self._run, name=f"fti-sink-{name}", daemon=True)

    def start(self) -> None:
        """Begin to connect."""
        self._thread.start()

    def request_end(self) -> None:
        """End after the messages that wait now; a sink that blocks is left behind."""
        self._ending.set()
        self.queue.close()

    def join(self, timeout_s: float = END_S) -> bool:
        """Wait for the end; has the sink ended?"""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def health(self) -> SinkHealth:
        """State and counts of the sink."""
        counts, is_open = self.queue.counts, self._is_open
        peers = None
        with catch_failures(self.name, lambda unit, error: None):  # it has just been closed by its thread
            peers = self._sink.count_peers() if is_open else None
        return SinkHealth(
            state="connected" if is_open else "retrying" if self._fault else "connecting",
            hint=self._fault,
            peers=peers,
            connects=self._connects,
            sent=self._sent,
            replaced=counts.replaced,
            skipped=counts.skipped,
            waiting_events=self.queue.waiting_events,
            lost_events=counts.lost_events,
        )

    def _run(self) -> None:
        retry_s = FIRST_RETRY_S
        while not self._ending.is_set():
            with catch_failures(self.name, self._fail):
                self._sink.open()
                self._on_open()
                self._send_until_end()
            if self._is_open and time.monotonic() - self._open_s > WORKS_S:
                retry_s = FIRST_RETRY_S
            self._is_open = False
            with catch_failures(self.name, self._fail):
                self._sink.close()
            self._ending.wait(retry_s)
            retry_s = min(2.0 * retry_s, MAX_RETRY_S)
        if lost := self.queue.drop_events():
            self._report("warning", f"publish {self.name}", f"events that could not be sent before the end: {lost}")

    def _on_open(self) -> None:
        self._connects += 1
        self._open_s = time.monotonic()
        self._is_open, self._fault = True, ""
        if self._connects > 1:
            self.queue.queue_all_values()
        if self._reported:
            self._reported = ""
            counts = self.queue.counts
            text = f"connected again; so far {counts.replaced} values were replaced, {counts.lost_events} events lost"
            self._report("info", f"publish {self.name}", text)

    def _send_until_end(self) -> None:
        while not self._ending.is_set():
            self._send(self.queue.take(IDLE_S))
        self._send(self.queue.take_all())

    def _send(self, messages: Sequence[PublishedMessage]) -> None:
        try:
            self._sink.send(messages)
        except BaseException:
            self.queue.put_back(messages)
            raise
        self._sent += len(messages)

    def _fail(self, unit: str, error: Exception) -> None:
        """Report a failure, unless it is the same as the last one."""
        self._fault = str(error) or type(error).__name__
        if self._fault != self._reported:
            self._reported = self._fault
            self._report("warning", f"publish {unit}", f"receives no data: {self._fault}; retried until it works")


def end_workers(workers: Sequence[SinkWorker], timeout_s: float = END_S) -> list[str]:
    """Send what waits, and disconnect; returns the names of sinks that are left behind because they block.

    timeout_s : for all of them together [s]
    """
    for worker in workers:
        worker.request_end()
    end_s = time.monotonic() + timeout_s
    return [worker.name for worker in workers if not worker.join(max(0.0, end_s - time.monotonic()))]
