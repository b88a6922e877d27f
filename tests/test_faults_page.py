"""``docs/faults.md`` is what the tables of scenarios generate, and every kind of fault has its section."""

from __future__ import annotations

import tomllib

from fti.hil.oracle.fault_page import page
from fti.hil.tables.fault_types import FaultKind
from tests.helpers import ROOT

PAGE = (ROOT / "docs" / "faults.md").read_text(encoding="utf-8")


def test_the_page_is_what_is_generated() -> None:
    assert page() == PAGE, "docs/faults.md is not up to date: make docs"


def test_every_kind_has_a_section_with_an_example_of_it() -> None:
    sections = {part.partition("`")[0]: part for part in PAGE.split("\n## `")[1:]}
    assert list(sections) == [kind.value for kind in FaultKind]
    for kind, text in sections.items():
        (fault,) = tomllib.loads(text.partition("```toml\n")[2].partition("```")[0])["fault"]
        assert fault["kind"] == kind


def test_it_is_linked() -> None:
    assert "](faults.md)" in (ROOT / "docs" / "hardware-in-the-loop.md").read_text(encoding="utf-8")
    assert "](docs/faults.md)" in (ROOT / "README.md").read_text(encoding="utf-8")


def test_a_flag_and_a_key_that_documents_state_are_there() -> None:
    """From Spiegel 2018 by way of docs/hardware-in-the-loop.md and the scenarios: not from the generator."""
    assert "| `position not from DEVICE` | `/nav/nav_solution` | DEVICE is the first of nav.position |" in PAGE
    assert "| `supply_v` | V | `12.0` | number >= 0, < 28 | supply voltage in the interval |" in PAGE
    assert "imu_sample" in PAGE.partition("## Quantities")[2]
