"""Clock and ports of the emulator: those of this machine in real time, or others such as in-memory ones."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar, Protocol

from fti.clock import Clock, SystemClock
from fti.config import Link
from fti.hil.ports.endpoints import Endpoint, make_endpoint
from fti.hil.ports.real_port import RealPort
from fti.hil.ports.serial_base import Notifier, Responder
from fti.hil.scheduler import Stream


class IoBackend(Protocol):
    """Clock, ports and additional streams of an emulator.  is_real_time : time passes during computations"""

    clock: Clock
    is_real_time: ClassVar[bool]

    def make_endpoint(self, link: Link, respond: Responder) -> Endpoint:
        """The far end of a link; respond : returns the answers of its devices."""

    async def sleep(self, seconds: float) -> None:
        """Wait for a time of ``clock``."""

    def streams(self, start_ns: int) -> Sequence[Stream]:
        """Streams in addition to those of the devices, for a flight that begins at start_ns (FTI time)."""


class PortBackend:
    """Ports of this machine, in real time.

    links_dir  : folder of the symlinks to ptys; epoch_ns : as SystemClock
    real_ports : links that end outside this machine; notify : called with messages for the user
    """

    is_real_time: ClassVar[bool] = True

    def __init__(
        self,
        links_dir: Path,
        epoch_ns: int,
        real_ports: Mapping[str, RealPort] = MappingProxyType({}),
        notify: Notifier = lambda _: None,
    ) -> None:
        self.clock: Clock = SystemClock(epoch_ns)
        self._folder, self._real_ports, self._notify = links_dir, real_ports, notify

    def make_endpoint(self, link: Link, respond: Responder) -> Endpoint:
        """A pty, a socket or a node on a bus."""
        port = self._real_ports.get(link.name)
        return make_endpoint(link, self._folder, respond, paced=True, notify=self._notify, port=port)

    async def sleep(self, seconds: float) -> None:
        """Wait."""
        await asyncio.sleep(seconds)

    def streams(self, start_ns: int) -> Sequence[Stream]:
        """None."""
        return ()
