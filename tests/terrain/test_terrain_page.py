"""docs/terrain.md: every example in Python runs, on files of the names that it uses."""

import re
from pathlib import Path

import numpy as np
import pytest

from tests.grids import needs_egm96
from tests.helpers import ROOT
from tests.terrain.elevation_files import Array, write_ground, write_hgt

PAGE = (ROOT / "docs" / "terrain.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def ground(lat: Array, lon: Array) -> Array:
    return np.asarray(600.0 + 30.0 * np.sin(lat * 2000.0) + 0.0 * lon)


@needs_egm96
def test_every_example_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_hgt(tmp_path, ground)
    write_ground(tmp_path / "dsm_2m.tif", ground, "EPSG:32632", 500, 2.0)
    names: dict[str, object] = {}
    for block in BLOCKS:
        exec(block, names)
    output = capsys.readouterr().out
    for line in (
        r"6\d\d\.\d m by N47E011\.hgt, egm96 from its format; date None",
        r"\('1\d{3}\.\d m', 'HIT'\), \('nan m', 'OUTSIDE'\)",
        r"\d{3}\.\d+ m AGL\(p\)",
        r"-?8[23]\.\d+ m PRESSURE\(1023\.25 hPa\)",
        r"frozenset\(\{.*<Refusal\.(FLAT|AMBIGUOUS)",  # the ground of this test has no slope to the east
        r"ELLIPSOID cannot be subtracted from MSL\(egm96\): convert one of the heights first",
    ):
        assert re.search(line, output), f"{line} not in:\n{output}"
    assert len(BLOCKS) == 6
