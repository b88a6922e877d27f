"""The flights that several end-to-end tests look at; and the hearts that tell what the machine took.

A flight is flown once, and again when a core of the machine stood still during it: what no program of ours was given is
no gap of theirs, and a score cannot tell the two apart.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import pytest

from fti.hil import scenario as scenarios
from tests.e2e.flights import Flight, fly, fly_faster
from tests.e2e.heartbeat import ATTEMPTS, DISTURBED_NS, Heartbeats

#: Flown in real time past real processes: what only ports show, and once nothing but an approach.  Seconds of each that
#: the assertions need.
REAL_TIME = {
    "nominal": 80.0,
    "gauntlet_serial": 82.0,
    "gauntlet_udp": 82.0,
    "gauntlet_slcan": 82.0,
    "gauntlet_udp_multicast": 82.0,
}
#: Flown faster than time past the daemon's chain; at full scale in real time, too.
ACCELERATED = {"altimeter_failure": 48.0, "obstacle": 46.0, "off_track": 50.0, "silence": 46.0}
#: Flown where there is such a bus: tests/vcan.
VCAN_SCENARIOS = {"gauntlet_socketcan"}


class TimedFlight(NamedTuple):
    """A flight, and from when until when it was flown on the monotonic clock [ns]."""

    flight: Flight
    begin_ns: int
    end_ns: int


def flown(config: pytest.Config) -> dict[str, float | None]:
    """Scenarios and how long each is flown [s]; at full scale every one to its end."""
    if config.getoption("--scale") == "quick":
        return {**REAL_TIME, **ACCELERATED}
    return dict.fromkeys(name for name in scenarios.shipped_names() if name not in VCAN_SCENARIOS)


@pytest.fixture(scope="session")
def flights(tmp_path_factory: pytest.TempPathFactory, pytestconfig: pytest.Config) -> dict[str, Flight]:
    """Every scenario; those in real time again, while a core stood still during them."""
    durations = flown(pytestconfig)
    found, wanted = dict[str, Flight](), durations
    for _ in range(ATTEMPTS):
        hearts = Heartbeats()
        try:
            latest = _fly_all(wanted, tmp_path_factory.mktemp("flights"))
        finally:
            hearts.stop()
        found |= {name: one.flight for name, one in latest.items()}
        pauses = {name: hearts.longest_pause_ns(one.begin_ns, one.end_ns) for name, one in latest.items()}
        wanted = {
            name: durations[name] for name, ns in pauses.items() if ns > DISTURBED_NS and not _is_faster(name, wanted)
        }
        if not wanted:
            break
        print("flown again:", {name: f"a core stood still for {pauses[name] / 1e6:.0f} ms" for name in wanted})
    return found


def _is_faster(name: str, durations: Mapping[str, float | None]) -> bool:
    return name in ACCELERATED and durations[name] is not None


def _fly_all(durations: Mapping[str, float | None], folder: Path) -> dict[str, TimedFlight]:
    """Those in real time three at a time, beside the last of them the others, in turn."""

    def fly_one(name: str) -> TimedFlight:
        begin_ns = time.monotonic_ns()
        fly_it = fly_faster if _is_faster(name, durations) else fly
        return TimedFlight(fly_it(name, folder / name, durations[name]), begin_ns, time.monotonic_ns())

    def fly_all_faster() -> dict[str, TimedFlight]:
        return {name: fly_one(name) for name in durations if _is_faster(name, durations)}

    with ThreadPoolExecutor(3) as pool:
        jobs = {name: pool.submit(fly_one, name) for name in durations if not _is_faster(name, durations)}
        others = pool.submit(fly_all_faster)
        try:
            return {**{name: job.result() for name, job in jobs.items()}, **others.result()}
        finally:
            pool.shutdown(cancel_futures=True)  # after an interrupt no other takes off


@pytest.fixture
def heartbeats() -> Iterator[Heartbeats]:
    """A heart on each core, while a test goes on."""
    hearts = Heartbeats()
    yield hearts
    hearts.stop()
