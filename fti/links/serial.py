"""Serial lines: RS-232, RS-422, RS-485 behind a tty, or a pty.

Opened exclusively, in raw mode, without discarding received data.  One read is one frame.  The path identifies the
port: when a symbolic link changes to another device, that device is opened.  A pty has no wire, hence no parity, 8 data
bits, no flow control and no direction control: these settings are ignored.
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
MAX_FINAL_READS = 1000  # from a device that is about to be closed
PTY_MAJORS = range(136, 144)
PARITIES = {"none": "N", "even": "E", "odd": "O", "mark": "M", "space": "S"}
DENIED = (errno.EACCES, errno.EPERM)
BUSY = (errno.EAGAIN, errno.EBUSY)


class _Port(pyserial.Serial):
    """pyserial without discarding the data that arrived before the port was opened.

    It also clears settings that pyserial leaves: flush of the kernel's queue on a break, suppression of damaged bytes.
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
        inter_byte_timeout=0,  # VMIN 1: otherwise an empty read looks like a removed device
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
    """Is the port the slave of a pseudo terminal?"""
    try:
        status = Path(port).stat()
    except OSError:
        return False
    return stat.S_ISCHR(status.st_mode) and os.major(status.st_rdev) in PTY_MAJORS


def _open_error(config: SerialConfig, error: Exception) -> LinkError:
    """The error of a failed opening, with a hint."""
    port, number = config.port, getattr(error, "errno", None)
    if number in DENIED:
        return PortDenied(f"{port}: permission denied; the user must be in group {group_of(Path(port))}")
    if number in BUSY:
        return PortBusy(f"{port}: in use by another program")
    if "RS485" in str(error):
        return LinkError(
            f'{port}: its driver does not switch the direction of an RS-485 line; remove rs485 = "{config.rs485}" '
            "if the adapter switches it"
        )
    if number is None and Path(port).exists():
        settings = f"{config.baud} baud, {config.data_bits} bits, parity {config.parity}, {config.stop_bits} stop bits"
        return LinkError(f"{port}: does not accept {settings}: {error}")
    return PortAbsent(f"{port}: no such port; present: {', '.join(serial_names()) or 'none'}")


class SerialPortLink(BaseLink):
    """A link on a serial port; ``_deliver`` processes a read."""

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
                termios.tcflush(self._fd, termios.TCOFLUSH)  # otherwise closing waits up to 30 s for a stopped device
        self._port.close()
        self._port, self._fd = None, -1

    def _read(self) -> bool:
        try:
            data = os.read(self._fd, READ_BYTES)
        except BlockingIOError:
            return False
        t_rx_ns = self._clock.now_ns()
        if not data:
            raise PortAbsent(f"{self._config.port}: the device was removed")
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
        """The kernel has accepted these bytes."""

    def _on_partial_write(self, data: bytes) -> None:
        """Sending was aborted halfway: record the bytes that were sent."""
        self._count_sent(data)

    def _check(self) -> None:
        super()._check()
        self._errors.read_if_due(self._fd, self._clock.now_ns())
        try:
            device = Path(self._config.port).stat().st_rdev
        except OSError:
            return  # the path was removed; the device may still work, otherwise reading fails
        if device != self._device:
            for _ in range(MAX_FINAL_READS):
                if not self._read():
                    break
            raise PortAbsent(f"{self._config.port}: is another device now")

    def _silent_hint(self) -> str:
        return (
            f"{self._config.port} is open at {self._config.baud} baud and nothing arrives: is the device on, "
            "are RX and TX the right way round?"
        )
