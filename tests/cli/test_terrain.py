"""``fti terrain``: info for people and programs, the picture, mistakes in one sentence."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.legend import Legend

from fti.cli.main import main
from fti.errors import ConfigError
from fti.terrain.files.open_terrain import open_terrain
from fti.terrain.terrain import Terrain
from tests.terrain.elevation_files import LAT, LON, Array, write_ground

UTM = "EPSG:32632"


def ground(lat: Array, lon: Array) -> Array:
    return np.asarray(600.0 + (lat - LAT) * 5000.0 + 30.0 * np.sin(lon * 5000.0))


def with_hole(lat: Array, lon: Array) -> Array:
    return np.where(np.hypot((lat - LAT) * 111e3, (lon - LON) * 74e3) < 45.0, np.nan, ground(lat, lon) + 3.0)


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    fine = write_ground(
        tmp_path / "fine.tif", with_hole, UTM, 100, 4.0, tags={"TIFFTAG_DATETIME": "2020:01:02 00:00:00"}
    )
    return [fine, write_ground(tmp_path / "coarse.tif", ground, "EPSG:4979", 80, 3e-4)]


@pytest.fixture
def small_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fti.cli._terrain_map.PIXELS", 120)


def words(files: list[str]) -> list[str]:
    return [*files, "--vertical", "ellipsoid", "--at", f"{LAT},{LON}", "--radius", "700"]


def test_info_for_people(files: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["terrain", "info", *words(files)]) == 0
    output = capsys.readouterr().out
    for line in (
        r"0  .*fine\.tif",
        r"GTiff, 100 x 100 posts, a pixel is an area around its post",
        r"WGS 84 / UTM zone 32N; to WGS84 with an accuracy of 0 m",
        r"spacing      4\.00 m along a row, 4\.00 m along a column",
        r"vertical     ellipsoid \(from the caller\)$",
        r"vertical     ellipsoid \(from its coordinate system\)$",
        r"heights      5\d\d\.\d\d to 6\d\d\.\d\d m above the ellipsoid",
        r"holes        \d{3} posts, 3\.9 %",
        r"date         2020:01:02",
        r"layer 0      4 m, \d+ x \d+ posts, 0\.\d+ x 0\.\d+ km: fine\.tif",
        r"resampling   0\.\d\d m RMS, \d\.\d m at most at \d+ points, against the files' own surface; "
        r"sigma of the layer 1\.5\d m with sd_m = 1\.5 m of the files$",
        r"seam         at east -2\d\d and 2\d\d m, north -2\d\d and 2\d\d m, on posts of layer 1",
        r"layer 1      20 m, \d+ x \d+ posts, 1\.4\d x 1\.4\d km: coarse\.tif",
        r"geoid        none required",
    ):
        assert re.search(line, output, re.MULTILINE), line


def test_info_for_programs_has_the_layers(files: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["terrain", "info", *words(files), "--json"]) == 0
    table: dict[str, Any] = json.loads(capsys.readouterr().out)
    fine = table["files"][0]
    lat, lon = np.meshgrid(np.linspace(LAT - 0.001, LAT + 0.001, 5), np.linspace(LON - 0.001, LON + 0.001, 5))
    assert fine["lowest_m"] < ground(lat, lon).min() < fine["highest_m"]
    assert fine["used"]
    assert fine["holes"] == pytest.approx(math.pi * 45.0**2 / 16.0, rel=0.05)
    assert fine["south_deg"] < LAT < fine["north_deg"]
    centre = math.radians(LAT), math.radians(LON)
    terrain = open_terrain(files, vertical="ellipsoid", centre=centre, radius_m=700.0)
    found = [(layer["cell_m"], layer["rows"], layer["columns"], layer["east_m"]) for layer in table["layers"]]
    assert found == [(la.cell_m, *la.heights.shape, [la.east0, la.east1]) for la in terrain.layers]
    assert [layer["files"] for layer in table["layers"]] == [[0], [1]]
    assert [layer["resampling"]["rms_m"] for layer in table["layers"]] == [e.rms_m for e in terrain.resampling]
    assert table["frame"] == {"lat_deg": pytest.approx(LAT), "lon_deg": pytest.approx(LON), "alt_m": 0.0}
    assert (table["refused"], table["geoids"]) == (None, {})


def test_info_reports_why_there_is_no_terrain(files: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["terrain", "info", files[1], "--cell", "0.01"]) == 0
    assert "none         " in (output := capsys.readouterr().out)
    assert "must be at most 67 million: use a larger cell_m" in output
    assert main(["terrain", "info", files[1], "--at", "0,0", "--radius", "100"]) == 0
    output = capsys.readouterr().out
    assert "none         " in output
    assert "does not touch the area within 0.1 km around 0.00000, 0.00000" in output
    assert "deg east; in no layer" in output


@pytest.mark.usefixtures("small_picture")
@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_plot(files: list[str], suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / f"map{suffix}"
    ends = f"{LAT - 0.004},{LON - 0.004}/{LAT + 0.004},{LON + 0.004}"
    assert main(["terrain", "plot", *words(files), "--out", str(out), "--profile", ends]) == 0
    assert capsys.readouterr().out == f"{out}\n"
    assert out.read_bytes()[:5] in (b"\x89PNG\r", b"<?xml")
    with pytest.raises(SystemExit):  # nothing is overwritten
        main(["terrain", "plot", *words(files), "--out", str(out)])
    assert "already exists; choose another name" in capsys.readouterr().err


def texts_of(legend: Legend | None) -> list[str]:
    assert legend is not None
    return [text.get_text() for text in legend.get_texts()]


@pytest.mark.usefixtures("small_picture")
def test_the_picture_shows_heights_holes_seams_and_sources(files: list[str]) -> None:
    from fti.cli import _terrain_map

    centre = math.radians(LAT), math.radians(LON)
    fine = open_terrain(files[:1], vertical="ellipsoid", centre=centre, radius_m=150.0)
    holed = _terrain_map.draw_map(fine, None)
    relief, sources = holed.axes[0], holed.axes[1]
    assert relief.get_xlabel() == "east [m]"
    assert "no height" in texts_of(relief.get_legend())
    assert texts_of(sources.get_legend()) == ["fine.tif"]
    both = open_terrain(files, vertical="ellipsoid", centre=centre, radius_m=700.0)
    relief = _terrain_map.draw_map(both, None).axes[0]
    assert relief.get_legend() is None  # the coarse file knows the ground of the hole
    assert "4 m" in [text.get_text() for text in relief.texts]
    assert len(relief.patches) == 1


@pytest.mark.usefixtures("small_picture")
def test_a_picture_of_next_to_nothing(files: list[str]) -> None:
    """One cell is known: below one point of the picture, or between all of them, which are 3.35 m apart."""
    from fti.cli import _terrain_map

    centre = math.radians(LAT), math.radians(LON)
    sources = open_terrain(files[:1], vertical="ellipsoid", centre=centre, radius_m=150.0).sources
    for first in (201, 202):
        heights = np.full((400, 400), np.nan)
        heights[first : first + 2, first : first + 2] = 640.0
        terrain = replace(Terrain.from_array(heights, 1.0), sources=sources)
        if first == 201:
            assert texts_of(_terrain_map.draw_map(terrain, None).axes[1].get_legend()) == ["fine.tif"]
        else:
            with pytest.raises(ConfigError, match=r"no height is known at the points of the map"):
                _terrain_map.draw_map(terrain, None)


def waves(lat: Array, lon: Array) -> Array:
    """Waves of 50 m to the north; a degree of latitude has 111.2 km here."""
    return np.asarray(600.0 + 4.0 * np.sin(2.0 * math.pi * 111200.0 * (lat - LAT) / 50.0) + 0.0 * lon)


def test_spectrum(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = write_ground(tmp_path / "waves.tif", waves, UTM, 200, 4.0), tmp_path / "spectrum.png"
    arguments = ["terrain", "spectrum", file, "--vertical", "ellipsoid", "--speed", "50"]
    assert main([*arguments, "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert re.search(
        r"^posts +1\d\d x 1\d\d, 4 m apart: at 50 m/s more than 12\.50 Hz are useless$", printed, re.MULTILINE
    )
    waves_of = re.search(
        r"^heights +waves of (\d+) m and longer have 90 % of the variance; they need ([\d.]+) Hz", printed, re.MULTILINE
    )
    assert waves_of and float(waves_of[1]) == pytest.approx(50.0, rel=0.1)
    assert float(waves_of[2]) == pytest.approx(2.0 * 50.0 / float(waves_of[1]), rel=0.02)
    assert out.stat().st_size > 10_000 and printed.rstrip().endswith("spectrum.png")
    assert main([*arguments, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["heights_sd_m"] == pytest.approx(4.0 / math.sqrt(2.0), rel=0.1)


def test_ground_without_a_spectrum_is_one_sentence(files: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["terrain", "spectrum", files[0], "--vertical", "ellipsoid"]) == 2
    assert re.search(r"posts are unknown: .*; choose another area with --at and --radius", capsys.readouterr().err)
    flat = write_ground(Path(files[0]).with_name("flat.tif"), lambda lat, lon: 0.0 * lat + 5.0, UTM, 50, 4.0)
    assert main(["terrain", "spectrum", flat, "--vertical", "ellipsoid"]) == 0
    assert capsys.readouterr().out.count("the ground is a plane") == 2


@pytest.mark.usefixtures("small_picture")
def test_mistakes_are_one_sentence(files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, sentence in [
        (["info", str(tmp_path / "none.tif")], "none.tif: file not found"),
        (["info", files[0]], "fine.tif: its vertical datum is unknown"),
        (["info", *files, "--vertical", "msl"], "vertical = 'msl': must be one of egm96, egm2008, ellipsoid"),
        (["info", *files, "--vertical", "egm96"], "its coordinate system states ellipsoid, but vertical is 'egm96'"),
        (
            ["plot", *files, "--vertical", f"{files[0]}=ellipsoid", "--at", "10,20", "--radius", "100"],
            "does not touch the area",
        ),
    ]:
        out = ["--out", str(tmp_path / "x.png")] if arguments[0] == "plot" else []
        assert main(["terrain", *arguments, *out]) == 2
        output = capsys.readouterr().err
        assert sentence in output
        assert len(output.splitlines()) == 1
    outside = ["--profile=-10,20/-10,21", "--out", str(tmp_path / "x.png")]
    assert main(["terrain", "plot", *words(files), *outside]) == 2
    assert "no height is known between the two points" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--at", "47.9"], "must be latitude,longitude in degrees"),
        (["--at", "97.9,11"], "must be -90 to 90 and -360 to 360 degrees"),
        (["--at", "47.9,11.8"], "--at, --radius: only both together"),
        (["--radius", "-3"], "must be a length above 0"),
        (["--cell", "wide"], "must be a length above 0"),
        (
            ["--vertical", "egm96", "--vertical", "ellipsoid"],
            "--vertical ellipsoid: contradicts the earlier egm96",
        ),
        (["--profile", "47.9,11.8"], "must be two points"),
        (["--out", "map.jpg"], "must end with .png or .svg"),
    ],
)
def test_senseless_arguments_are_refused(
    arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    action = "plot" if arguments[0] in ("--profile", "--out") else "info"
    with pytest.raises(SystemExit):
        main(["terrain", action, "dem.tif", *arguments])
    assert sentence in capsys.readouterr().err
