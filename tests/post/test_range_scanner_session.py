"""A session of the range scanners: summaries in the derived file, points in the tables of an export."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from fti import config
from fti.cli.main import main
from fti.logger.reading.recording import Recording
from fti.post import offline_run
from tests.helpers import ROOT
from tests.hil.worlds import scenario, world

DURATION_S = 1.0
#: Scans in a second, and points of a scan.
SCANS = {"scanner": (754, 384), "lines": (50, 200), "imager": (2, 5625)}


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """At 75 m above level ground, within the reach of the laser scanner."""
    shipped = config.load(ROOT / "configs/range_scanner.toml")
    there = world(DURATION_S, 1200.0)
    return offline_run.fly(shipped, scenario(), tmp_path_factory.mktemp("flown"), world=there)


@pytest.fixture(scope="module")
def tables(session: Path) -> Path:
    folder = session.parent / "tables"
    assert main(["export", str(session), "--out", str(folder), "--points", "--topic", "/*/range_scan*"]) == 0
    return folder


def rows(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8") as lines:
        return list(csv.DictReader(lines))


@pytest.mark.parametrize("name", SCANS)
def test_the_derived_file_has_a_summary_of_few_scans_and_no_point(session: Path, name: str) -> None:
    messages = Recording.open(session).messages(f"/{name}/")
    found = [data for topic, _, _, _, data in messages if topic == f"/{name}/range_scan"]
    assert 1 <= len(found) <= 5 * DURATION_S + 1
    for data in found:
        assert len(data) < 250
        assert json.loads(data).keys() == {"stamp", "points", "returns", "nearest", "median", "valid"}


@pytest.mark.parametrize("name", SCANS)
def test_an_export_has_every_scan_and_with_points_every_point(tables: Path, name: str) -> None:
    rate, size = SCANS[name]
    scans, points = rows(tables / f"{name}_range_scan.csv"), rows(tables / f"{name}_range_scan_points.csv")
    assert len(scans) == pytest.approx(rate * DURATION_S, abs=2) and {int(row["points"]) for row in scans} == {size}
    assert len(points) == len(scans) * size
    returns = sum(row["range [m]"] != "" for row in points)
    assert returns == sum(int(row["returns"]) for row in scans) > 0
    times = np.array([int(row["publish_time_ns"]) for row in points]).reshape(-1, size)
    assert (np.diff(times, axis=1) >= 0).all()
    ranges = [float(row["range [m]"]) for row in points if row["range [m]"]]
    assert min(ranges) == pytest.approx(min(float(row["nearest [m]"]) for row in scans if row["nearest [m]"]))
    assert 50.0 < min(ranges) < max(ranges) < 131.0


def test_without_the_option_there_are_no_points(session: Path, tmp_path: Path) -> None:
    assert main(["export", str(session), "--out", str(tmp_path), "--topic", "/imager/*"]) == 0
    assert [file.name for file in sorted(tmp_path.glob("*.csv"))] == ["imager_range_scan.csv"]


def test_points_are_not_resampled(session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(session), "--out", str(tmp_path), "--points", "--resample", "10"]) != 0
    assert "--points: points cannot be resampled" in capsys.readouterr().err
    assert main(["export", str(session), "--out", str(tmp_path), "--resample", "10"]) == 0
    head = (tmp_path / "resampled.csv").read_text(encoding="utf-8").partition("\n")[0].split(",")
    assert {"scanner_range_scan.median [m]", "imager_range_scan.returns"} <= set(head)
