"""The research aircraft flown past a real daemon, with a range sensor beside its own: processor time of each process.

Serial lines and CAN adapters are ptys, datagrams go over loopback.  The filter, which looks at the ground need, is in
every configuration, so that the difference between two of them is that of the sensor.
"""

from __future__ import annotations

import json
import queue
import re
import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.parts.machine import cpu_s
from benchmarks.parts.processes import ROOT
from fti import config as configuration
from fti.bus.client import Subscriber
from fti.bus.frame import SOCKET_NAME
from fti.logger.reading.recording import Recording
from fti.service.navigation.kernel_compiler import ensure_kernels_compiled
from tests.e2e.flights import config_on_free_ports, emulator
from tests.e2e.harness import END_S, START_S, Daemon, daemon, fti
from tests.helpers import until

CONFIGS = ROOT / "configs"
FILTER = '\n[nav.filter]\nimu = "ins_fast"\ngnss = ["gnss_receiver"]\nbaro = "air_data"\n'
PROCESSES = ("recorder", "navigation")
POLL_S = 0.2
#: The processor time counts from this time of the flight on [s], when the filter is aligned.
SETTLE_S = 10.0
#: Straight on above a valley, at one altitude, 37 to 96 m above the ground.
SCENARIO = """
title = "Along a valley"
description = ""
config = "unused"
[flight]
kind = "waypoints"
[[flight.waypoint]]
lat_deg = 36.6262
lon_deg = -84.1228
alt_m = 415.0
speed_mps = 60.0
[[flight.waypoint]]
lat_deg = 36.6200
lon_deg = -84.1600
alt_m = 415.0
speed_mps = 60.0
"""


def research_text() -> str:
    """The configuration of the research aircraft on this computer, with a filter."""
    text = (CONFIGS / "research_aircraft.toml").read_text(encoding="utf-8")
    text = re.sub(r'"\d+\.\d+\.\d+\.\d+(:\d+)?"', lambda found: f'"127.0.0.1{found[1] or ""}"', text)
    text = re.sub(r'"socketcan"\nchannel = "(\w+)"', r'"slcan"\nchannel = "/dev/\1"', text)
    return text.replace('"calibrations/', f'"{CONFIGS}/calibrations/') + FILTER


@dataclass
class Round:
    """A flight.

    observed_s : time of the flight that is measured [s]
    backlog_s  : by which navigation was later at its end than at its begin [s]
    cpu        : processor time of each process over the time of the flight that it has processed: a share of a core
    lag_ms     : of navigation, in each health;  delay_ms : p50, p99 and largest delay of its outputs, over 5 s each
    dropped    : frames dropped by buffers and kernel, on all links
    sent, recorded : datagrams of the range sensors;  late_ms : p50 and p99 lateness of the emulator on their links
    pairs, found   : pairs of looks, and those with a drift
    verified   : ``fti verify`` finds nothing wrong
    """

    observed_s: float = 0.0
    backlog_s: float = 0.0
    cpu: dict[str, float] = field(default_factory=dict)
    lag_ms: list[float] = field(default_factory=list)
    delay_ms: list[tuple[float, float, float]] = field(default_factory=list)
    dropped: int = 0
    sent: int = 0
    recorded: int = 0
    late_ms: tuple[float, float] = (0.0, 0.0)
    pairs: int = 0
    found: int = 0
    verified: bool = False

    @property
    def total(self) -> float:
        """Processor time of recorder and navigation, as a share of a core."""
        return sum(self.cpu.values())


class _Health:
    """Health of a daemon, kept in a round."""

    def __init__(self, running: Daemon) -> None:
        self._messages = queue.SimpleQueue[bytes]()
        self._subscriber = Subscriber(Path(running.info["sock"]).with_name(SOCKET_NAME), "benchmark", self._on_message)

    def _on_message(self, topic: str, payload: bytes, sent_ns: int) -> None:
        if topic == "/health":
            self._messages.put(payload)

    def close(self) -> None:
        """Close the subscription."""
        self._subscriber.close()

    def add_to(self, result: Round) -> None:
        """Add what has come."""
        for health in [json.loads(self._messages.get()) for _ in range(self._messages.qsize())]:
            links, navigation = health["links"].values(), health["navigation"]
            result.dropped = sum(link["dropped_frames"] for link in links)
            result.lag_ms.append(navigation["lag_ms"])
            if delay := navigation["output_delay"]:
                result.delay_ms.append((delay["p50_ms"], delay["p99_ms"], delay["max_ms"]))


def fly(text: str, sensor_links: Sequence[str], duration_s: float) -> Round:
    """Fly a configuration for a duration [s].  sensor_links : of the range sensors"""
    result = Round()
    with tempfile.TemporaryDirectory(prefix="fti-ground-drift-") as name, ExitStack() as stack:
        folder = Path(name)
        (folder / "written.toml").write_text(text)
        config = config_on_free_ports(folder / "written.toml", folder / "flown")
        ensure_kernels_compiled(configuration.load(config))
        (folder / "valley.toml").write_text(SCENARIO)
        links, report = folder / "links", folder / "report.json"
        arguments = ("--wait", "--duration", str(duration_s), "--report", str(report))
        running = stack.enter_context(daemon(config, folder / "out", "--links", str(links), "--origin", "hil"))
        until(lambda: running.health()["navigation"].get("lag_ms") is not None, START_S, "navigation")
        flying = stack.enter_context(emulator(str(folder / "valley.toml"), config, links, *arguments))
        until(lambda: flying.poll() is not None or _has_frames(running), START_S, "frames")
        time.sleep(SETTLE_S)
        _observe(running, flying, result)
        assert flying.wait(timeout=duration_s + END_S) == 0, config.with_name("emulator.txt").read_text()
        session = running.session
        running.stop()
        result.verified = fti("verify", str(session), timeout=END_S).returncode == 0
        _read(result, session, json.loads(report.read_text()), sensor_links)
    return result


def _has_frames(running: Daemon) -> bool:
    return any(link["frames"] for link in running.health()["links"].values())


def _observe(running: Daemon, flying: subprocess.Popen[str], result: Round) -> None:
    """Processor times and health until the flight ends."""
    pids = {name: running.pid_of(name) for name in PROCESSES}
    first_lag_s = 1e-3 * running.health()["navigation"]["lag_ms"]
    health, begin = _Health(running), time.monotonic()
    before = {name: cpu_s(pid) for name, pid in pids.items()}
    used = dict.fromkeys(pids, 0.0)
    while flying.poll() is None:
        result.observed_s = time.monotonic() - begin
        used = {name: cpu_s(pid) - before[name] for name, pid in pids.items()}
        time.sleep(POLL_S)
    health.close()
    health.add_to(result)
    result.backlog_s = 1e-3 * result.lag_ms[-1] - first_lag_s
    processed_s = {"recorder": result.observed_s, "navigation": result.observed_s - result.backlog_s}
    result.cpu = {name: used[name] / processed_s[name] for name in pids}


def _read(result: Round, session: Path, report: dict[str, Any], links: Sequence[str]) -> None:
    """What the emulator sent, and what was recorded."""
    if not links:
        return
    recording = Recording.open(session)
    result.recorded = sum(frame.link in links for frame in recording.frames())
    counters = [report["links"][link] for link in links]
    result.sent = sum(each["messages"] for each in counters)
    late = [each["lateness"] for each in counters]
    result.late_ms = max(each["p50_ms"] for each in late), max(each["p99_ms"] for each in late)
    rows = [json.loads(data) for *_, data in recording.messages("/nav/ground_drift", kind="derived")]
    looks = {row["t_valid_ns"]: row for row in rows if row["pairs"]}
    result.pairs, result.found = len(looks), sum(bool(row["directions"]) for row in looks.values())
