"""Scenarios that need no real port, flown faster than time: the daemon's chain says what each expects, and no more."""

from __future__ import annotations

from pathlib import Path

import pytest

from fti.cli.main import main
from fti.hil import scenario as scenarios
from tests.e2e.conftest import flown

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(900)]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Those that are not flown in real time anyway; at full scale all of them."""
    real = flown(metafunc.config) if metafunc.config.getoption("--scale") == "quick" else ()
    metafunc.parametrize("name", [name for name in scenarios.shipped() if name not in real])


def test_the_daemon_said_what_the_scenario_expects(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code = main(["score", name, "--fly", str(tmp_path)])
    assert code == 0, capsys.readouterr().out
