"""The flights that several end-to-end tests look at: flown once."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

from fti.hil import scenario as scenarios
from tests.e2e.flights import Flight, fly

#: Seconds of each scenario that the assertions need.
DURATIONS = {
    "nominal": 80.0,
    "gauntlet_serial": 82.0,
    "gauntlet_udp": 82.0,
    "gauntlet_slcan": 82.0,
    "gauntlet_udp_multicast": 82.0,
    "altimeter_failure": 48.0,
    "obstacle": 46.0,
    "off_track": 50.0,
    "silence": 46.0,
}
#: Flown where there is such a bus: tests/vcan.
ELSEWHERE = {"gauntlet_socketcan"}


def flown(config: pytest.Config) -> dict[str, float | None]:
    """Scenarios and how long each is flown [s]; at full scale every one to its end."""
    if config.getoption("--scale") == "quick":
        return {name: s for name, s in DURATIONS.items() if name not in ELSEWHERE}
    return dict.fromkeys(name for name in scenarios.shipped() if name not in ELSEWHERE)


@pytest.fixture(scope="session")
def flights(tmp_path_factory: pytest.TempPathFactory, pytestconfig: pytest.Config) -> dict[str, Flight]:
    """Every scenario once, two at a time, in real time."""
    folder = tmp_path_factory.mktemp("flights")
    with ThreadPoolExecutor(2) as pool:
        jobs = {name: pool.submit(fly, name, folder / name, s) for name, s in flown(pytestconfig).items()}
        try:
            return {name: job.result() for name, job in jobs.items()}
        finally:
            pool.shutdown(cancel_futures=True)  # after an interrupt no other takes off
