"""docs/hardware-in-the-loop.md: it names what there is, and its examples read the flying emulator."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fti import config as configuration
from fti.cli._score_jobs import ALL
from fti.hil.scenario import find, shipped_names
from fti.hil.tables.fault_types import FaultKind
from fti.hil.tables.schema import Scenario
from tests.e2e.flights import demo_config, emulator, emulator_log
from tests.e2e.harness import START_S
from tests.helpers import ROOT, until

PAGE = (ROOT / "docs" / "hardware-in-the-loop.md").read_text(encoding="utf-8")


def section(title: str) -> str:
    """The text below a heading."""
    return PAGE.partition(f"## {title}\n")[2].partition("\n## ")[0]


def in_table(text: str, column: int) -> set[str]:
    """Every word in backquotes in a column of a table."""
    rows = [line.split("|") for line in text.splitlines() if "|" in line]
    return {word for row in rows[1:] for word in re.findall(r"`([a-z_]+)`", row[column])}


def test_every_fault_is_named() -> None:
    assert in_table(section("Faults"), 0) == {kind.value for kind in FaultKind}


def test_every_flight_is_named() -> None:
    flights = Scenario.model_json_schema()["properties"]["flight"]["discriminator"]["mapping"]
    assert in_table(section("Flights"), 0) == set(flights)


def test_the_scenarios_of_the_page_are_shipped() -> None:
    names = set(re.findall(r"fti (?:hil|score) ([a-z_/]+)", PAGE))
    in_folders = {name for name in names if "/" in name}
    assert names - in_folders <= {*shipped_names(), ALL}
    assert in_folders
    assert all(find(name).is_file() for name in in_folders)


@pytest.mark.e2e
def test_its_examples_read_the_emulator(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config, links = demo_config(tmp_path), tmp_path / "links"
    examples = re.findall(r"```python\n(.*?)```", section("First steps"), re.DOTALL)
    with emulator("nominal", config, links) as played:
        ports = [k.name for k in configuration.load(config).link if k.kind == "serial"]
        until(lambda: played.poll() is not None or all((links / p).exists() for p in ports), START_S, "the ports")
        assert played.poll() is None, emulator_log(config).read_text()
        for example in examples:
            exec(example.replace("/tmp/links", str(links)), {})
    fix, frame = capsys.readouterr().out.splitlines()
    lat, lon, alt, quality = map(float, fix.split())
    assert (round(lat, 1), round(lon, 1), quality) == (36.6, -84.1, 1)
    assert 300.0 < alt < 800.0
    assert frame.startswith("Timestamp")
