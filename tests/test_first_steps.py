"""``docs/first-steps.md`` is executed: its file is written, its commands run, and their output is compared."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.doc_pages import Console, blocks, compare, consoles, execute
from tests.helpers import ROOT

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(900)]

PAGE = (ROOT / "docs" / "first-steps.md").read_text(encoding="utf-8")
WITHIN_S = 800.0


def exercise(title: str) -> Console:
    """The consoles of a section, as one: a later one goes on where an earlier one has ended."""
    section = PAGE.split(f"## {title}\n")[1].split("\n## ")[0]
    found = consoles(section)
    return Console([each for one in found for each in one.commands], [each for one in found for each in one.printed])


@pytest.mark.parametrize("title", ["My first aircraft", "My first HIL test"])
def test_what_the_page_says_is_printed(title: str, tmp_path: Path) -> None:
    (text,) = blocks(PAGE, "toml")
    (tmp_path / "unlocked.toml").write_text(text, encoding="utf-8")
    console = exercise(title)
    for printed, expected in zip(execute(console, tmp_path, WITHIN_S), console.printed, strict=True):
        compare(printed, expected)
