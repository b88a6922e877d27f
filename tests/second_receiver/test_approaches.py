"""References made from terrain are accepted by the second receiver, and it detects obstacles.

Counts are held against the 95 % limits of binomial counts: ALERT on 1 % of nominal approaches, 97 % of obstacles.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.second_receiver import approaches
from tests.second_receiver.approaches import Site

SEED = 1
RUNS, RUNS_FULL = 8, 200
REFERENCE_RUNS, REFERENCE_RUNS_FULL = 100, 2000


#: A reference takes most of the time: quickly, the ground over which receivers differ most in what they see.
QUICK = ("woods",)


#: The fixture of a site takes minutes, several times as long beside other processes.
pytestmark = pytest.mark.timeout(3600)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    is_quick = metafunc.config.getoption("--scale") == "quick"
    metafunc.parametrize("kind", QUICK if is_quick else approaches.GROUNDS, scope="module")


@pytest.fixture(scope="module")
def site(kind: str, request: pytest.FixtureRequest) -> Site:
    runs = REFERENCE_RUNS if request.config.getoption("--scale") == "quick" else REFERENCE_RUNS_FULL
    return approaches.make_site(kind, SEED, runs)


def test_nominal_approaches_raise_no_alert(site: Site, kind: str, scale: int) -> None:
    n = RUNS if scale == 1 else RUNS_FULL
    outcomes = [approaches.fly_nominal(site, number, SEED) for number in range(n)]
    print(f"seed {SEED}", approaches.line_of_nominal(kind, outcomes), sep="\n")
    false = sum(outcome.alert_s is not None for outcome in outcomes)
    assert false <= approaches.max_failures_by_chance(n, approaches.MAX_FALSE)
    assert np.mean([outcome.judged_share for outcome in outcomes]) >= 0.5, "a monitor that judges nothing alarms nobody"


def test_obstacles_of_150_m_raise_an_alert(site: Site, kind: str, scale: int) -> None:
    n = RUNS if scale == 1 else RUNS_FULL
    flights = [approaches.fly_over_obstacle(site, number, SEED) for number in range(n)]
    print(f"seed {SEED}", approaches.line_of_obstacles(kind, flights), sep="\n")
    fresh = [pair for pair in flights if not approaches.is_earlier(*pair)]
    missed = sum(not approaches.is_detected(*pair) for pair in fresh)
    assert len(fresh) >= 0.9 * n
    assert missed <= approaches.max_failures_by_chance(len(fresh), 1.0 - approaches.MIN_DETECTED)
