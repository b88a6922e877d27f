"""Where the emulated devices stand: on the ports of this machine and in its time, or elsewhere."""

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
    """What an emulator needs of the world outside.  is_real_time : time passes while something is computed"""

    clock: Clock
    is_real_time: ClassVar[bool]

    def make_endpoint(self, link: Link, respond: Responder) -> Endpoint:
        """The far end of a link; respond : what its devices answer."""

    async def sleep(self, seconds: float) -> None:
        """Let time pass."""

    def streams(self, start_ns: int) -> Sequence[Stream]:
        """What happens beside the devices in a flight that begins at start_ns (FTI time)."""


class PortBackend:
    """Ports of this machine, in real time.

    links_dir : where the symlinks to ptys stand; epoch_ns : as SystemClock
    outside   : links that end outside this machine; tell : told of what a person at the bench should know
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
        """A pty, a socket, a node on a bus."""
        port = self._real_ports.get(link.name)
        return make_endpoint(link, self._folder, respond, paced=True, notify=self._notify, port=port)

    async def sleep(self, seconds: float) -> None:
        """Wait."""
        await asyncio.sleep(seconds)

    def streams(self, start_ns: int) -> Sequence[Stream]:
        """Nothing."""
        return ()
