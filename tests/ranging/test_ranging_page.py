"""docs/ranging.md: its example runs and prints what the page says; its pictures are those that the studies draw."""

from __future__ import annotations

import re

import pytest

from fti.study import ranging, slant_range
from tests.helpers import ROOT

PAGE = (ROOT / "docs" / "ranging.md").read_text(encoding="utf-8")
PICTURES = PAGE[PAGE.index("| picture |") :]


def test_the_example_prints_what_the_page_says(capsys: pytest.CaptureFixture[str]) -> None:
    code, printed = re.findall(r"```(?:python)?\n(.*?)```", PAGE, re.DOTALL)[:2]
    exec(code, {})
    assert capsys.readouterr().out == printed


def test_every_picture_is_named() -> None:
    for study, prefix in ((ranging, "ranging"), (slant_range, "slant_range")):
        rows = [line for line in PICTURES.splitlines() if line.startswith(f"| `{prefix}-")]
        named = {
            name.removeprefix(f"{prefix}-").removeprefix("-") for row in rows for name in re.findall(r"`(.*?)`", row)
        }
        assert named == set(study.drawings(1))
