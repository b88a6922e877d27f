"""Every scenario flown past a real daemon holds its score: each flag in time, gone in time, and no other."""

from __future__ import annotations

import pytest

from fti.cli.main import main
from tests.e2e.conftest import flown
from tests.e2e.flights import Flight

pytestmark = [pytest.mark.e2e, pytest.mark.flight, pytest.mark.timeout(3600)]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    metafunc.parametrize("name", sorted(flown(metafunc.config)))


def test_the_daemon_said_what_the_scenario_expects(
    flights: dict[str, Flight], name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = flights[name]
    code, said = main(["score", name, str(flight.session), "--truth", str(flight.truth)]), capsys.readouterr()
    assert code == 0, said.out + said.err
    assert "holds: " in said.out
