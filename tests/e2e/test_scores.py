"""Every scenario flown past a real daemon holds its score: each flag in time, gone in time, and no other."""

from __future__ import annotations

import pytest

from tests.e2e.conftest import flown
from tests.e2e.flights import Flight
from tests.e2e.harness import fti

pytestmark = [pytest.mark.e2e, pytest.mark.flight, pytest.mark.timeout(3600)]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    metafunc.parametrize("name", sorted(flown(metafunc.config)))


def test_the_daemon_said_what_the_scenario_expects(flights: dict[str, Flight], name: str) -> None:
    flight = flights[name]
    done = fti("score", name, str(flight.session), "--truth", str(flight.truth), timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "holds: " in done.stdout
