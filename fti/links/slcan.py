"""CAN through a Lawicel (slcan) adapter on a serial line, parsed directly.

Document: Lawicel AB, CAN232 manual, version 3 (2013), ASCII commands; CAN FD letters as Linux-side adapters use them.

    to the adapter     C close   S0..S8 bit rate   O open   L open, listen only; each ends with CR
    frames, both ways  tiiil[dd..]  standard     Tiiiiiiiil[dd..]  extended     r, R  remote request, no data
                       d, D  CAN FD; b, B  with bit-rate switch; l is then a data length code 0..F
                       from the adapter: 4 hex digits of its clock [ms] may follow; CR
    answers            CR done   BEL refused   z, Z  frame accepted; V N F with their values

The link delivers ``can_frame`` bytes (see ``fti.canframe``), stamped with the read that contained the first letter.
Text that is neither frame nor answer counts as noise; after a lost CR the next frame is found by its letter.

The link opens the adapter and requests its status (``fti.links.slcan_status``) even if it may not transmit or is
listen_only: these commands end in the adapter and never reach the bus.  The requests cost four characters a second on
the serial line and switch off the adapter's error lamp; its cause is then in the ledger.
"""

from __future__ import annotations

import asyncio
import os
import re
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

from fti import canframe
from fti.clock import Clock
from fti.config import CanLink, SerialLink
from fti.errors import ConfigError, LinkError
from fti.links.base import Sink
from fti.links.serial import SerialPortLink
from fti.links.slcan_status import ASK, BUS_TROUBLE, StatusWatch

BITRATES = {
    10_000: b"S0",
    20_000: b"S1",
    50_000: b"S2",
    100_000: b"S3",
    125_000: b"S4",
    250_000: b"S5",
    500_000: b"S6",
    800_000: b"S7",
    1_000_000: b"S8",
}
#: The longest line: letter, 8 digits, length code, 64 bytes of data, time.
MAX_LINE_BYTES = 1 + 8 + 1 + 128 + 4
DEFAULT_BAUD = 115200
OPEN_S = 1.0
ANSWER = re.compile(rb"[zZ]?|V[0-9A-Fa-f]{4}|v[0-9A-Za-z]*|N[0-9A-Za-z]{4}|F[0-9A-Fa-f]{2}")
#: Counters in the errors of the link: bytes that are neither frame nor answer; times the channel was found closed.
NOISE, CLOSED = "slcan_noise_bytes", "slcan_channel_closed"
CLASSIC_LETTERS = b"tTrR"  # no hex digits: they cannot occur inside a frame


class Form(NamedTuple):
    """Format of a frame, selected by its letter."""

    digits: int
    remote: bool = False
    fd: bool = False
    switch: bool = False


FORMS = {
    ord("t"): Form(3),
    ord("T"): Form(8),
    ord("r"): Form(3, remote=True),
    ord("R"): Form(8, remote=True),
    ord("d"): Form(3, fd=True),
    ord("D"): Form(8, fd=True),
    ord("b"): Form(3, fd=True, switch=True),
    ord("B"): Form(8, fd=True, switch=True),
}


def parse_line(line: bytes) -> bytes | None:
    """The frame in a line without its CR; None if the line is not a frame."""
    form = FORMS.get(line[0]) if line else None
    if form is None or line[1:].strip(b"0123456789abcdefABCDEF"):
        return None
    begin = 2 + form.digits
    can_id, code = line[1 : begin - 1], line[begin - 1 : begin]
    if len(can_id) < form.digits or not code or int(can_id, 16) > (0x7FF if form.digits == 3 else 0x1FFF_FFFF):
        return None
    length = canframe.FD_LENGTHS[int(code, 16)]
    size = 0 if form.remote else 2 * length
    if (length > 8 and not form.fd) or len(line) - begin not in (size, size + 4):
        return None
    data = bytes(length) if form.remote else bytes.fromhex(line[begin : begin + size].decode("ascii"))
    frame = canframe.pack_can(int(can_id, 16), data, extended=form.digits == 8, remote=form.remote, fd=form.fd)
    return frame[:5] + bytes([frame[5] | canframe.FD_BRS]) + frame[6:] if form.switch else frame


def format_frame(frame: bytes) -> bytes:
    """A frame as text for the adapter, with CR.  Raises ValueError for an error frame."""
    if len(frame) == canframe.CAN_SIZE and (begin := _data_begin(frame[:5])):
        return begin + frame[8 : 8 + frame[4]].hex().upper().encode() + b"\r"
    return _format_any(frame)


@lru_cache(maxsize=1024)
def _data_begin(head: bytes) -> bytes:
    """Text before the data of a classic data frame, from its identifier and length; empty for another frame."""
    fields = canframe.unpack_can(head.ljust(canframe.CAN_SIZE, b"\0"))
    if fields.error or fields.remote:
        return b""
    return _format_any(head.ljust(canframe.CAN_SIZE, b"\0"))[: -1 - 2 * head[4]]


def _format_any(frame: bytes) -> bytes:
    fields = canframe.unpack_can(frame)
    if fields.error:
        raise ValueError("an error frame cannot be sent")
    switch = fields.fd and bool(frame[5] & canframe.FD_BRS)
    letter = "b" if switch else "d" if fields.fd else "r" if fields.remote else "t"
    head = f"{letter.upper()}{fields.can_id:08X}" if fields.extended else f"{letter}{fields.can_id:03X}"
    code = canframe.FD_LENGTHS.index(len(fields.data))
    return f"{head}{code:X}{'' if fields.remote else fields.data.hex().upper()}\r".encode()


class Lawicel:
    """Parses the text of an adapter.  Every byte is part of a frame or of an answer, held, or noise.

    deliver  : called with (frame, arrival of its first letter [ns])
    watch    : gets the answers to status requests
    refusals : BELs in answer to other commands
    """

    def __init__(self, deliver: Callable[[bytes, int], None], watch: StatusWatch) -> None:
        self._deliver = deliver
        self._watch = watch
        self._line = bytearray()
        self._reads: list[tuple[int, int]] = []  # position in the line where a read began, and its arrival
        self.framed = self.answers = self.refusals = self.noise = 0

    @property
    def held(self) -> int:
        """Bytes of the incomplete line."""
        return len(self._line)

    def feed(self, data: bytes, t_rx_ns: int) -> None:
        """Process a read that arrived at t_rx_ns."""
        *lines, rest = data.replace(b"\a", b"\a\r").split(b"\r")
        for line in lines:
            self._hold(line, t_rx_ns)
            self._end_line()
        self._hold(rest, t_rx_ns)

    def discard_line(self) -> None:
        """Count the incomplete line as noise: its end will not arrive."""
        self.noise += len(self._line)
        self._line.clear()
        self._reads = []

    def _hold(self, text: bytes, t_rx_ns: int) -> None:
        if text or not self._reads:
            self._reads.append((len(self._line), t_rx_ns))
            self._line += text
        if (surplus := len(self._line) - MAX_LINE_BYTES) > 0:
            self.noise += surplus
            del self._line[:surplus]
            self._reads = [(max(at - surplus, 0), t) for at, t in self._reads]
            while len(self._reads) > 1 and self._reads[1][0] == 0:
                del self._reads[0]

    def _end_line(self) -> None:
        line, reads = bytes(self._line), self._reads
        self._line.clear()
        self._reads = []
        if line.endswith(b"\a"):
            self.refusals += not self._watch.take_refusal()
            self.answers += 1
            self.noise += len(line) - 1
        elif self._watch.take(line) or ANSWER.fullmatch(line):
            self.answers += len(line) + 1
        else:
            self._find_frame(line, reads)

    def _find_frame(self, line: bytes, reads: list[tuple[int, int]]) -> None:
        """The line is a frame, ends with one, or is noise."""
        at, frame = 0, parse_line(line)
        if frame is None:
            at = max(line.rfind(letter) for letter in CLASSIC_LETTERS)
            frame = parse_line(line[at:]) if at > 0 else None
        if frame is None:
            self.noise += len(line) + 1
            return
        self.noise += at
        self.framed += len(line) + 1 - at
        self._deliver(frame, next(t for begin, t in reversed(reads) if begin <= at))


class SlcanLink(SerialPortLink):
    """A CAN bus behind a Lawicel adapter; ``settings``: tty_baudrate (115200), listen_only (false)."""

    receives_pieces = False

    def __init__(self, config: CanLink, clock: Clock, sink: Sink, on_connect: Sequence[bytes] = ()) -> None:
        settings = dict(config.settings)
        baud, listen_only = settings.pop("tty_baudrate", DEFAULT_BAUD), settings.pop("listen_only", False)
        if settings:
            key = f"link {config.name}: settings.{min(settings)}"
            raise ConfigError(f"{key}: there is no such key; allowed here: listen_only, tty_baudrate")
        port = SerialLink(name=config.name, kind="serial", port=config.channel, baud=baud, transmit=config.transmit)
        super().__init__(port, clock, sink, on_connect)
        self._commands = _open_commands(config, listen_only)
        self._controller = StatusWatch(self.status.errors)
        self._parser = Lawicel(self._receive_frame, self._controller)
        self._rest = b""  # of a line whose beginning was written
        self._owed = b""  # the frame of that line, if its sender has aborted
        self._noise_before = 0

    async def _open(self) -> None:
        await super()._open()
        self._rest = self._owed = b""
        self._noise_before = self.status.noise_bytes
        self._parser = Lawicel(self._receive_frame, self._controller)
        self._start_status_requests()
        try:
            async with asyncio.timeout(OPEN_S):
                await super()._write(self._commands)
        except TimeoutError:
            raise LinkError(f"{self._config.port}: the adapter accepts no command") from None

    def _start_status_requests(self) -> None:
        self._controller.begin(self._clock.now_ns(), self._commands.count(b"\r") - 1)

    def _close(self) -> None:
        super()._close()
        self._parser.discard_line()
        self._count_noise()

    def _deliver(self, data: bytes, t_rx_ns: int) -> None:
        self._parser.feed(data, t_rx_ns)
        self._count_noise()

    def _count_noise(self) -> None:
        self.status.noise_bytes = self.status.errors[NOISE] = self._noise_before + self._parser.noise

    def _receive_frame(self, frame: bytes, t_rx_ns: int) -> None:
        self._receive((frame,), (t_rx_ns,))

    # ------------------------------------------------------------------------------------------------------- writing

    def _on_partial_write(self, data: bytes) -> None:
        """An incomplete line is not a frame: record nothing."""

    async def _write(self, data: bytes) -> None:
        line = format_frame(data)
        while not self._begin_line(line):
            await self._writable(self._fd)
        try:
            while not self._end_line():
                await self._writable(self._fd)
        except BaseException:
            self._owed = data
            self._partial_sends.append("its line is incomplete, and will be completed when the adapter accepts more")
            raise

    def _begin_line(self, line: bytes) -> bool:
        """Write as much of a line as the kernel accepts; false if it accepts nothing.

        An incomplete line is completed first: half a line followed by another could be a frame that nobody sent.
        """
        if not self._end_line():
            return False
        rest = self._without_written(line)
        if len(rest) == len(line):
            return False
        self._rest = rest
        return True

    def _end_line(self) -> bool:
        self._rest = self._without_written(self._rest)
        if self._owed and not self._rest:
            self._count_sent(self._owed)
            self._owed = b""
        return not self._rest

    def _without_written(self, text: bytes) -> bytes:
        try:
            return text[os.write(self._fd, text) :] if text else b""
        except BlockingIOError:
            return text

    def _check(self) -> None:
        super()._check()
        if self._controller.is_due(self._clock.now_ns()) and not self._send_lock.locked():
            self._request_status()

    def _request_status(self) -> None:
        """Request the status; reopen the channel of an adapter that has closed it (after a loss of power)."""
        if not self._controller.is_channel_closed:
            if self._begin_line(ASK):
                self._controller.mark_requested()
        elif self._begin_line(self._commands):
            self._start_status_requests()
            self.status.errors[CLOSED] = self.status.errors.get(CLOSED, 0) + 1

    def _silent_hint(self) -> str:
        if self._controller.flags & BUS_TROUBLE:
            return f"{self._config.port}: the adapter reports bus errors: is the bit rate right, is the bus terminated?"
        if self._parser.refusals and not self._controller.is_supported:
            return f"{self._config.port}: the adapter refused a command: does it know the bit rate?"
        if self._parser.noise:
            return f"{self._config.port}: text that is not a CAN frame: is it a Lawicel adapter, is tty_baudrate right?"
        return f"{self._config.port}: the adapter is open, no frame arrives: is the bus connected, its bit rate right?"


def _open_commands(config: CanLink, listen_only: bool) -> bytes:
    """Close (it may be open), bit rate, open, and a status request whose answer is the baseline."""
    if config.bitrate is not None and config.bitrate not in BITRATES:
        allowed = ", ".join(map(str, BITRATES))
        raise ConfigError(f"link {config.name}: bitrate = {config.bitrate}: a Lawicel adapter supports {allowed}")
    rate = [BITRATES[config.bitrate]] if config.bitrate else []
    return b"".join(command + b"\r" for command in (b"C", *rate, b"L" if listen_only else b"O")) + ASK
