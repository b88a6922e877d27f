"""The flights that several end-to-end tests look at: flown once."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest

from tests.e2e.flights import Flight, fly

#: Seconds of each scenario that the assertions need.
DURATIONS = {"nominal": 80.0, "altimeter_failure": 48.0, "obstacle": 46.0, "off_track": 50.0, "silence": 46.0}


@pytest.fixture(scope="session")
def flights(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Flight]:
    """Every scenario once, two at a time, in real time."""
    folder = tmp_path_factory.mktemp("flights")
    with ThreadPoolExecutor(2) as pool:
        jobs = {name: pool.submit(fly, name, folder / name, s) for name, s in DURATIONS.items()}
        try:
            return {name: job.result() for name, job in jobs.items()}
        finally:
            pool.shutdown(cancel_futures=True)  # after an interrupt no other takes off
