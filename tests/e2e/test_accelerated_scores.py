"""More scenarios without a real port, flown faster than time: the daemon says what each expects, and no more."""

from __future__ import annotations

from pathlib import Path

import pytest

from fti.cli.main import main
from fti.hil import scenario as scenarios
from fti.nav.fallbacks import Fallbacks
from fti.nav.navigation import Navigation
from tests.e2e.conftest import VCAN_SCENARIOS, flown
from tests.e2e.flights import fly_faster
from tests.e2e.test_accelerated_scenarios import SCENARIOS
from tests.post.score.test_source_fault_scenarios import DETECTED

pytestmark = pytest.mark.timeout(900)

#: As long as it takes until something of each has been judged [s]; at full scale they are flown to their ends.
DURATIONS = {
    "fallbacks": 56.0,
    "gnss_degraded": 12.0,
    "gnss_offset": 48.0,
    "gnss_outages": 45.0,
    "jsbsim_approach": 12.0,
    "jsbsim_go_around": 12.0,
    "jsbsim_low_level": 12.0,
    "jsbsim_pattern": 12.0,
    "pattern": 32.0,
    "recorded": 20.0,
    "table": 35.0,
    "terrain_beams": 75.0,
    "terrain_map_off": 40.0,
    "terrain_outage": 75.0,
    "terrain_ramp": 115.0,
}


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Those that are not flown elsewhere anyway; at full scale all of them."""
    if "name" not in metafunc.fixturenames:
        return
    quick = metafunc.config.getoption("--scale") == "quick"
    durations = DURATIONS if quick else dict.fromkeys(scenarios.shipped_names())
    metafunc.parametrize(("name", "duration_s"), durations.items(), ids=list(durations))


def test_the_daemon_reports_what_the_scenario_expects(
    name: str, duration_s: float | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = fly_faster(name, tmp_path, duration_s)
    code, printed = main(["score", name, str(flight.session)]), capsys.readouterr()
    assert code == 0, printed.out + printed.err
    assert "holds: " in printed.out


def test_a_daemon_that_accepts_every_receiver_fails(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Navigation, "refused", property(lambda _: frozenset()))
    monkeypatch.setattr(Fallbacks, "refused_heights", property(lambda _: frozenset()))
    flight = fly_faster("gnss_offset", tmp_path, DURATIONS["gnss_offset"])
    assert main(["score", "gnss_offset", str(flight.session)]) == 1
    rows = capsys.readouterr().out.splitlines()
    assert any("position not from receiver" in row and "missing" in row for row in rows)


def test_every_shipped_scenario_is_flown(pytestconfig: pytest.Config) -> None:
    known = DURATIONS.keys() | SCENARIOS.keys() | flown(pytestconfig).keys() | VCAN_SCENARIOS | set(DETECTED)
    assert known == set(scenarios.shipped_names())
