"""The gauntlet on CAN buses of the kernel: emulator and daemon in the user-mode kernel, the score outside of it.

The user-mode kernel has one processor, a fraction as fast as that of the machine, so that emulator and daemon stand
still now and then.  The score calls a flight inconclusive in which the emulator was often late; pauses of the outputs
are those of the machine.  Such a flight passes here if its flags were found: a missing or late flag, one that nothing
explains, and a wrong output fail it as any other flight.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from fti.post.score.rows import FAILURES
from tests.e2e.flights import Flight
from tests.e2e.harness import fti
from tests.e2e.heartbeat import run_undisturbed
from tests.helpers import ROOT
from tests.vcan.conftest import EXIT_NOT_INSTALLED, vm_command
from tests.vcan.probe_gauntlet import NAME

#: One flight takes three to eight minutes.
FLIGHT_S = 900
pytestmark = [pytest.mark.e2e, pytest.mark.alone, pytest.mark.socketcan, pytest.mark.timeout(3 * FLIGHT_S)]


def fly(folder: Path) -> Flight:
    folder.mkdir()
    command = vm_command("tests.vcan.probe_gauntlet", folder, "flown")
    roomy = {**os.environ, "UML_TIMEOUT": f"{FLIGHT_S}", "UML_MEM": "2G"}
    done = subprocess.run(command, check=False, cwd=ROOT, capture_output=True, text=True, env=roomy)
    if done.returncode == EXIT_NOT_INSTALLED:
        pytest.skip(done.stderr.strip())
    text = f"exit code {done.returncode} (99: not ended within {FLIGHT_S} s)"
    assert done.returncode == 0, f"{text}\n{done.stdout}{done.stderr}"
    return Flight(folder / "flown" / "session", folder / "flown" / "flight_truth_000.mcap")


def score(flight: Flight) -> dict[str, Any]:
    done = fti("score", NAME, str(flight.session), "--truth", str(flight.truth), "--json")
    assert done.stdout, done.stderr
    (content,) = json.loads(done.stdout)
    assert isinstance(content, dict)
    return content


def misses(scored: dict[str, Any]) -> list[dict[str, Any]]:
    """Everything that does not hold but pauses."""
    checks = [*scored["rows"], *scored["outputs"], *scored["findings"]]
    failed = [check for check in checks if check["verdict"] in FAILURES and check.get("check") != "longest gap"]
    return [*failed, *scored["unexpected"]]


def test_the_daemon_reports_what_the_scenario_expects(tmp_path: Path) -> None:
    def fly_and_score(attempt: int) -> tuple[Flight, dict[str, Any]]:
        flight = fly(tmp_path / str(attempt))
        return flight, score(flight)

    flight, scored = run_undisturbed(fly_and_score, lambda result: not misses(result[1]))
    assert not misses(scored)
    assert all(len(flight.arrivals(link)) > 500 for link in ("air_can", "pickup_can"))
    results = Counter(row["verdict"] for row in scored["rows"])
    assert results["found"] >= 5, scored["rows"]
