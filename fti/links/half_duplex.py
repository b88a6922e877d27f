"""RS-485 with two wires: only one station may send at a time, and a transceiver may receive its own bytes.

A transmission during an answer destroys both.  On such a line there is therefore one request at a time (a poll, a
command, a message at connect): the link sends after the line was quiet for a moment, and after the answer to the last
request has arrived or its timeout has passed.  The link does not interpret the bytes: an answer is any data after a
request, and it ends when the line is quiet.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from collections.abc import Sequence

from fti.clock import Clock
from fti.config import SerialLink as SerialConfig
from fti.links.base import Sink
from fti.links.serial import SerialPortLink

#: A pause of 3.5 characters ends a message (Modbus over Serial Line V1.02, 2.5.1.1); a USB adapter delays data by up to
#: 16 ms, and the kernel adds some delay.
QUIET_CHARACTERS, ADAPTER_S = 3.5, 0.020
#: An echo that has not arrived within this time after sending counts as missing [s].
ECHO_S = 0.5
GARBLED, MISSING = "echo_garbled", "echo_missing"

#: Bytes and the time of their arrival [ns].
TimedBytes = tuple[bytes, int]


def character_s(config: SerialConfig) -> float:
    """Duration of one character [s]: start, data, parity and stop bits."""
    return (1 + config.data_bits + (config.parity != "none") + config.stop_bits) / config.baud


def quiet_s(config: SerialConfig) -> float:
    """Required quiet time of the line before sending [s]."""
    if config.quiet_ms is not None:
        return config.quiet_ms / 1000
    return QUIET_CHARACTERS * character_s(config) + ADAPTER_S


class LineTurn:
    """Decides when sending is allowed.  Sizes in bytes; now_s and all times [s] of the event loop."""

    def __init__(self, quiet_s: float, answer_s: float, character_s: float) -> None:
        self._quiet_s, self._answer_s, self._character_s = quiet_s, answer_s, character_s
        self._busy_until_s = float("-inf")
        self._answer_until_s = float("-inf")
        self._changed = asyncio.Event()

    def mark_sent(self, size: int, now_s: float) -> None:
        """We began to send."""
        self._busy_until_s = max(now_s, self._busy_until_s) + size * self._character_s
        self._answer_until_s = self._busy_until_s + self._answer_s

    def mark_received(self, now_s: float) -> None:
        """Data arrived: the answer, if we have sent a request."""
        self._busy_until_s = max(now_s, self._busy_until_s)
        self._answer_until_s = float("-inf")
        self._changed.set()

    def transmit_time_left_s(self, now_s: float) -> float:
        """Remaining time of our transmission on the line [s]."""
        return max(0.0, self._busy_until_s - now_s)

    def wait_time_s(self, now_s: float) -> float:
        """Remaining waiting time before sending, as known now [s]; 0 or less: none."""
        return max(self._busy_until_s + self._quiet_s, self._answer_until_s) - now_s

    async def wait_for_turn(self) -> None:
        """Wait until sending is allowed."""
        now = asyncio.get_running_loop().time
        while (left := self.wait_time_s(now())) > 0:
            self._changed.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(left):
                    await self._changed.wait()


class Echo:
    """Removes the echo of our own transmissions from the received data.

    A damaged or missing echo is given up: bytes that were taken for its beginning are then received data.
    garbled, missing : numbers of such echoes; size : bytes of the received echoes
    """

    def __init__(self) -> None:
        self._expected: deque[tuple[bytes, float]] = deque()  # and its deadline [s]
        self._held = bytearray()
        self._held_ns = 0
        self.size = self.garbled = self.missing = 0

    def expect(self, data: bytes, until_s: float) -> None:
        """This was sent; its echo arrives by then."""
        self._expected.append((data, until_s))

    def take(self, data: bytes, t_rx_ns: int) -> list[TimedBytes]:
        """The part of a read that is not an echo."""
        at = 0
        while self._expected and at < len(data):
            message = self._expected[0][0]
            part = data[at : at + len(message) - len(self._held)]
            if not message.startswith(self._held + part):
                self.garbled += 1
                return [*self._give_up(), (data[at:], t_rx_ns)]
            self._held_ns = self._held_ns if self._held else t_rx_ns
            self._held += part
            at += len(part)
            if len(self._held) == len(message):
                self.size += len(message)
                self._held.clear()
                self._expected.popleft()
        return [(data[at:], t_rx_ns)] if at < len(data) else []

    def expire(self, now_s: float) -> list[TimedBytes]:
        """Bytes that were taken for the beginning of an echo that is missing now."""
        if not self._expected or now_s < self._expected[0][1]:
            return []
        self.missing += 1
        return self._give_up()

    def _give_up(self) -> list[TimedBytes]:
        held, self._held = bytes(self._held), bytearray()
        self._expected.clear()
        return [(held, self._held_ns)] if held else []


class HalfDuplexLink(SerialPortLink):
    """A serial line with one sender at a time (``half_duplex``), or with an echo (``echo``), or both."""

    def __init__(self, config: SerialConfig, clock: Clock, sink: Sink, on_connect: Sequence[bytes] = ()) -> None:
        super().__init__(config, clock, sink, on_connect)
        self._character_s, self._quiet_s = character_s(config), quiet_s(config)
        self._line_turn = LineTurn(self._quiet_s, config.answer_ms / 1000, self._character_s)
        self._echo = Echo() if config.echo else None
        if self._echo:
            self.status.errors |= {GARBLED: 0, MISSING: 0}

    async def _open(self) -> None:
        await super()._open()
        self._line_turn.mark_received(asyncio.get_running_loop().time())  # the line may be in use

    async def _write(self, data: bytes) -> None:
        if self._config.half_duplex:
            await self._line_turn.wait_for_turn()
            self._require_connection()
        await super()._write(data)

    def _on_written(self, data: bytes) -> None:
        now = asyncio.get_running_loop().time()
        self._line_turn.mark_sent(len(data), now)
        if self._echo:
            self._echo.expect(data, now + self._line_turn.transmit_time_left_s(now) + ECHO_S)

    def _deliver(self, data: bytes, t_rx_ns: int) -> None:
        if self._echo is None:
            self._handle([(data, t_rx_ns)])
        else:
            self._handle([*self._echo.expire(asyncio.get_running_loop().time()), *self._echo.take(data, t_rx_ns)])
            self._count_echoes(self._echo)

    def _handle(self, reads: Sequence[TimedBytes]) -> None:
        if reads:
            self._line_turn.mark_received(asyncio.get_running_loop().time())
            self._receive([data for data, _ in reads], [t_rx_ns for _, t_rx_ns in reads])

    def _count_echoes(self, echo: Echo) -> None:
        self.status.echo_bytes = echo.size
        self.status.errors |= {GARBLED: echo.garbled, MISSING: echo.missing}

    def _check(self) -> None:
        self._expire(asyncio.get_running_loop().time())
        super()._check()

    def _close(self) -> None:
        self._expire(float("inf"))
        super()._close()

    def _expire(self, now_s: float) -> None:
        if self._echo:
            self._handle(self._echo.expire(now_s))
            self._count_echoes(self._echo)

    def _timeout_hint(self) -> str:
        if not self._config.half_duplex:
            return ""
        quiet = f"the line must be quiet for {self._quiet_s * 1000:.0f} ms before sending"
        return f"; half_duplex: {quiet}, and an answer has {self._config.answer_ms:.0f} ms to begin"
