"""A child process of the supervisor: start, exit, restart, standby process."""

from __future__ import annotations

import contextlib
import math
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple, Protocol

from fti.messages.control import FromChild
from fti.service.control_channel import ControlChannel, send_startup

#: Linear algebra in one thread: a thread pool in navigation would take the processors from the recorder, and on busy
#: processors it waits for its own threads a hundred times longer than it calculates.
SINGLE_THREAD_ENV = {"OPENBLAS_NUM_THREADS": "1"}
#: Minimum time between two spawns of a standby process.
STANDBY_PERIOD_S = 5.0


FIRST_DELAY_S = 0.05
MAX_DELAY_S = 5.0
#: A child that has run for this time has recovered; its next restart delay is the first one again.
RECOVERED_S = 30.0
#: A recorder is not restarted at once after this many consecutive exits within this time after the start.
EARLY_DEATH_S = 1.0
MAX_EARLY_DEATHS = 3
FIRST_BACK_OFF_S = 0.5


class RestartDelay(Protocol):
    """Delay before a child is restarted.  early_deaths : number of consecutive exits soon after the start"""

    early_deaths: int

    def after_death(self, lived_s: float) -> float:
        """The delay of the next restart [s].  lived_s : run time of the child"""


class DoublingDelay:
    """For a child without a standby process: each delay is twice the last one, until the child has recovered."""

    def __init__(self) -> None:
        self.early_deaths = 0
        self._next_s = FIRST_DELAY_S

    def after_death(self, lived_s: float) -> float:
        """See ``RestartDelay``."""
        if lived_s > RECOVERED_S:
            self._next_s = FIRST_DELAY_S
        delay_s, self._next_s = self._next_s, min(2 * self._next_s, MAX_DELAY_S)
        return delay_s


class StandbyDelay:
    """For a child with a standby process: no delay, except after repeated exits soon after the start."""

    def __init__(self) -> None:
        self.early_deaths = 0

    def after_death(self, lived_s: float) -> float:
        """See ``RestartDelay``."""
        self.early_deaths = self.early_deaths + 1 if lived_s < EARLY_DEATH_S else 0
        excess = self.early_deaths - MAX_EARLY_DEATHS
        if excess < 0:
            return 0.0
        return float(min(FIRST_BACK_OFF_S * 2 ** min(excess, 10), MAX_DELAY_S))


class ProcessState(StrEnum):
    """State of a process, as the display shows it."""

    STARTING = "starting"
    RUNNING = "running"
    RESTARTING = "restarting"
    STOPPED = "stopped"


class WaitingProcess(NamedTuple):
    """A process that waits for its startup message, and our end of its control channel."""

    process: subprocess.Popen[bytes]
    socket: socket.socket


@dataclass(slots=True)
class Child:
    """One child.  It inherits its end of the control channel and receives startup message and ring over it.

    It is spawned, not forked, and has its own process group: Ctrl-C reaches only the supervisor.
    has_standby : a second process always waits, so that a process that dies is replaced at once
    delay_s     : delay of the restart after an exit [s]
    """

    name: str
    startup: bytes | None = None
    ring_fds: tuple[int, int] | None = None
    arguments: Sequence[str] = ()
    has_standby: bool = False
    state: ProcessState = ProcessState.STOPPED
    restarts: int = 0
    channel: ControlChannel | None = None
    process: subprocess.Popen[bytes] | None = None
    delay_s: float = 0.0
    _waiting: WaitingProcess | None = None
    _spawned: float = -math.inf
    _started: float = 0.0
    _restart_at: float = 0.0
    _delay: RestartDelay = field(default_factory=DoublingDelay)

    def __post_init__(self) -> None:
        if self.has_standby:
            self._delay = StandbyDelay()

    @property
    def early_deaths(self) -> int:
        """Number of consecutive exits soon after the start."""
        return self._delay.early_deaths

    def ensure_standby(self) -> None:
        """Spawn a standby process if none waits while the process runs."""
        if self.has_standby and self.process and time.monotonic() >= self._spawned + STANDBY_PERIOD_S:
            self.prepare()

    def prepare(self) -> None:
        """Spawn a process that loads its libraries and waits for its startup message, unless one waits."""
        if self._waiting is not None:
            if self._waiting.process.poll() is None:
                return
            self._waiting.socket.close()  # it died while it waited
        self._waiting = self._spawn()
        self._spawned = time.monotonic()

    def _spawn(self) -> WaitingProcess:
        ours, theirs = socket.socketpair()
        process = subprocess.Popen(
            [sys.executable, "-m", f"fti.service.{self.name}", "--control-fd", str(theirs.fileno()), *self.arguments],
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            env={**os.environ, **SINGLE_THREAD_ENV},
            process_group=0,
        )
        theirs.close()
        return WaitingProcess(process, ours)

    def start(self) -> ControlChannel:
        """Send the waiting process (or a new one) its startup message; returns our end of its control channel."""
        self.prepare()
        assert self._waiting is not None
        self.process, sock = self._waiting
        self._waiting, self._spawned = None, -math.inf  # the next standby process is spawned at once
        if self.startup is not None and self.ring_fds is not None:
            with contextlib.suppress(OSError):  # it has just died, which ``poll_exit`` reports
                send_startup(sock, self.startup, self.ring_fds)
        self.channel = ControlChannel(sock, FromChild)
        self.state = ProcessState.STARTING
        self._started = time.monotonic()
        return self.channel

    @property
    def pid(self) -> int | None:
        """Process number while it runs."""
        return self.process.pid if self.process else None

    def poll_exit(self) -> int | None:
        """The exit code, once, after the process has ended; the state is then RESTARTING.

        The channel stays open, so that the last messages can be received.
        """
        code = self.process.poll() if self.process else None
        if code is None:
            return None
        now = time.monotonic()
        self.delay_s = self._delay.after_death(now - self._started)
        self._restart_at = now + self.delay_s
        self.process = None
        self.state = ProcessState.RESTARTING
        return code

    def restart_is_due(self) -> bool:
        """The process has ended and the restart delay is over."""
        return self.state is ProcessState.RESTARTING and time.monotonic() >= self._restart_at

    def kill(self) -> None:
        """Kill the process, also when it is stopped."""
        if self.process:
            self.process.send_signal(signal.SIGKILL)

    def close(self) -> None:
        """Close our end of the channel; the child then exits."""
        if self.channel:
            self.channel.close()
            self.channel = None

    def dismiss(self) -> None:
        """Close the channels of the process and of the standby process, and wait until both have ended."""
        self.close()
        if self._waiting:
            self._waiting.socket.close()
            self._waiting.process.wait()
            self._waiting = None
        if self.process:
            self.process.wait()
