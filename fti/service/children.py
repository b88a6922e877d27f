"""A child process of the supervisor: started, watched, started again."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from fti.service.control import Channel, make_memory_file

FIRST_RESTART_S = 0.05
LONGEST_RESTART_S = 5.0
#: A child that has run for so long has recovered; its next restart is quick again.
RECOVERED_S = 30.0


class ProcessState(StrEnum):
    """What the display shows of a process."""

    STARTING = "starting"
    RUNNING = "running"
    RESTARTING = "restarting"
    STOPPED = "stopped"


@dataclass(slots=True)
class Child:
    """One child.  It gets an order (a memory file), a control channel and the ring, all as inherited descriptors.

    It is never forked from us, and has a process group of its own: Ctrl-C goes to the supervisor alone.
    """

    name: str
    order: bytes | None = None
    ring_fd: int | None = None
    arguments: Sequence[str] = ()
    state: ProcessState = ProcessState.STOPPED
    restarts: int = 0
    channel: Channel | None = None
    process: subprocess.Popen[bytes] | None = None
    _started: float = 0.0
    _restart_at: float = 0.0
    _delay: float = field(default=FIRST_RESTART_S)

    def start(self) -> Channel:
        """Start the process; returns our end of its control channel."""
        ours, theirs = socket.socketpair()
        inherited = {"--control-fd": theirs.fileno()}
        if self.order is not None:
            inherited["--init-fd"] = make_memory_file(f"fti-{self.name}", self.order)
        if self.ring_fd is not None:
            inherited["--ring-fd"] = self.ring_fd
        options = [text for name, fd in inherited.items() for text in (name, str(fd))]
        self.process = subprocess.Popen(
            [sys.executable, "-m", f"fti.service.{self.name}", *options, *self.arguments],
            pass_fds=list(inherited.values()),
            stdin=subprocess.DEVNULL,
            process_group=0,
        )
        theirs.close()
        if self.order is not None:
            os.close(inherited["--init-fd"])
        self.channel = Channel(ours)
        self.state = ProcessState.STARTING
        self._started = time.monotonic()
        return self.channel

    @property
    def pid(self) -> int | None:
        """Process number while it runs."""
        return self.process.pid if self.process else None

    def died(self) -> int | None:
        """The exit code, once, when the process has ended; afterwards it waits for its restart."""
        code = self.process.poll() if self.process else None
        if code is None:
            return None
        if time.monotonic() - self._started > RECOVERED_S:
            self._delay = FIRST_RESTART_S
        self._restart_at = time.monotonic() + self._delay
        self._delay = min(2 * self._delay, LONGEST_RESTART_S)
        self.process = None
        self.state = ProcessState.RESTARTING
        self.close()
        return code

    def restart_is_due(self) -> bool:
        """It has died, and has waited long enough."""
        return self.state is ProcessState.RESTARTING and time.monotonic() >= self._restart_at

    def kill(self) -> None:
        """End it now, also when it is stopped."""
        if self.process:
            self.process.send_signal(signal.SIGKILL)

    def close(self) -> None:
        """Close our end of the channel."""
        if self.channel:
            self.channel.close()
            self.channel = None
