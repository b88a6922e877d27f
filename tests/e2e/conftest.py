"""The flights that several end-to-end tests look at: flown once; and the hearts that tell what the machine took."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from fti.hil import scenario as scenarios
from tests.e2e.flights import Flight, fly, fly_faster
from tests.e2e.heartbeat import Heartbeats

#: Flown in real time past real processes: what only ports show, and once nothing but an approach.  Seconds of each that
#: the assertions need.
REAL = {
    "nominal": 80.0,
    "gauntlet_serial": 82.0,
    "gauntlet_udp": 82.0,
    "gauntlet_slcan": 82.0,
    "gauntlet_udp_multicast": 82.0,
}
#: Flown faster than time past the daemon's chain; at full scale in real time, too.
FASTER = {"altimeter_failure": 48.0, "obstacle": 46.0, "off_track": 50.0, "silence": 46.0}
#: Flown where there is such a bus: tests/vcan.
ELSEWHERE = {"gauntlet_socketcan"}


def flown(config: pytest.Config) -> dict[str, float | None]:
    """Scenarios and how long each is flown [s]; at full scale every one to its end."""
    if config.getoption("--scale") == "quick":
        return {**REAL, **FASTER}
    return dict.fromkeys(name for name in scenarios.shipped() if name not in ELSEWHERE)


@pytest.fixture(scope="session")
def flights(tmp_path_factory: pytest.TempPathFactory, pytestconfig: pytest.Config) -> dict[str, Flight]:
    """Every scenario once: those in real time three at a time, beside the last of them the others, in turn."""
    folder = tmp_path_factory.mktemp("flights")
    durations = flown(pytestconfig)
    faster = [name for name in FASTER if durations[name] is not None]

    def fly_all_faster() -> dict[str, Flight]:
        return {name: fly_faster(name, folder / name, durations[name]) for name in faster}

    with ThreadPoolExecutor(3) as pool:
        jobs = {name: pool.submit(fly, name, folder / name, s) for name, s in durations.items() if name not in faster}
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
