"""docs/ranging.md: its example runs and prints what the page says; its pictures are those that the studies draw."""

from __future__ import annotations

import re

import numpy as np
import pytest

from fti.study import ranging, slant_range
from tests.helpers import ROOT

PAGE = (ROOT / "docs" / "ranging.md").read_text(encoding="utf-8")
PICTURES = PAGE[PAGE.index("| picture |") :]


def lines(text: str) -> dict[str, tuple[list[float], str]]:
    """Ranges and what follows them, by the name of the sensor."""
    rows = re.findall(r"(\w+) +\[(.*?)\] (.*)", text)
    return {name: ([float(word) for word in ranges.split()], valid) for name, ranges, valid in rows}


def test_the_example_prints_the_numbers_of_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    code, printed = re.findall(r"```(?:python)?\n(.*?)```", PAGE, re.DOTALL)[:2]
    exec(code, {})
    actual, expected = (lines(text) for text in (capsys.readouterr().out, printed))
    assert list(actual) == list(expected) == ["laser", "narrow", "wide"]
    assert actual["laser"] == expected["laser"]
    for name in ("narrow", "wide"):  # the page is written anew where the model changes by more than a bin
        np.testing.assert_allclose(actual[name][0], expected[name][0], rtol=0.0, atol=0.5)
        assert actual[name][1] == expected[name][1]


def test_every_picture_is_named() -> None:
    for study, prefix in ((ranging, "ranging"), (slant_range, "slant_range")):
        rows = [line for line in PICTURES.splitlines() if line.startswith(f"| `{prefix}-")]
        named = {
            name.removeprefix(f"{prefix}-").removeprefix("-") for row in rows for name in re.findall(r"`(.*?)`", row)
        }
        assert named == set(study.drawings(1))
