"""``docs/add-a-sensor.md`` is executed: its files are written, its commands run, and their output is compared."""

from __future__ import annotations

import csv
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from fti.drivers import _checksums
from fti.formats.quantities import DIMENSIONS, QUANTITIES
from tests.doc_pages import Console, blocks, compare, consoles, execute
from tests.helpers import ROOT

PAGE = (ROOT / "docs" / "add-a-sensor.md").read_text(encoding="utf-8")
CONFIG = ROOT / "configs" / "added_sensors.toml"
WITHIN_S = 100.0


SESSIONS = consoles(PAGE)
FLIGHTS = [s for s in SESSIONS if any("fti run" in command for command in s.commands)]


def run_page(console: Console, folder: Path) -> list[str]:
    """Output of each command, in a folder with the page's configuration."""
    (folder / "sensors.toml").write_text("".join(blocks(PAGE, "toml")), encoding="utf-8")
    return execute(console, folder, WITHIN_S)


@pytest.mark.parametrize("number", [i for i, s in enumerate(SESSIONS) if s not in FLIGHTS])
def test_what_the_page_says_is_printed(number: int, tmp_path: Path) -> None:
    found = SESSIONS[number]
    for printed, expected in zip(run_page(found, tmp_path), found.printed, strict=True):
        compare(printed, expected)


@pytest.mark.e2e
def test_the_page_is_flown_and_recorded(tmp_path: Path) -> None:
    (flight,) = FLIGHTS
    *printed, info = run_page(flight, tmp_path)
    run, output_lines = printed[-1], flight.printed[-1].splitlines()
    assert run.startswith("recording to ")
    topics = {line.split()[0]: int(line.split()[1]) for line in info.splitlines() if re.match(r"/\S+ +\d", line)}
    for line in output_lines[1:]:
        assert topics[line.split()[0]] > 0, line
    ranges = table(tmp_path, "lidar_range")
    assert ranges
    assert all((row["slant_range [m]"], row["valid"].lower()) == ("", "false") for row in ranges)
    pressures = [float(row["p_static [Pa]"]) for row in table(tmp_path, "weather_static_pressure")]
    assert all(90_000.0 < p < 101_000.0 for p in pressures)


def table(folder: Path, name: str) -> list[dict[str, str]]:
    """A table of the recording, as ``fti export`` writes it."""
    if not (folder / "tables").exists():
        sessions = [str(p) for p in (folder / "recordings").iterdir()]
        command = [sys.executable, "-m", "fti.cli.main", "export", *sessions, "--out", str(folder / "tables")]
        subprocess.run(command, check=True, capture_output=True, timeout=WITHIN_S)
    with (folder / "tables" / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_file_of_the_page_is_the_one_that_is_shipped() -> None:
    of_the_page, shipped = (
        tomllib.loads("".join(blocks(PAGE, "toml"))),
        tomllib.loads(CONFIG.read_text(encoding="utf-8")),
    )
    for found in (of_the_page, shipped):
        del found["session"]["directory"]
    assert of_the_page == shipped


# --------------------------------------------------------------------------------------------------- the reference


def test_checksums_and_units_are_documented() -> None:
    names = {*_checksums.CHECKSUMS}
    units = {unit for q in QUANTITIES.values() for g in DIMENSIONS if q.unit in g for unit in g}
    for name in names | units - {"ddm"}:
        assert f"`{name}`" in PAGE, name
    quantities = PAGE.partition("Quantities are ")[2].partition(" and others")[0]
    assert set(re.findall(r"`(\w+)`", quantities)) <= set(QUANTITIES)
