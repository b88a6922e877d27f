"""Serial lines: RS-232, RS-422, RS-485 behind a tty, or a pty.

Opened exclusively, raw, without discarding what has already arrived.  One read is one frame.  The port is known by
its path, not by what the path leads to: when a symbolic link changes to another device, that one is opened.
A pty has no wire, so it has no parity, no data bits other than 8, no flow control and no direction: there these
settings are left.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import stat
import termios
from collections.abc import Sequence
from pathlib import Path

import serial as pyserial
from serial.rs485 import RS485Settings

from fti.clock import Clock
from fti.config import SerialLink as SerialConfig
from fti.errors import LinkError, PortAbsent, PortBusy, PortDenied
from fti.links.base import BaseLink, Sink
from fti.links.ports import group_of, serial_names
from fti.links.uart_errors import LineWatch

READ_BYTES = 65536
MAX_FINAL_READS = 1000  # from a device that is about to be left
PTY_MAJORS = range(136, 144)
PARITIES = {"none": "N", "even": "E", "odd": "O", "mark": "M", "space": "S"}
DENIED = (errno.EACCES, errno.EPERM)
BUSY = (errno.EAGAIN, errno.EBUSY)


class _Port(pyserial.Serial):
    """pyserial, without its habit of discarding what arrived before the port was opened.

    It leaves what an earlier user has set: that a break empties the kernel's queue, that torn bytes are left out.
    """

    def _reset_input_buffer(self) -> None:
        pass

    def _reconfigure_port(self, force_update: bool = False) -> None:
        assert self.fd is not None
        settings = termios.tcgetattr(self.fd)
        settings[0] &= ~(termios.BRKINT | termios.IGNPAR)
        termios.tcsetattr(self.fd, termios.TCSANOW, settings)
        super()._reconfigure_port(force_update)  # type: ignore[misc]


def open_port(config: SerialConfig) -> _Port:
    """The opened port.  Raises PortAbsent, PortDenied, PortBusy with a hint, or LinkError."""
    port = _Port(
        baudrate=config.baud,
        bytesize=config.data_bits,
        parity=PARITIES[config.parity],
        stopbits=config.stop_bits,
        rtscts=config.flow == "rtscts",
        xonxoff=config.flow == "xonxoff",
        exclusive=True,
        inter_byte_timeout=0,  # VMIN 1: else a read of nothing looks like a device that went away
    )
    if config.rs485 != "none" and not is_pty(config.port):
        high = config.rs485 == "rts_high"
        port.rs485_mode = RS485Settings(rts_level_for_tx=high, rts_level_for_rx=not high, loopback=config.echo)
    if is_pty(config.port):
        port.bytesize, port.parity, port.rtscts, port.xonxoff = 8, PARITIES["none"], False, False
    port.port = config.port
    try:
        port.open()
    except (OSError, ValueError, termios.error) as error:  # pyserial's exception is an OSError
        raise _open_error(config, error) from None
    return port


def is_pty(port: str) -> bool:
    """The path leads to the slave of a pseudo terminal."""
    try:
        status = Path(port).stat()
    except OSError:
        return False
    return stat.S_ISCHR(status.st_mode) and os.major(status.st_rdev) in PTY_MAJORS


def _open_error(config: SerialConfig, error: Exception) -> LinkError:
    """Why the port cannot be opened, in words that help."""
    port, number = config.port, getattr(error, "errno", None)
    if number in DENIED:
        return PortDenied(f"{port}: permission denied; the user must be in group {group_of(Path(port))}")
    if number in BUSY:
        return PortBusy(f"{port}: in use by another program")
    if "RS485" in str(error):
        return LinkError(
            f'{port}: its driver does not switch the direction of an RS-485 line; leave out rs485 = "{config.rs485}" '
            "where the adapter does that itself"
        )
    if number is None and Path(port).exists():
        settings = f"{config.baud} baud, {config.data_bits} bits, parity {config.parity}, {config.stop_bits} stop bits"
        return LinkError(f"{port}: does not take {settings}: {error}")
    return PortAbsent(f"{port}: no such port; there are {', '.join(serial_names()) or 'none'}")


class SerialPortLink(BaseLink):
    """The life of anything on a serial line; ``_deliver`` says what becomes of a read."""

    receives_pieces = True

    def __init__(self, config: SerialConfig, clock: Clock, sink: Sink, on_connect: Sequence[bytes] = ()) -> None:
        super().__init__(config.name, config.transmit, clock, sink, on_connect)
        self._config = config
        self._port: _Port | None = None
        self._fd = -1
        self._device = 0
        self._errors = LineWatch(self.status.errors)

    async def _open(self) -> None:
        self._port = open_port(self._config)
        self._fd = self._port.fileno()
        self._device = os.fstat(self._fd).st_rdev
        self._errors.begin(self._fd, self._clock.now_ns())
        asyncio.get_running_loop().add_reader(self._fd, self._on_readable)

    def _close(self) -> None:
        if self._port is None:
            return
        loop = asyncio.get_running_loop()
        loop.remove_reader(self._fd)
        loop.remove_writer(self._fd)
        self._errors.read(self._fd)
        if os.major(self._device) not in PTY_MAJORS:
            with contextlib.suppress(termios.error):
                termios.tcflush(self._fd, termios.TCOFLUSH)  # else closing waits up to 30 s for a stopped device
        self._port.close()
        self._port, self._fd = None, -1

    def _read(self) -> bool:
        try:
            data = os.read(self._fd, READ_BYTES)
        except BlockingIOError:
            return False
        t_rx_ns = self._clock.now_ns()
        if not data:
            raise PortAbsent(f"{self._config.port}: the device went away")
        self._deliver(data, t_rx_ns)
        return True

    def _deliver(self, data: bytes, t_rx_ns: int) -> None:
        self._receive((data,), (t_rx_ns,))

    async def _write(self, data: bytes) -> None:
        sent = 0
        try:
            while sent < len(data):
                try:
                    size = os.write(self._fd, memoryview(data)[sent:])
                except BlockingIOError:
                    await self._writable(self._fd)
                else:
                    self._on_written(data[sent : sent + size])
                    sent += size
        finally:
            if 0 < sent < len(data):
                self._partial_sends.append(f"its first {sent} bytes are sent")
                self._on_partial_write(data[:sent])

    def _on_written(self, data: bytes) -> None:
        """The kernel has taken these bytes."""

    def _on_partial_write(self, data: bytes) -> None:
        """Sending was given up halfway: what is on the line already stands in the file, too."""
        self._count_sent(data)

    def _check(self) -> None:
        super()._check()
        self._errors.look(self._fd, self._clock.now_ns())
        try:
            device = Path(self._config.port).stat().st_rdev
        except OSError:
            return  # the name is gone; the device itself still answers, or reading says that it does not
        if device != self._device:
            for _ in range(MAX_FINAL_READS):
                if not self._read():
                    break
            raise PortAbsent(f"{self._config.port}: leads to another device now")

    def _silent_hint(self) -> str:
        return (
            f"{self._config.port} is open at {self._config.baud} baud and nothing arrives: is the device on, "
            "are RX and TX the right way round?"
        )
