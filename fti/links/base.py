"""Base class of links: open, send the configuration of the device, read, and reconnect after a loss.

A link has one task, ``run``.  It opens the port and runs until it is cancelled; it reopens a port that cannot be opened
or is lost after 0.1 s, then after twice the delay each time, up to 2 s.  Reading is a callback of the loop: the time
from arrival to stamp is one call.  Links do not interpret the bytes.
"""

from __future__ import annotations

import asyncio
import contextlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from fti.clock import Clock, next_beat
from fti.constants import SECOND_NS
from fti.errors import LinkError, PartialSendError
from fti.links._beat_scheduler import schedule_early_poll
from fti.messages.frames import LinkState

#: Receives frames that arrived together (each a read, a datagram or a CAN frame; at least one) and their FTI times of
#: arrival [ns].  The times do not decrease, also between calls.  Both are never changed afterwards.  It must not raise.
Sink = Callable[[Sequence[bytes], Sequence[int]], None]

NOT_OPENED = "not opened yet"
GOOD = LinkState.GOOD
MIN_RETRY_S, MAX_RETRY_S = 0.1, 2.0
#: Period of the checks of an open link; all links are checked with the same beat.
CHECK_PERIOD_S = 0.5
#: Above this message rate of a link, the first message after a beat is seldom the altimeter's [Hz].
MAX_EARLY_HZ = 120.0
#: A link that received nothing for this time is silent.
SILENCE_TIMEOUT_NS = 2 * SECOND_NS
#: Time after a drop of the kernel during which the link state is overflow.
OVERFLOW_HOLD_NS = 10 * SECOND_NS
#: States of an open port that receives frames.
RECEIVING = (GOOD, LinkState.OVERFLOW)
#: Draining ends when nothing arrived for QUIET_S, at the latest after DRAIN_S.
QUIET_S, DRAIN_S = 0.01, 2.0


def per_frame_sink(accept: Callable[[bytes, int], None]) -> Sink:
    """A sink that calls ``accept`` for each frame."""

    def sink(frames: Sequence[bytes], times_ns: Sequence[int]) -> None:
        for frame, t_rx_ns in zip(frames, times_ns, strict=True):
            accept(frame, t_rx_ns)

    return sink


@dataclass(slots=True)
class LinkStatus:
    """State of a link, a hint for the engineer at the connector, and its counters.

    frames, bytes, last_rx_ns : received frames and bytes, last arrival (FTI time; None before the first)
    connects       : number of times the port was opened
    refused        : datagrams from other sources than the configured one; frames that the bus library could not read
    noise_bytes    : bytes on the line of an adapter that are neither frame nor answer
    socket_dropped : frames that the kernel dropped because its queue was full; dropped_ns : FTI time of the last drop
                     counted; None before the first
    stamp_refused  : rejected kernel stamps
    echo_bytes     : received bytes that were our own transmissions; not counted as received
    errors         : line errors since the start, by name, of a UART or a CAN controller; only available counters
    """

    state: LinkState = LinkState.ABSENT
    hint: str = NOT_OPENED
    frames: int = 0
    bytes: int = 0
    last_rx_ns: int | None = None
    connects: int = 0
    refused: int = 0
    noise_bytes: int = 0
    socket_dropped: int = 0
    dropped_ns: int | None = None
    stamp_refused: int = 0
    tx_frames: int = 0
    tx_bytes: int = 0
    echo_bytes: int = 0
    errors: dict[str, int] = field(default_factory=dict)


class BaseLink(ABC):
    """Connection management of a link; subclasses open, read, write and close the transport.

    name      : of the configuration; transmit : sending is allowed
    sink      : see ``Sink``
    on_connect: sent after every connect, when the link may send
    on_sent   : receives sent frames and their times; None: they are not reported
    urgent    : received frames trigger an early poll, unless the message rate is too high; set before ``run``
    receives_pieces : a read is a piece of a message, so reads do not count messages
    """

    receives_pieces: ClassVar[bool] = False

    def __init__(self, name: str, transmit: bool, clock: Clock, sink: Sink, on_connect: Sequence[bytes]) -> None:
        self.name = name
        self.status = LinkStatus()
        self._transmit = transmit
        self._clock = clock
        self._sink = sink
        self.on_sent: Sink | None = None
        self.urgent = False
        self._rate_hz = 0.0
        self._measured = 0, 0  # frames until then, FTI time [ns]
        self._on_connect = tuple(on_connect)
        self._send_lock = asyncio.Lock()
        self._partial_sends: list[str] = []  # sent parts of the present write, for the error if it is aborted
        self._lost: asyncio.Future[LinkError] | None = None  # pending while the port is open
        self._ending = False

    # -------------------------------------------------------------------------------------------------- transport

    @abstractmethod
    async def _open(self) -> None:
        """Open the port and begin to read.  Raises LinkError; ``_close`` is then called as well."""

    @abstractmethod
    def _close(self) -> None:
        """Release all resources, also after an incomplete ``_open``."""

    @abstractmethod
    def _read(self) -> bool:
        """Read the available data, up to a limit; true when there may be more.  May raise OSError."""

    @abstractmethod
    async def _write(self, data: bytes) -> None:
        """Write all data; cancelled at the timeout.  May raise OSError or LinkError."""

    @abstractmethod
    def _silent_hint(self) -> str:
        """Possible causes when the port is open and nothing arrives."""

    # ------------------------------------------------------------------------------------------------------- life

    async def run(self) -> None:
        """Keep the link connected until cancelled; then close everything."""
        delay = MIN_RETRY_S
        while True:
            connects = self.status.connects
            try:
                await self._connection()
            except LinkError as error:
                self.status.state, self.status.hint = LinkState(error.state), str(error)
            delay = MIN_RETRY_S if self.status.connects > connects else min(2 * delay, MAX_RETRY_S)
            await asyncio.sleep(delay)

    async def _connection(self) -> None:
        """One connection, from opening to loss; always ends with an exception."""
        self._lost = asyncio.get_running_loop().create_future()
        try:
            await self._open()
            self.status.connects += 1
            self.status.state, self.status.hint = LinkState.SILENT, self._silent_hint()
            for data in self._on_connect if self._transmit else ():
                with contextlib.suppress(LinkError):  # the link also receives if sending fails
                    await self.send(data)
            self._schedule_check(self._lost)
            await asyncio.wait([self._lost])
            raise self._lost.result()
        except OSError as error:
            raise LinkError(f"link {self.name}: {error.strerror or error}") from None
        finally:
            self._fail(LinkError(f"link {self.name}: closed"))  # wakes pending senders
            self._lost = None
            self._close()

    def _schedule_check(self, lost: asyncio.Future[LinkError]) -> None:
        loop = asyncio.get_running_loop()
        loop.call_at(next_beat(loop.time(), CHECK_PERIOD_S), self._run_check, lost)

    def _run_check(self, lost: asyncio.Future[LinkError]) -> None:
        if not lost.done():
            self._schedule_check(lost)
            try:
                self._check()
            except (LinkError, OSError) as error:
                self._handle_loss(error)

    def _check(self) -> None:
        """Every ``CHECK_PERIOD_S`` while open.  Raises LinkError when the port is no longer the right one."""
        status, now = self.status, self._clock.now_ns()
        self._measure_rate(now)
        if status.last_rx_ns is None or now - status.last_rx_ns >= SILENCE_TIMEOUT_NS:
            status.state, status.hint = LinkState.SILENT, self._silent_hint()
        elif status.dropped_ns is not None and now - status.dropped_ns < OVERFLOW_HOLD_NS:
            text = f"the kernel has dropped {status.socket_dropped} frames"
            status.state, status.hint = LinkState.OVERFLOW, f"{text}: its queue was full before the recorder read it"
        else:
            status.state, status.hint = GOOD, ""

    def _measure_rate(self, now_ns: int) -> None:
        """Rate of reception since the last measurement."""
        frames, before_ns = self._measured
        if now_ns > before_ns:
            self._rate_hz = (self.status.frames - frames) * SECOND_NS / (now_ns - before_ns)
            self._measured = self.status.frames, now_ns

    def _fail(self, error: LinkError) -> None:
        """The port is lost; ``run`` closes and reopens it."""
        if self._lost and not self._lost.done():
            self._lost.set_result(error)

    def _on_readable(self) -> bool:
        """Callback of the loop; true when there may be more to read."""
        try:
            return self._read()
        except (LinkError, OSError) as error:
            self._handle_loss(error)
            return False

    def _handle_loss(self, error: LinkError | OSError) -> None:
        """An operation on the port failed: the port is lost."""
        if isinstance(error, OSError):
            error = LinkError(f"link {self.name}: {error.strerror or error}")
        self._fail(error)

    def _receive(self, frames: Sequence[bytes], times_ns: Sequence[int]) -> None:
        """Count received frames and pass them to the sink."""
        status = self.status
        status.frames += len(frames)
        status.bytes += sum(map(len, frames))
        status.last_rx_ns = times_ns[-1]
        if status.state not in RECEIVING:
            status.state, status.hint = GOOD, ""
        self._sink(frames, times_ns)
        if self._is_early():
            schedule_early_poll(self)

    def _is_early(self) -> bool:
        """May received frames trigger an early poll?"""
        return self.urgent and (self.receives_pieces or self._rate_hz <= MAX_EARLY_HZ)

    async def drain(self) -> None:
        """Read the remaining data of the kernel before the link is cancelled; sending is refused from now on."""
        self._ending = True
        loop = asyncio.get_running_loop()
        end, quiet = loop.time() + DRAIN_S, 0
        while self._lost and not self._lost.done() and quiet < 2 and loop.time() < end:
            before = self.status.frames
            more = self._on_readable()  # also true for datagrams of other sources, which may precede ours
            quiet = 0 if more or self.status.frames > before else quiet + 1
            await asyncio.sleep(QUIET_S if quiet else 0)

    # ------------------------------------------------------------------------------------------------------- sending

    async def send(self, data: bytes, timeout_s: float = 1.0) -> int:
        """Send bytes (serial), one datagram or one CAN frame; returns its length.

        Raises LinkError when the link is down or the device accepts nothing for timeout_s, PartialSendError when a part
        was sent nevertheless; ValueError when the configuration does not allow this link to send.
        """
        if not self._transmit:
            raise ValueError(f"link {self.name}: transmit is false in the configuration")
        sent_parts: list[str] = []
        try:
            async with asyncio.timeout(timeout_s), self._send_lock:
                self._require_connection()
                self._partial_sends = sent_parts
                await self._write(data)
        except (OSError, LinkError) as error:
            text = self._describe_failure(error, len(data), timeout_s)
            raise (PartialSendError if sent_parts else LinkError)("; ".join([text, *sent_parts])) from None
        self._count_sent(data)
        return len(data)

    def _describe_failure(self, error: OSError | LinkError, size: int, timeout_s: float) -> str:
        if isinstance(error, LinkError):
            return str(error)
        if isinstance(error, TimeoutError):
            return f"link {self.name}: {size} bytes could not be sent within {timeout_s:g} s{self._timeout_hint()}"
        return f"link {self.name}: cannot send: {error.strerror or error}"

    def _require_connection(self) -> None:
        """Raises LinkError when the link is down or the session ends."""
        if self._ending:
            raise LinkError(f"link {self.name}: the session ends")
        if self._lost is None or self._lost.done():
            raise self._not_connected()

    def _not_connected(self) -> LinkError:
        return LinkError(f"link {self.name}: is not connected: {self.status.hint}")

    def _timeout_hint(self) -> str:
        """Possible causes of a timeout on this kind of link."""
        return ""

    def _count_sent(self, data: bytes) -> None:
        """Count a sent frame and pass it to ``on_sent``."""
        self.status.tx_frames += 1
        self.status.tx_bytes += len(data)
        if self.on_sent:
            self.on_sent((data,), (self._clock.now_ns(),))

    async def _writable(self, fd: int) -> None:
        """Wait until the kernel accepts more data.  Raises LinkError when the link is lost meanwhile."""
        loop = asyncio.get_running_loop()
        lost = self._lost
        assert lost
        ready: asyncio.Future[Any] = loop.create_future()
        waited: list[asyncio.Future[Any]] = [ready, lost]
        loop.add_writer(fd, _complete, ready)
        try:
            await asyncio.wait(waited, return_when=asyncio.FIRST_COMPLETED)
        finally:
            if not lost.done():  # otherwise the descriptor is closed or reused
                loop.remove_writer(fd)
        if lost.done():
            raise lost.result()


def _complete(future: asyncio.Future[Any]) -> None:
    """A writer callback may be called more than once before it is removed."""
    if not future.done():
        future.set_result(None)
