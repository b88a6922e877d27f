"""A long recording of the whole aircraft at a multiple of its rate: memory, processor, buffers, and the ledger.

    python -m tests.e2e.soak_run --duration 1800 --out DIR [--factor 10] [--keep]

It runs ``fti run`` on 23 links (``tests.e2e.aircraft``), samples what its processes take, compares in the end what was
sent with what was recorded, runs ``fti verify``, and prints a table.  The recording is removed afterwards; 10 times
the aircraft's rate makes 2.3 MB/s.
"""

from __future__ import annotations

import argparse
import json
import os
import queue
import shutil
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fti.bus.client import Subscriber
from fti.bus.frame import SOCKET_NAME
from tests.e2e.aircraft import LINKS, Aircraft
from tests.e2e.harness import Daemon, daemon, fti
from tests.helpers import until
from tests.processes import children_of, command_of

TICKS_PER_S = os.sysconf("SC_CLK_TCK")
MEGABYTE = 2**20
#: At most so many samples of each process, whatever the duration.
SAMPLES = 360
#: The first part of a run, in which caches fill, says nothing of growth.
WARM_UP = 0.2
CATCH_UP_S = 30.0
PROCESSES = ("recorder", "navigation", "display", "supervisor")


@dataclass(slots=True)
class Usage:
    """What a process took at each sample: times [s], memory [MB], processor time [s].

    Memory is what is resident and its own: the ring, which three processes share and which fills once, is not counted.
    """

    times: list[float] = field(default_factory=list)
    memory_mb: list[float] = field(default_factory=list)
    cpu_s: list[float] = field(default_factory=list)

    @property
    def cpu_percent(self) -> float:
        """Of one core, over the whole time [%]."""
        return 100 * (self.cpu_s[-1] - self.cpu_s[0]) / (self.times[-1] - self.times[0])

    def growth_mb(self, span_s: float) -> float:
        """Slope of the memory after the warm-up (least squares), times a span [MB]."""
        first = int(len(self.times) * WARM_UP)
        times, memory = self.times[first:], self.memory_mb[first:]
        mean_t, mean_m = sum(times) / len(times), sum(memory) / len(memory)
        spread = sum((t - mean_t) ** 2 for t in times)
        slope = sum((t - mean_t) * (m - mean_m) for t, m in zip(times, memory, strict=True)) / spread
        return slope * span_s


@dataclass(slots=True)
class Soak:
    """The result of a run.

    sent, recorded : link -> frames and bytes; dropped : link -> frames; usage : of each process
    sinks : the last report of each sink
    load : the fullest that any buffer of any link was, of its capacity (0 to 1); lag_ms : of navigation, at each sample
    verified : what ``fti verify`` said, and its exit code
    """

    duration_s: float
    usage: dict[str, Usage]
    sent: dict[str, tuple[int, int]] = field(default_factory=dict)
    recorded: dict[str, tuple[int, int]] = field(default_factory=dict)
    dropped: dict[str, int] = field(default_factory=dict)
    sinks: dict[str, dict[str, Any]] = field(default_factory=dict)
    load: float = 0.0
    lag_ms: list[float] = field(default_factory=list)
    ring_lost: int = 0
    file_mb: float = 0.0
    free_mb: tuple[float, float] = (0.0, 0.0)
    verified: str = ""
    exit_code: int = -1

    def table(self) -> str:
        """The report, in Markdown."""
        frames = sum(frames for frames, _ in self.sent.values())
        sent_mb, recorded_mb = (sum(n for _, n in part.values()) / 1e6 for part in (self.sent, self.recorded))
        rows = [
            f"{self.duration_s:.0f} s, {LINKS} links, {frames / self.duration_s:.0f} messages/s: {frames} messages, "
            f"{sent_mb:.1f} MB sent, {recorded_mb:.1f} MB recorded, {sum(self.dropped.values())} frames dropped; "
            f"files {self.file_mb:.0f} MB; fullest buffer {100 * self.load:.1f} %; free space {self.free_mb[0]:.0f} -> "
            f"{self.free_mb[1]:.0f} MB; navigation late by at most {max(self.lag_ms):.0f} ms, "
            f"ring lost {self.ring_lost} frames; fti verify: exit code {self.exit_code}.",
            "",
            "| process | % of a core | memory after warm-up [MB] | at the end [MB] | slope [MB in 30 minutes] |",
            "|---|---|---|---|---|",
        ]
        for name, used in self.usage.items():
            warm = used.memory_mb[int(len(used.times) * WARM_UP)]
            rows.append(
                f"| {name} | {used.cpu_percent:.1f} | {warm:.1f} | {used.memory_mb[-1]:.1f} "
                f"| {used.growth_mb(1800):+.2f} |"
            )
        return "\n".join(rows)


def run_soak(
    out: Path, duration_s: float, factor: float, tell: Callable[[str], None] = lambda line: None, publish: str = ""
) -> Soak:
    """Run the aircraft and the daemon for a duration [s]; everything is below ``out``.

    publish : tables of ``[publish]``, in TOML; none: without them
    """
    aircraft = Aircraft(out / "links", factor)
    aircraft.config.write_text(f"{aircraft.config.read_text()}\n{publish}")
    try:
        with daemon(aircraft.config, out / "recordings", "--links", str(aircraft.links)) as running:
            until(lambda: _open_links(running.health()) == LINKS, 60, f"{LINKS} open links")
            session = running.session
            aircraft.start()
            result = _observe(running, duration_s, tell)
            aircraft.stop()
            result.sent = aircraft.sent
            _settle(running, result)
            running.stop()
    finally:
        aircraft.close()
    result.file_mb = sum(path.stat().st_size for path in session.iterdir()) / MEGABYTE
    tell("verifying")
    verified = fti("verify", str(session), timeout=3600)
    result.verified, result.exit_code = verified.stdout + verified.stderr, verified.returncode
    return result


def _open_links(health: dict[str, Any]) -> int:
    return sum(link["state"] in ("silent", "good") for link in health.get("links", {}).values())


class _Health:
    """The healths that a daemon publishes."""

    def __init__(self, running: Daemon) -> None:
        self._messages = queue.SimpleQueue[bytes]()
        self._subscriber = Subscriber(Path(running.info["sock"]).with_name(SOCKET_NAME), "test", self._on_health)

    def _on_health(self, topic: str, payload: bytes, sent_ns: int) -> None:
        if topic == "/health":
            self._messages.put(payload)

    def new(self) -> list[dict[str, Any]]:
        """Those that have come since the last call."""
        return [json.loads(self._messages.get()) for _ in range(self._messages.qsize())]

    def close(self) -> None:
        self._subscriber.close()


def _observe(running: Daemon, duration_s: float, tell: Callable[[str], None]) -> Soak:
    pids = _pids(running)
    if "publish" in running.health()["processes"]:
        pids["publish"] = running.pid_of("publish")
    result = Soak(duration_s, {name: Usage() for name in pids})
    health = _Health(running)
    period = max(duration_s / SAMPLES, 0.2)
    begin = time.monotonic()
    try:
        while (now := time.monotonic() - begin) < duration_s:
            for name, pid in pids.items():
                _sample(result.usage[name], now, pid)
            for message in health.new():
                _note(result, message)
            if len(result.usage["recorder"].times) % (SAMPLES // 12) == 0:
                tell(f"{now:.0f} s; {', '.join(f'{n} {u.memory_mb[-1]:.1f} MB' for n, u in result.usage.items())}")
            time.sleep(period)
    finally:
        health.close()
    return result


def _pids(running: Daemon) -> dict[str, int]:
    """Number of each process of the daemon; of the recorders the one that records, not the one that stands by."""
    children = {running.pid_of(name): name for name in PROCESSES[:-1]}
    assert all(name in command_of(pid) for pid, name in children.items())
    assert children.keys() <= set(children_of(running.process.pid))
    return {**{name: pid for pid, name in children.items()}, "supervisor": running.process.pid}


def _sample(usage: Usage, now: float, pid: int) -> None:
    status = Path(f"/proc/{pid}/status").read_text()
    resident = next(line for line in status.splitlines() if line.startswith("RssAnon:"))
    times = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    usage.times.append(now)
    usage.memory_mb.append(int(resident.split()[1]) / 1024)
    usage.cpu_s.append((int(times[11]) + int(times[12])) / TICKS_PER_S)


def _note(result: Soak, health: dict[str, Any]) -> None:
    result.sinks = health.get("sinks") or {}
    loads = [load for link in health["links"].values() for load in link["load"].values()]
    result.load = max(result.load, *loads)
    navigation, free = health["navigation"], health["storage"]["free_mb"]
    if navigation:
        result.lag_ms.append(navigation["lag_ms"])
        result.ring_lost = navigation["ring_lost_frames"]
    result.free_mb = (result.free_mb[0] or free, free)


def _settle(running: Daemon, result: Soak) -> None:
    """Wait until everything that was sent has come in, or for long enough."""

    def come_in() -> bool:
        links = running.health()["links"]
        result.recorded = {name: (link["frames"], link["bytes"]) for name, link in links.items()}
        result.dropped = {name: link["dropped_frames"] for name, link in links.items()}
        return {name: size for name, (_, size) in result.recorded.items()} == {
            name: size for name, (_, size) in result.sent.items()
        }

    deadline = time.monotonic() + CATCH_UP_S
    while not come_in() and time.monotonic() < deadline:
        pass  # each look waits for the next health


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--duration", type=float, default=1800.0, metavar="S")
    parser.add_argument("--factor", type=float, default=10.0, help="times the aircraft's rate")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--keep", action="store_true", help="do not remove the recording")
    args = parser.parse_args()
    out = args.out / f"soak_{os.getpid()}"
    try:
        result = run_soak(out, args.duration, args.factor, lambda line: print(line, file=sys.stderr, flush=True))
    finally:
        if not args.keep:
            shutil.rmtree(out, ignore_errors=True)
    print(result.table())
    print(result.verified, file=sys.stderr)
    return 0 if result.exit_code == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
