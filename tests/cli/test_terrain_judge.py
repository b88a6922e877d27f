"""``fti terrain judge``: a recorded laser flight over two maps, one of them displaced, and mistakes."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from fti.cli.main import main
from fti.logger.derived_log import DerivedLog
from fti.logger.log_layout import LogSettings
from fti.messages.outputs import HeightAboveGround, NavSolution
from fti.terrain.terrain import Terrain
from tests.cli.sessions import SECOND, STARTED, make_folder
from tests.post.judge_survey import BIAS_M, Survey, displaced, fly, ground, measure
from tests.terrain.elevation_files import Array, from_origin, write_ground, write_tif

LAT, LON = math.degrees(0.82), math.degrees(0.15)
LAG_S = 0.2
CONFIG = b"""
[session]
name = "s"
directory = "."

[[link]]
name = "laser_line"
kind = "serial"
port = "/dev/null"
baud = 115200

[[link]]
name = "ins_eth"
kind = "udp"
bind = "127.0.0.1:0"

[[device]]
name = "laser"
link = "laser_line"
driver = "lightware_ascii"
rate_hz = 5

[device.altimeter]
kind = "laser"
range_m = [1.0, 3000.0]

[[device]]
name = "ins"
link = "ins_eth"
driver = "imar_ixcom"
rate_hz = 10

[nav]
attitude = ["ins"]
position = ["ins"]
altimeters = ["laser"]
"""


def record(folder: Path, true: Terrain, headings_deg: tuple[float, ...]) -> Path:
    """The outputs of navigation on a survey whose laser is 200 ms late."""
    rng = np.random.default_rng(8)
    flight = fly(headings_deg, rng)
    session = make_folder(folder)
    log = DerivedLog(
        session, LogSettings(split_s=3600, split_mb=100, attachments=[("config.toml", "text/plain", CONFIG)])
    )
    outputs: list[NavSolution | HeightAboveGround] = [*solutions(flight, true)]
    outputs += heights(*measure(true, flight, LAG_S, rng))
    for output in sorted(outputs, key=lambda each: each.t_ns):
        log.write_output(output)
    log.close()
    return session.path


def solutions(flight: Survey, true: Terrain) -> list[NavSolution]:
    lat, lon, alt = (place.tolist() for place in true.frame.to_geodetic(flight.origins))
    return [
        NavSolution(
            t_ns=at_ns(t), t_valid_ns=at_ns(t), valid=True, reasons=(), position_source="ins", attitude_source="ins",
            altitude_source="ins", lat=lat[i], lon=lon[i], alt=alt[i], roll=float(flight.roll[i]), pitch=0.0,
            heading=float(flight.heading[i]), horizontal_sd=1.0, vertical_sd=1.0,
        )
        for i, t in enumerate(flight.t)
    ]  # fmt: skip


def heights(at: Array, ranges: Array) -> list[HeightAboveGround]:
    return [
        HeightAboveGround(
            t_ns=at_ns(t), t_valid_ns=at_ns(t), sensor="laser", raw=float(value), height_agl=None, sd=None, valid=True,
            reasons=(),
        )
        for t, value in zip(at, ranges, strict=True)
    ]  # fmt: skip


def at_ns(t: float) -> int:
    return STARTED + round(float(t) * SECOND)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sessions with crossing legs and with one leg, an exact map, one that is 30 m too far east, and land cover."""
    folder, true = tmp_path_factory.mktemp("judge"), ground(2)
    record(folder / "crossing", true, (0.0, 90.0, 180.0, 270.0))
    record(folder / "straight", true, (40.0,))
    for name, shift in (("exact.tif", 0.0), ("moved.tif", 30.0)):
        terrain = displaced(true, (shift, 0.0), None)

        def height(lat: Array, lon: Array, terrain: Terrain = terrain) -> Array:
            return terrain.height(np.radians(lat), np.radians(lon))

        write_ground(folder / name, height, "EPSG:32632", 380, 20.0, at=(LAT, LON))
    classes = np.array([[10, 80]], dtype=np.uint8)
    write_tif(folder / "cover.tif", classes, "EPSG:4326", from_origin(LON - 1.0, LAT + 1.0, 1.0, 2.0))
    return folder


def session(folder: Path, name: str) -> str:
    (path,) = (folder / name).iterdir()
    return str(path)


def words(folder: Path, name: str) -> list[str]:
    maps = [str(folder / each) for each in ("moved.tif", "exact.tif")]
    return ["terrain", "judge", session(folder, name), *maps, "--vertical", "ellipsoid"]


def test_the_exact_map_agrees_better(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cover = ["--land-cover", str(folder / "cover.tif"), "--plot", str(folder / "judge.png")]
    assert main([*words(folder, "crossing"), "--json", *cover]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["position_sources"] == ["ins"]
    (laser,) = result["altimeters"]
    assert [Path(each["map"]).name for each in laser["maps"]] == ["exact.tif", "moved.tif"]
    for each, east in zip(laser["maps"], (0.0, 30.0), strict=True):
        fit = each["with_shift"]
        assert fit["estimated"] == ["bias_m", "shift_east_m", "shift_north_m", "lag_s"]
        assert fit["shift_east_m"] == pytest.approx(east, abs=1.0)
        assert fit["shift_north_m"] == pytest.approx(0.0, abs=1.0)
        assert fit["lag_s"] == pytest.approx(LAG_S, abs=0.01)
        assert fit["bias_m"] == pytest.approx(BIAS_M, abs=0.2)
        assert fit["spread_m"] < 0.5
        assert each["covered"] == 1.0
    (given,) = laser["differences"]["as_given"]
    assert Path(given["better"]).name == "exact.tif"
    rows = {(Path(row["map"]).name, row["class"]): row for row in laser["land_cover"]}
    assert set(rows) == {(name, number) for name in ("exact.tif", "moved.tif") for number in (10, 80)}
    assert all(row["bias_m"] == pytest.approx(BIAS_M, abs=0.3) for row in rows.values())
    assert (folder / "judge.png").stat().st_size > 20_000


def test_one_straight_leg_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words(folder, "straight")) == 0
    output = capsys.readouterr().out
    assert re.search(r"laser: 4\d\d ranges \(narrow beam\), 5\.\d km in 12 blocks; position source: ins", output)
    refused = re.findall(r"(\w+)\.tif: shift or lag, not both: no legs with headings 60 deg apart", output)
    assert set(refused) == {"exact", "moved"}
    (shifted, _) = re.findall(r"with shift +\S+ \+- \S+ +\S+ \+- \S+ +\S+ \+- \S+ +(\S+)", output)
    assert shifted == "-"  # the lag is fixed


def test_mistakes_are_one_sentence(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def error_of(*more: str) -> str:
        assert main(["terrain", "judge", *more]) == 2
        error = capsys.readouterr().err
        return error[error.index("fti: ") :]

    flown, exact = session(folder, "crossing"), str(folder / "exact.tif")
    assert "nowhere" in error_of(str(folder / "nowhere"), exact)
    assert "missing.tif" in error_of(flown, str(folder / "missing.tif"), "--vertical", "ellipsoid")
    assert "vertical" in error_of(flown, exact)
    assert "must be given once" in error_of(flown, exact, exact, "--vertical", "ellipsoid")
    assert "other.tif=egm96: is not one of the elevation files" in error_of(
        flown, exact, "--vertical", "ellipsoid", "--vertical", "other.tif=egm96"
    )
    far = write_ground(tmp_path / "far.tif", lambda lat, lon: 0.0 * lat, "EPSG:32632", 50, 20.0, at=(LAT + 1.0, LON))
    assert "far.tif: does not touch the area" in error_of(flown, far, "--vertical", "ellipsoid")
    hole = write_ground(tmp_path / "hole.tif", lambda lat, lon: np.nan * lat, "EPSG:32632", 380, 20.0, at=(LAT, LON))
    assert "hole.tif: no heights in the area, only holes" in error_of(flown, hole, "--vertical", "ellipsoid")
    empty = make_folder(tmp_path)
    DerivedLog(empty, LogSettings(split_s=60, split_mb=1, attachments=[("config.toml", "text/plain", CONFIG)])).close()
    assert "has no heights of an altimeter" in error_of(str(empty.path), exact, "--vertical", "ellipsoid")
