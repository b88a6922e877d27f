"""The flights that several end-to-end tests look at; and the hearts that tell what the machine took.

A flight is flown once, and again when a core of the machine stood still during it: what no program of ours was given is
no gap of theirs, and a score cannot tell the two apart.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import pytest

from fti.hil import scenario as scenarios
from tests.e2e.flights import Flight, fly
from tests.e2e.heartbeat import ATTEMPTS, DISTURBED_NS, Heartbeats

#: Flown in real time past real processes: what only ports show.  Seconds of each that the assertions need.
REAL_TIME = {
    "gauntlet_serial": 82.0,
    "gauntlet_udp": 82.0,
    "gauntlet_slcan": 82.0,
    "gauntlet_udp_multicast": 82.0,
}
#: Flown where there is such a bus: tests/vcan.
VCAN_SCENARIOS = {"gauntlet_socketcan"}
NO_PARAMETERS = SimpleNamespace(params={})
#: So many at a time; with three, navigation was behind for a fifth of the flight on a slow machine of two cores.
FLIGHTS_AT_A_TIME = 2


class TimedFlight(NamedTuple):
    """A flight, and from when until when it was flown on the monotonic clock [ns]."""

    flight: Flight
    begin_ns: int
    end_ns: int


def flown(config: pytest.Config) -> dict[str, float | None]:
    """Scenarios and how long each is flown [s]; at full scale every one to its end."""
    if config.getoption("--scale") == "quick":
        return dict(REAL_TIME)
    return dict.fromkeys(name for name in scenarios.shipped_names() if name not in VCAN_SCENARIOS)


@pytest.fixture(scope="session")
def flights(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> dict[str, Flight]:
    """Every scenario that a test asks for; again, while a core stood still during it."""
    parameters = [getattr(item, "callspec", NO_PARAMETERS).params for item in request.session.items]
    asked = {value for table in parameters for value in table.values() if isinstance(value, str)}
    durations = {name: until_s for name, until_s in flown(request.config).items() if name in asked}
    found, wanted = dict[str, Flight](), durations
    for _ in range(ATTEMPTS):
        hearts = Heartbeats()
        try:
            latest = _fly_all(wanted, tmp_path_factory.mktemp("flights"))
        finally:
            hearts.stop()
        found |= {name: one.flight for name, one in latest.items()}
        pauses = {name: hearts.longest_pause_ns(one.begin_ns, one.end_ns) for name, one in latest.items()}
        wanted = {name: durations[name] for name, ns in pauses.items() if ns > DISTURBED_NS}
        if not wanted:
            break
        print("flown again:", {name: f"a core stood still for {pauses[name] / 1e6:.0f} ms" for name in wanted})
    return found


def _fly_all(durations: Mapping[str, float | None], folder: Path) -> dict[str, TimedFlight]:
    """Two at a time."""

    def fly_one(name: str) -> TimedFlight:
        begin_ns = time.monotonic_ns()
        return TimedFlight(fly(name, folder / name, durations[name]), begin_ns, time.monotonic_ns())

    with ThreadPoolExecutor(FLIGHTS_AT_A_TIME) as pool:
        jobs = {name: pool.submit(fly_one, name) for name in durations}
        try:
            return {name: job.result() for name, job in jobs.items()}
        finally:
            pool.shutdown(cancel_futures=True)  # after an interrupt no other takes off


@pytest.fixture
def heartbeats() -> Iterator[Heartbeats]:
    """A heart on each core, while a test goes on."""
    hearts = Heartbeats()
    yield hearts
    hearts.stop()
