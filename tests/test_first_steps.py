"""``docs/first-steps.md`` is executed: its file is written, its commands run, and their output is compared."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.doc_pages import Console, blocks, compare, consoles, execute
from tests.helpers import ROOT

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(900)]

PAGE = (ROOT / "docs" / "first-steps.md").read_text(encoding="utf-8")
WITHIN_S = 800.0


def exercise(titles: Sequence[str]) -> Console:
    """The consoles of sections, as one: a later one goes on where an earlier one has ended."""
    found = [one for title in titles for one in consoles(PAGE.split(f"## {title}\n")[1].split("\n## ")[0])]
    return Console([each for one in found for each in one.commands], [each for one in found for each in one.printed])


#: The aircraft uses fixed UDP ports, which a demonstration of another test may have.
EXERCISES = [
    pytest.param(["My first aircraft"], marks=pytest.mark.alone),
    ["My first HIL test", "From flight to table"],
]


@pytest.mark.parametrize("titles", EXERCISES)
def test_what_the_page_says_is_printed(titles: list[str], tmp_path: Path) -> None:
    texts = [*blocks(PAGE, "toml"), *blocks(PAGE, "python")]
    for name, text in zip(("unlocked.toml", "heights.py", "grid.py"), texts, strict=True):
        assert f"file `{name}`" in PAGE
        (tmp_path / name).write_text(text, encoding="utf-8")
    console = exercise(titles)
    for printed, expected in zip(execute(console, tmp_path, WITHIN_S), console.printed, strict=True):
        compare(printed, expected)
