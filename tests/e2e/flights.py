"""Emulated flights past a real daemon, and what it said about them."""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from fti import config as configuration
from fti.hil import scenario as scenarios
from fti.logger.reading.recording import Recording
from fti.post import offline_run
from fti.service.navigation.kernel_compiler import ensure_kernels_compiled
from tests.e2e.harness import END_S, FTI, START_S, daemon, free_udp_port, with_free_ports
from tests.helpers import ROOT, until

DEMO = ROOT / "configs" / "demo.toml"
SECOND_NS = 1_000_000_000
MAX_FLIGHT_S = 900.0
#: A start takes both cores for seconds, which those that are flying already would miss: one at a time.
START_LOCK = threading.Lock()
Row = dict[str, Any]


def demo_config(folder: Path) -> Path:
    """The demonstration's configuration on free ports, in a folder of its own."""
    return config_on_free_ports(DEMO, folder)


def config_on_free_ports(file: Path, folder: Path) -> Path:
    """A configuration on free ports, in a folder of its own; what it names stays where it is."""
    folder.mkdir(parents=True, exist_ok=True)
    text = re.sub(r"port = 47\d{3}\b", lambda _: f"port = {free_udp_port()}", with_free_ports(file.read_text()))
    text = re.sub(r'"(profiles|calibrations|dbc)/', lambda found: f'"{file.parent}/{found[1]}/', text)
    path = folder / file.name
    path.write_text(text + "\n[display]\nport = 0\n")
    return path


@contextlib.contextmanager
def emulator(scenario: str, config: Path, links: Path, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """``fti hil`` on the links of a configuration, prepared; it ends with the flight, or with the block.

    What it says of itself on stderr stands beside the configuration in ``emulator.txt``.
    """
    with emulator_log(config).open("w") as errors:
        process = subprocess.Popen(
            [*FTI, "hil", scenario, "--config", str(config), "--links", str(links), *arguments],
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
        )
    try:
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=END_S)


def emulator_log(config: Path) -> Path:
    """Where the emulator of a configuration tells its progress and its errors."""
    return config.with_name("emulator.txt")


@dataclass(frozen=True)
class Flight:
    """A recorded flight: what the daemon said, what was true.  Times in seconds of the flight."""

    session: Path
    truth: Path

    @cached_property
    def recording(self) -> Recording:
        return Recording.open(self.session)

    @cached_property
    def true_rows(self) -> list[Row]:
        return [json.loads(data) for *_, data in Recording.open(self.truth).messages("/truth/state", kind="truth")]

    @cached_property
    def begin_ns(self) -> int:
        """FTI time at which the flight began."""
        return int(self.true_rows[0]["t_ns"])

    def outputs(self, topic: str) -> list[Row]:
        """Every message of a topic during the flight, with its time as ``t``."""
        contents = [json.loads(data) for *_, data in self.recording.messages(topic)]
        return [{**row, "t": self.seconds(row["t_ns"])} for row in contents if row["t_ns"] >= self.begin_ns]

    def seconds(self, t_ns: int) -> float:
        """Time of the flight [s]."""
        return (t_ns - self.begin_ns) / SECOND_NS

    def truth_at(self, t: float) -> Row:
        """The true row next to a time of the flight [s]."""
        return min(self.true_rows, key=lambda row: abs(self.seconds(row["t_ns"]) - t))

    def arrivals(self, link: str) -> list[float]:
        """Times at which a link brought something [s]."""
        return [self.seconds(f.t_rx_ns) for f in self.recording.frames() if f.link == link]


def fly(scenario: str, folder: Path, duration_s: float | None) -> Flight:
    """Fly a scenario past a daemon for so many seconds of the flight; None : to its end."""
    named = Path(scenarios.load(scenarios.find(scenario)).config)
    config, links, truth = config_on_free_ports(named, folder), folder / "links", folder / "flight_truth_000.mcap"
    arguments = () if duration_s is None else ("--duration", f"{duration_s}")
    ensure_kernels_compiled(configuration.load(config))  # on a new machine that takes longer than a start may
    with contextlib.ExitStack() as stack:
        with START_LOCK:
            played = stack.enter_context(emulator(scenario, config, links, "--wait", "--truth", str(truth), *arguments))
            until(lambda: links.is_dir() or played.poll() is not None, START_S, "the emulator's ports")
            assert played.poll() is None, emulator_log(config).read_text()
            running = stack.enter_context(daemon(config, folder / "out", "--links", str(links)))
            session = running.session
            until(lambda: running.health()["navigation"], START_S, "navigation")
        assert played.wait(timeout=(duration_s or MAX_FLIGHT_S) + END_S) == 0, emulator_log(config).read_text()
        running.stop()
    return Flight(session, truth)


def fly_faster(scenario: str, folder: Path, duration_s: float | None) -> Flight:
    """Fly a scenario past the daemon's chain, faster than time, so many seconds of it; None : to its end."""
    loaded = scenarios.load(scenarios.find(scenario))
    session = offline_run.fly(scenarios.load_config(loaded), loaded, folder, until_s=duration_s)
    (truth,) = Recording.open(session).truth_files
    return Flight(session, truth)
