"""CAN buses through python-can.

SocketCAN is read with ``recvmmsg`` on the socket of the bus: kernel stamps, drop counter, a receive buffer of 4 MiB
(the default loses frames silently).  The kernel reports once that an interface goes down; the same socket works again
when the interface is up.  Other interfaces are read by the loop if they have a file descriptor, otherwise by one
blocking thread that hands each frame to the loop; their frames are stamped when they are read.

Frames are ``can_frame`` (16 B) or ``canfd_frame`` (72 B), see ``fti.canframe``.  Frames that this link sent are
recorded as sent, not as received.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import functools
import os
import socket
from collections import deque
from collections.abc import Sequence
from itertools import compress
from typing import Any, cast

import can
from can.interfaces.socketcan import SocketcanBus

from fti import canframe
from fti.clock import Clock
from fti.config import CanLink
from fti.errors import ConfigError, LinkError, PortAbsent, PortBusy, PortDenied
from fti.links._beat_scheduler import unwatch, watch
from fti.links._recvmmsg import MAX_DATAGRAMS
from fti.links._thread_reader import ThreadReader
from fti.links.base import BaseLink, Sink
from fti.links.can_errors import ControllerWatch, count_error, is_error
from fti.links.ports import can_interfaces
from fti.links.sockets import Arrival, enlarge, prepare
from fti.messages.frames import LinkState

RETRY_S = 0.002  # CAN has no writable event for a full transmit queue (ENOBUFS)
MAX_ERRORS = 100  # consecutive errors without a frame: then the bus is reopened
MAX_ECHOES = 64
SEND_S = 1.0  # timeout of a python-can driver
MAX_FINAL_BATCHES = 1000  # from an interface that was removed
#: Counter in the errors of the link: frames that the library or its driver could not read.
UNREADABLE = "can_unreadable"
#: Interfaces whose bit rate the program does not set.
NO_BITRATE = ("socketcan", "udp_multicast", "virtual")


def pack_message(message: can.Message) -> bytes:
    """The bytes of a python-can message."""
    data = bytes(message.dlc) if message.is_remote_frame else bytes(message.data)
    frame = canframe.pack_can(
        message.arbitration_id,
        data,
        extended=message.is_extended_id and not message.is_error_frame,
        remote=message.is_remote_frame,
        error=message.is_error_frame,
        fd=message.is_fd,
    )
    return frame if not message.bitrate_switch else frame[:5] + bytes([frame[5] | canframe.FD_BRS]) + frame[6:]


def unpack_message(frame: bytes) -> can.Message:
    """The python-can message of a frame."""
    can_frame = canframe.unpack_can(frame)
    return can.Message(
        arbitration_id=can_frame.can_id,
        is_extended_id=can_frame.extended,
        is_remote_frame=can_frame.remote,
        is_error_frame=can_frame.error,
        is_fd=can_frame.fd,
        bitrate_switch=can_frame.fd and bool(frame[5] & canframe.FD_BRS),
        dlc=len(can_frame.data),
        data=None if can_frame.remote else can_frame.data,
    )


class CanBusLink(BaseLink):
    """One CAN bus."""

    def __init__(self, config: CanLink, clock: Clock, sink: Sink, on_connect: Sequence[bytes] = ()) -> None:
        super().__init__(config.name, config.transmit, clock, sink, on_connect)
        if config.interface not in can.VALID_INTERFACES:
            allowed = ", ".join(sorted(can.VALID_INTERFACES))
            raise ConfigError(f"link {config.name}: interface = {config.interface!r}: allowed are {allowed}")
        self._config = config
        self._bus: can.BusABC | None = None
        self._socket: socket.socket | None = None  # of SocketCAN
        self._queue: socket.socket | None = None  # the socket with the drop counter
        self._arrival = Arrival(clock, self.status)
        self._reader: ThreadReader | None = None
        self._fd = -1
        self._errors = 0
        self._controller = ControllerWatch(self.status.errors, config.channel)
        self._echoes: deque[bytes] = deque(maxlen=MAX_ECHOES)  # sent, and not yet received back

    # --------------------------------------------------------------------------------------------- opening, closing

    async def _open(self) -> None:
        self._arrival = Arrival(self._clock, self.status)
        self._bus = await self._make_bus()
        self._errors = 0
        self._echoes.clear()
        loop = asyncio.get_running_loop()
        if self._config.interface == "socketcan":
            self._socket = cast(SocketcanBus, self._bus).socket
            prepare(self._socket)
            self._controller.begin(self._clock.now_ns())
        self._fd = _fileno(self._bus)
        self._queue = self._socket or _socket_at(self._fd)
        if self._queue:  # a bus of the library may be a socket with the default queue, a quarter of a second
            enlarge(self._queue)
        if self._socket:
            watch(self._fd, self._on_readable, is_early=self._is_early if self.urgent else None)
        elif self._fd >= 0:
            loop.add_reader(self._fd, self._on_readable)
        else:
            self._reader = ThreadReader(self._bus, self._clock, self._on_message, self._on_error, self.name)

    async def _make_bus(self) -> can.BusABC:
        """Open the bus in a thread: drivers of vendors may block for long, and other links must be read meanwhile."""
        config = self._config
        make = functools.partial(can.Bus, config.channel, config.interface, ignore_config=True, **self._arguments())
        opening = asyncio.get_running_loop().run_in_executor(None, make)
        try:
            return await asyncio.shield(opening)
        except asyncio.CancelledError:
            opening.add_done_callback(_shut_down)
            raise
        except (can.CanError, OSError, ValueError, TypeError, ImportError) as error:
            raise self._open_error(error) from None

    def _arguments(self) -> dict[str, Any]:
        config = self._config
        rate = {} if config.bitrate is None or config.interface in NO_BITRATE else {"bitrate": config.bitrate}
        fixed = {"hop_limit": 0} if config.interface == "udp_multicast" else {}  # stays on this machine
        return {**rate, **({"fd": True} if config.fd else {}), **config.settings, **fixed}

    def _open_error(self, error: Exception) -> LinkError:
        config, number = self._config, getattr(error, "errno", None)
        name = f"{config.interface} {config.channel}"
        if number in (errno.EACCES, errno.EPERM):
            return PortDenied(f"{name}: permission denied")
        if number == errno.EBUSY:
            return PortBusy(f"{name}: in use by another program")
        if config.interface == "socketcan" and number in (errno.ENODEV, errno.ENXIO):
            present = ", ".join(f"{p.name} ({p.state})" for p in can_interfaces())
            return PortAbsent(f"{name}: no such interface; present: {present or 'none'}")
        if number == errno.EAFNOSUPPORT:
            return PortAbsent(f"{name}: this kernel has no SocketCAN")
        return PortAbsent(f"{name}: cannot be opened: {error}")

    def _close(self) -> None:
        if self._fd >= 0:
            loop = asyncio.get_running_loop()
            unwatch(self._fd)
            loop.remove_reader(self._fd)
            loop.remove_writer(self._fd)
        if self._reader:
            self._reader.stop()
        if self._queue:
            self._arrival.ask_drops(self._queue)
            self._queue.close()
        if self._socket:
            self._controller.read()
        if self._bus:
            self._bus.shutdown()
        self._bus = self._socket = self._queue = self._reader = None
        self._fd = -1

    # ------------------------------------------------------------------------------------------------------ reading

    def _read(self) -> bool:
        if self._socket:
            return self._read_socket()
        for _ in range(MAX_DATAGRAMS):
            try:
                message = self._bus.recv(timeout=0) if self._bus else None
            except Exception as error:  # noqa: BLE001  a vendor's driver may raise anything; keep reading
                self._on_error(error)
                return False
            if message is None:
                return False
            self._on_message(message, self._clock.now_ns())
        return True

    def _read_socket(self) -> bool:
        try:
            return self._read_batch()
        except OSError as error:
            if error.errno != errno.ENETDOWN:
                self._read_last()
                raise
            return True  # reported once; frames arrive again when the interface is up

    def _read_last(self) -> None:
        """Read earlier frames: the kernel reports an error before them, and keeps them."""
        with contextlib.suppress(OSError):
            for _ in range(MAX_FINAL_BATCHES):
                if not self._read_batch():
                    break

    def _read_batch(self) -> bool:
        frames, times = self._arrival.read(self._fd)
        if not frames:
            return False
        count, own = len(frames), [flags & socket.MSG_CONFIRM for flags in self._arrival.batch.flags()]
        if any(own):
            foreign = [not flag for flag in own]
            frames, times = list(compress(frames, foreign)), list(compress(times, foreign))
        if frames:
            self._receive(frames, times)
        return count == MAX_DATAGRAMS

    def _on_message(self, message: can.Message, t_rx_ns: int) -> None:
        self._errors = 0
        if self._bus is None or not message.is_rx:
            return
        try:
            frame = pack_message(message)
        except ValueError:
            self._refuse()
            return
        if frame in self._echoes:
            self._echoes.remove(frame)
        else:
            self._receive((frame,), (t_rx_ns,))

    def _on_error(self, error: Exception) -> None:
        """The library could not read a frame; MAX_ERRORS in a row mean that the bus is lost."""
        self._refuse()
        self._errors += 1
        if self._errors >= MAX_ERRORS or isinstance(error, OSError):
            self._fail(LinkError(f"{self._config.interface} {self._config.channel}: {error}"))

    def _refuse(self) -> None:
        self.status.refused += 1
        self.status.errors[UNREADABLE] = self.status.refused

    async def drain(self) -> None:
        """Read the remaining frames of the kernel or the driver before the link is cancelled."""
        if self._reader is None:
            await super().drain()
            return
        await asyncio.to_thread(self._reader.finish)  # frames that it has handed to the loop are processed first

    def _receive(self, frames: Sequence[bytes], times_ns: Sequence[int]) -> None:
        for frame in filter(is_error, frames):
            count_error(self.status.errors, frame)
        super()._receive(frames, times_ns)

    def _check(self) -> None:
        if self._queue:
            self._arrival.ask_drops(self._queue)
        super()._check()
        if self._socket:
            self._controller.read_if_due(self._clock.now_ns())
        state = next((p.state for p in can_interfaces() if p.name == self._config.channel), "")
        if self._socket and state != "up":
            self.status.state = LinkState.ABSENT
            self.status.hint = f"{self._config.channel} is {state or 'gone'}: ip link set {self._config.channel} up"

    def _silent_hint(self) -> str:
        return (
            f"{self._config.interface} {self._config.channel} is open and no frame arrives: is the bus connected, "
            "terminated, and its bit rate right?"
        )

    # ------------------------------------------------------------------------------------------------------ sending

    async def _write(self, data: bytes) -> None:
        if self._socket is None:
            await self._write_bus(data)
            return
        while self._socket:
            try:
                self._socket.send(data)
                return
            except BlockingIOError:
                await self._writable(self._fd)
            except OSError as error:
                if error.errno != errno.ENOBUFS:
                    raise
                await asyncio.sleep(RETRY_S)
        raise self._not_connected()  # lost while waiting

    async def _write_bus(self, data: bytes) -> None:
        if self._bus is None:  # not open yet
            raise self._not_connected()
        message = unpack_message(data)
        if self._config.interface == "udp_multicast":
            self._echoes.append(data)  # a multicast group receives its own frames
        sending = asyncio.get_running_loop().run_in_executor(None, self._bus.send, message, SEND_S)
        try:
            await asyncio.shield(sending)
        except asyncio.CancelledError:
            await self._await_driver(sending, data)
            raise
        except Exception as error:  # noqa: BLE001  a vendor's driver may raise anything
            self._remove_echo(data)
            raise LinkError(f"link {self.name}: cannot send: {error}") from None

    async def _await_driver(self, sending: asyncio.Future[None], data: bytes) -> None:
        """Sending was aborted while the driver may continue: report and record the result of the driver."""
        await asyncio.wait([sending], timeout=2 * SEND_S)
        if not sending.done():
            self._partial_sends.append("the driver of the bus may still send it")
        elif sending.exception():
            self._remove_echo(data)
        else:
            self._partial_sends.append("the driver of the bus sent it later")
            self._count_sent(data)

    def _remove_echo(self, data: bytes) -> None:
        with contextlib.suppress(ValueError):  # received back already, or a bus without echo
            self._echoes.remove(data)


def _fileno(bus: can.BusABC) -> int:
    """File descriptor of a bus; -1 if it has none."""
    try:
        return bus.fileno()
    except (NotImplementedError, can.CanError):
        return -1


def _socket_at(fd: int) -> socket.socket | None:
    """A duplicate of the descriptor as a socket; None if it is not a socket."""
    try:
        own = os.dup(fd)
    except OSError:
        return None
    try:
        return socket.socket(fileno=own)
    except OSError:
        os.close(own)
        return None


def _shut_down(opening: asyncio.Future[can.BusABC]) -> None:
    if opening.exception() is None:
        opening.result().shutdown()
