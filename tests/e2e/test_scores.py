"""Every scenario flown past a real daemon holds its score: each flag in time, gone in time, and no other.

A handful of falsifications of what the daemon recorded fail it; all of them: tests/post/score/sabotage.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from fti.cli.main import main
from fti.hil import scenario as scenarios
from tests.e2e.conftest import flown
from tests.e2e.flights import Flight
from tests.post.score.sabotage.campaign import Sum, run
from tests.post.score.sabotage.catalogue import CATALOGUE
from tests.post.score.sabotage.flights import sample_of

pytestmark = [pytest.mark.e2e, pytest.mark.flight, pytest.mark.timeout(3600)]

#: Of each of these one target of a flight, another one in each scenario.
FALSIFICATIONS = (
    "delete output",
    "hole of 5 s in output",
    "position 1 degree north",
    "altitude 30 m",
    "never valid, stale",
    "expected flag hidden",
    "flag never clears",
    "explained by ticks missing around the fault",
    "explained by all of these",
    "configuration with half the rate",
)


#: Their recordings are falsified; at full scale all of them.
FALSIFIED = ("gauntlet_serial", "gauntlet_udp")


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    names = sorted(flown(metafunc.config))
    if "falsified" in metafunc.fixturenames:
        is_quick = metafunc.config.getoption("--scale") == "quick"
        metafunc.parametrize("falsified", FALSIFIED if is_quick else names)
    else:
        metafunc.parametrize("name", names)


def test_the_daemon_reports_what_the_scenario_expects(
    flights: dict[str, Flight], name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = flights[name]
    code, printed = main(["score", name, str(flight.session), "--truth", str(flight.truth)]), capsys.readouterr()
    assert code == 0, printed.out + printed.err
    assert "holds: " in printed.out


def test_a_falsified_recording_of_the_daemon_fails(flights: dict[str, Flight], falsified: str, tmp_path: Path) -> None:
    flight = flights[falsified]
    sample = sample_of(falsified, flight.session, truth=flight.truth)
    assert sample.honest.holds, sample.honest.failures
    chosen = [CATALOGUE[one] for one in FALSIFICATIONS]
    total = Sum(list(run(sample, chosen, tmp_path, every=False, turn=scenarios.shipped_names().index(falsified))))
    assert len(total.applied()) > 1
    assert not total.undetected, "\n".join(total.lines())
