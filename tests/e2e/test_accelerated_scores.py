"""More scenarios without a real port, flown faster than time: the daemon says what each expects, and no more."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from fti.cli.main import main
from fti.hil import scenario as scenarios
from fti.logger.reading.recording import Recording
from fti.nav.fallbacks import Fallbacks
from fti.nav.navigation import Navigation
from tests.e2e.conftest import VCAN_SCENARIOS, flown
from tests.e2e.flights import Flight, fly_faster
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
    "scan_drift_500s": 20.0,
    "scan_drift_clock": 125.0,
    "scan_drift_dies": 20.0,
    "scan_drift_mounting": 125.0,
    "scan_drift_outage": 225.0,
    "scan_drift_pair": 145.0,
    "scan_drift_plain": 20.0,
    "scan_drift_turns": 20.0,
    "scan_drift_water": 110.0,
    "table": 35.0,
    "terrain_beams": 75.0,
    "terrain_flat_sea": 113.0,
    "terrain_map_off": 40.0,
    "terrain_outage": 75.0,
    "terrain_ramp": 115.0,
    "terrain_repeated": 198.0,
}


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Those that are not flown elsewhere anyway; at full scale all of them."""
    if "name" not in metafunc.fixturenames:
        return
    quick = metafunc.config.getoption("--scale") == "quick"
    durations = DURATIONS if quick else dict.fromkeys(scenarios.shipped_names())
    metafunc.parametrize(("name", "duration_s"), durations.items(), ids=list(durations))


Fly = Callable[[str, float | None], Flight]


@pytest.fixture(scope="module")
def fly_once(tmp_path_factory: pytest.TempPathFactory) -> Fly:
    """Flies each scenario once for all tests."""
    return functools.cache(lambda name, duration_s: fly_faster(name, tmp_path_factory.mktemp("flown"), duration_s))


def test_the_daemon_reports_what_the_scenario_expects(
    name: str, duration_s: float | None, fly_once: Fly, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = fly_once(name, duration_s)
    code, printed = main(["score", name, str(flight.session)]), capsys.readouterr()
    assert code == 0, printed.out + printed.err
    assert "holds: " in printed.out


def test_methods_of_position_from_the_ground_are_compared(
    fly_once: Fly, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = fly_once("terrain_outage", DURATIONS["terrain_outage"])
    assert main(["reprocess", str(flight.session), "--out", str(tmp_path), "--compare-terrain-methods"]) == 0
    printed = capsys.readouterr().out.splitlines()
    again = Path(printed[-1])
    found = json.loads((again / "terrain_methods.json").read_text())
    assert (again / "terrain_methods.png").read_bytes().startswith(b"\x89PNG")
    assert found["reference"] == "ground truth of the emulator"
    rows = {row["method"]: row for row in found["methods"]}
    sequential = ["point_mass", "particles", "marginalised"]
    assert list(rows) == ["profile", "five_point", "printed", "vertical", "closed_loop", *sequential]
    assert {row["profiles"] for row in rows.values()} == {4}
    assert rows["profile"]["valid"] == 4
    assert rows["profile"]["median_m"] < 20.0
    assert rows["profile"]["wrong"] == 0
    assert found["seconds"] == pytest.approx(66, abs=2)  # from the middle of the first profile on
    assert found["bound_m"] > 1.0
    assert any(line.startswith("inertial alone / filter (profile) / bound: ") for line in printed)
    # the comparison changes no output of navigation
    assert len(outputs := _outputs(again)) > 1000
    assert outputs == _outputs(flight.session)
    # the fixes of the method in flight are those of the flight
    flown_fixes = {row["t_valid_ns"]: row["lat"] for row in flight.outputs("/nav/terrain_fix") if row["valid"]}
    assert {fix["t_valid_ns"]: fix["lat"] for fix in rows["profile"]["fixes"]} == flown_fixes


def test_satellites_are_the_reference_without_ground_truth(
    fly_once: Fly, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = fly_once("terrain_outage", DURATIONS["terrain_outage"])
    session = tmp_path / flight.session.name
    session.mkdir()
    for file in flight.session.glob("*.mcap"):
        if file != flight.truth:
            (session / file.name).symlink_to(file)
    assert main(["reprocess", str(session), "--out", str(tmp_path / "again"), "--compare-terrain-methods"]) == 0
    again = Path(capsys.readouterr().out.splitlines()[-1])
    found = json.loads((again / "terrain_methods.json").read_text())
    assert found["reference"] == "filter with satellites (receiver), while they are received"
    assert 0.5 < found["reference_sd"] < 10.0
    # they fail at 60 s, and are missed 10 s later: the last profile, until 68 s, has no reference after that
    assert 50 <= found["seconds"] <= 63
    assert all(fix["error_north"] is not None for fix in found["methods"][0]["fixes"][:3])


def _outputs(session: Path) -> list[tuple[str, int, bytes]]:
    return [(topic, log, data) for topic, log, _, _, data in Recording.open(session).messages("/nav/", kind="derived")]


def test_fixes_of_all_beams_are_repeated_bit_for_bit(
    fly_once: Fly, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = fly_once("terrain_beams", DURATIONS["terrain_beams"])
    assert main(["reprocess", str(flight.session), "--out", str(tmp_path)]) == 0
    fixes = {(fix["t_valid_ns"], fix["method"]) for fix in flight.outputs("/nav/terrain_fix") if fix["valid"]}
    assert len(fixes) >= 4
    assert {method for _, method in fixes} == {"beams"}
    assert len(outputs := _outputs(flight.session)) > 1000
    assert _outputs(Path(capsys.readouterr().out.strip())) == outputs


def test_drifts_over_the_ground_are_repeated_bit_for_bit(
    fly_once: Fly, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight = fly_once("scan_drift_outage", DURATIONS["scan_drift_outage"])
    assert main(["reprocess", str(flight.session), "--out", str(tmp_path)]) == 0
    used = {row["t_valid_ns"] for row in flight.outputs("/nav/ground_drift") if row["valid"]}
    assert len(used) >= 20
    assert len(outputs := _outputs(flight.session)) > 1000
    assert _outputs(Path(capsys.readouterr().out.strip())) == outputs


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
