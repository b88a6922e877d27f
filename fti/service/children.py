"""A child process of the supervisor: started, watched, started again."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

from fti.service.control import Channel, send_order

#: Linear algebra in one thread: a pool of it in navigation would take the processors from the recorder, and on busy
#: ones it waits for its own threads a hundred times longer than it calculates.
QUIET = {"OPENBLAS_NUM_THREADS": "1"}
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


class Spawned(NamedTuple):
    """A process that waits for its order, and our end of its control channel."""

    process: subprocess.Popen[bytes]
    socket: socket.socket


@dataclass(slots=True)
class Child:
    """One child.  It inherits its end of the control channel; order and ring come over it.

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
    _waiting: Spawned | None = None
    _started: float = 0.0
    _restart_at: float = 0.0
    _delay: float = field(default=FIRST_RESTART_S)

    def prepare(self) -> None:
        """Have a process at hand that has loaded what it needs and waits for its order."""
        if self._waiting is not None:
            if self._waiting.process.poll() is None:
                return
            self._waiting.socket.close()  # it died while it waited
        ours, theirs = socket.socketpair()
        process = subprocess.Popen(
            [sys.executable, "-m", f"fti.service.{self.name}", "--control-fd", str(theirs.fileno()), *self.arguments],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            env={**os.environ, **QUIET},
            process_group=0,
        )
        theirs.close()
        self._waiting = Spawned(process, ours)

    def start(self) -> Channel:
        """Give the process at hand (or a new one) its order; returns our end of its control channel."""
        self.prepare()
        assert self._waiting is not None
        self.process, sock = self._waiting
        self._waiting = None
        if self.order is not None and self.ring_fd is not None:
            with contextlib.suppress(OSError):  # it has just died, which ``died`` will tell
                send_order(sock, self.order, self.ring_fd)
        self.channel = Channel(sock)
        self.state = ProcessState.STARTING
        self._started = time.monotonic()
        return self.channel

    @property
    def pid(self) -> int | None:
        """Process number while it runs."""
        return self.process.pid if self.process else None

    def died(self) -> int | None:
        """The exit code, once, when the process has ended; afterwards it waits for its restart.

        The channel stays open: what the child said last is still to be heard.
        """
        code = self.process.poll() if self.process else None
        if code is None:
            return None
        if time.monotonic() - self._started > RECOVERED_S:
            self._delay = FIRST_RESTART_S
        self._restart_at = time.monotonic() + self._delay
        self._delay = min(2 * self._delay, LONGEST_RESTART_S)
        self.process = None
        self.state = ProcessState.RESTARTING
        return code

    def restart_is_due(self) -> bool:
        """It has died, and has waited long enough."""
        return self.state is ProcessState.RESTARTING and time.monotonic() >= self._restart_at

    def kill(self) -> None:
        """End it now, also when it is stopped."""
        if self.process:
            self.process.send_signal(signal.SIGKILL)

    def close(self) -> None:
        """Close our end of the channel: for the child, that is the end."""
        if self.channel:
            self.channel.close()
            self.channel = None

    def dismiss(self) -> None:
        """Let go of the process, and of the one that waits, and wait for their ends."""
        self.close()
        if self._waiting:
            self._waiting.socket.close()
            self._waiting.process.wait()
            self._waiting = None
        if self.process:
            self.process.wait()
