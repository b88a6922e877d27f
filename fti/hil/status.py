"""Status of the emulator or a replay for the page and ``fti watch``: twice a second on the daemon's bus, ``/hil``.

scenario, flight_s, duration_s     title; time of the flight, null before it begins; its duration [s]
devices   {name: link, asked_hz, messages, breaker (null: without breaker), faults (kinds that name it)}
links     {name: messages, bytes, dropped_messages, dropped_bytes, received_bytes}
faults    active faults: kind, words, on, until_s
supply_v  voltage before the breakers [V]
lateness  messages, p50_ms, p99_ms, max_ms; holds: every device holds its rate; not_held: devices that do not, and why

A replay has no devices, breakers and faults.  Its scenario is the name of the session, its time that of the recording.

A thread publishes the status.  The flight does not depend on it and runs without a daemon.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any

from fti.bus.client import Publisher
from fti.bus.frame import SOCKET_NAME
from fti.bus.message import encode_with_age
from fti.clock import Clock
from fti.errors import MissingError
from fti.hil.emulator import Emulator
from fti.hil.event_loop import realtime_priority
from fti.hil.faults import descriptions
from fti.hil.replay import Replay
from fti.run_directory import base, find_daemon

TOPIC = "/hil"
PROCESS = "emulator"
PERIOD_S = 0.5
#: An older status is late [ms].
MAX_AGE_MS = 1500.0


def describe(emulator: Emulator) -> dict[str, Any]:
    """The status message of an emulator, as JSON types."""
    report, t = emulator.brief_report, emulator.flight_s
    problems = report.problems
    faults = list(descriptions.active_faults(emulator.scenario.fault, t or 0.0))
    return {
        "scenario": emulator.scenario.title,
        "flight_s": t,
        "duration_s": emulator.duration_s,
        "devices": _devices(emulator, faults),
        "links": {name: asdict(counters) for name, counters in report.links.items()},
        "faults": faults,
        "supply_v": emulator.power.volts,
        "lateness": asdict(report.lateness),
        "holds": not problems,
        "not_held": problems,
    }


def describe_replay(replay: Replay, title: str, length_s: float | None) -> dict[str, Any]:
    """The status message of a replay.  title : of the session; length_s : its duration [s], None when unknown"""
    report = replay.report
    return {
        "scenario": title,
        "flight_s": replay.position_s,
        "duration_s": replay.position_s if length_s is None else length_s,
        "devices": {},
        "links": {name: asdict(counters) for name, counters in report.links.items()},
        "faults": [],
        "supply_v": None,
        "lateness": asdict(report.lateness),
        "holds": not report.problems,
        "not_held": report.problems,
    }


def _devices(emulator: Emulator, faults: list[dict[str, Any]]) -> dict[str, Any]:
    states, messages = emulator.power.states(), emulator.messages
    return {
        sensor.name: {
            "link": sensor.link,
            "asked_hz": sensor.rate_hz,
            "messages": messages.get(sensor.name, 0),
            "breaker": states.get(sensor.name),
            "faults": [fault["kind"] for fault in faults if sensor.name in fault["on"]],
        }
        for sensor in emulator.sensors
    }


class StatusPublisher:
    """Publishes in a thread while the block lasts, whenever a daemon runs.

    describe : returns the message; clock : its time; name : of the daemon's session
    run_dir  : of the daemon; None: the run directory of that name
    """

    def __init__(self, describe: Callable[[], dict[str, Any]], clock: Clock, name: str, run_dir: str | None) -> None:
        self._describe, self._clock = describe, clock
        self._run_dir = run_dir or str(base() / name)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="fti-hil-status")
        self._publisher: Publisher | None = None

    def __enter__(self) -> StatusPublisher:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join()

    def _run(self) -> None:
        """Publish with real-time priority, because a wait for a core with the interpreter lock delays the sender."""
        with realtime_priority():
            while not self._ended.wait(PERIOD_S):
                if publisher := self._join():
                    t_ns = self._clock.now_ns()
                    content = encode_with_age(self._describe(), t_ns, self._clock.now_ns(), MAX_AGE_MS)
                    publisher.publish(TOPIC, content)
            self._leave()

    def _join(self) -> Publisher | None:
        """Connect to the bus of a running daemon, also after its restart.  None: no daemon runs."""
        try:
            find_daemon(self._run_dir)
        except MissingError:
            self._leave()
            return None
        if self._publisher is None:
            self._publisher = Publisher(Path(self._run_dir) / SOCKET_NAME, PROCESS)
        return self._publisher

    def _leave(self) -> None:
        if self._publisher is not None:
            self._publisher.close()
        self._publisher = None
