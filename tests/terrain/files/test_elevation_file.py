"""One elevation file: what it says of itself, what it is refused for, reading."""

import math
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
import rasterio
from rasterio.windows import Window

from fti.errors import ConfigError, MissingError
from fti.terrain.file_info import ElevationFileInfo
from fti.terrain.files.elevation_file import ElevationFile
from fti.terrain.files.vertical import datum_names_by_file
from tests.terrain.elevation_files import (
    LAT,
    LON,
    Array,
    from_origin,
    posts_of,
    write_dted,
    write_ground,
    write_hgt,
    write_tif,
)

UTM = "EPSG:32632"
CORNER = from_origin(700_000.0, 5_300_000.0, 10.0, 10.0)
FLAT = np.full((4, 4), 500.0)


def slope(lat: Array, lon: Array) -> Array:
    return np.asarray(600.0 + (lat - LAT) * 5000.0 + (lon - LON) * 3000.0)


def opened(path: str, vertical: str | Mapping[str, str] | None = "ellipsoid") -> "closing[ElevationFile]":
    return closing(ElevationFile(path, datum_names_by_file(vertical, [path])))


def source_of(path: str, vertical: str | Mapping[str, str] | None = None) -> ElevationFileInfo:
    with opened(path, vertical) as file:
        return file.source


def test_metadata_of_a_geotiff(tmp_path: Path) -> None:
    tags = {"TIFFTAG_DATETIME": "2019:05:04 03:02:01", "AREA_OR_POINT": "Point"}
    path = write_ground(tmp_path / "dem.tif", slope, "EPSG:32632+5773", 80, 20.0, tags=tags)
    source = source_of(path)
    assert (source.path, source.format, source.rows, source.columns) == (path, "GTiff", 80, 80)
    assert source.crs == "WGS 84 / UTM zone 32N"
    assert source.spacing_m == pytest.approx((20.0, 20.0), rel=0.001)  # the scale of UTM
    assert (source.vertical, source.vertical_by, source.unit_m) == ("egm96", "its coordinate system", 1.0)
    assert (source.pixel, source.date, source.accuracy_m) == ("point", "2019:05:04 03:02:01", 0.0)
    assert math.degrees(source.south) < LAT < math.degrees(source.north)
    assert math.degrees(source.west) < LON < math.degrees(source.east)
    assert math.degrees(source.north - source.south) * 111_200 == pytest.approx(1600.0, rel=0.05)


@pytest.mark.parametrize(
    ("west", "degrees", "expected"),
    [(-100.0, 200.0, (-100.0, 100.0)), (100.0, 200.0, (100.0, -60.0)), (0.0, 360.0, (-180.0, 180.0))],
)
def test_a_file_over_half_the_earth_has_the_right_half(
    tmp_path: Path, west: float, degrees: float, expected: tuple[float, float]
) -> None:
    path = write_tif(tmp_path / "dem.tif", FLAT, "EPSG:4326", from_origin(west, 10.0, degrees / 4, 5.0))
    source = source_of(path, "egm96")
    assert np.degrees((source.west, source.east)) == pytest.approx(expected)


def test_what_a_dted_and_an_hgt_file_say(tmp_path: Path) -> None:
    dted, hgt = source_of(write_dted(tmp_path, slope)), source_of(write_hgt(tmp_path, slope))
    assert (dted.format, dted.rows, dted.vertical, dted.date) == ("DTED", 121, "egm96", None)
    assert (hgt.format, hgt.rows, hgt.vertical, hgt.pixel) == ("SRTMHGT", 1201, "egm96", "point")
    assert hgt.spacing_m == pytest.approx((62.3, 92.6), abs=0.5)  # 3 arc seconds at 47.5 degrees
    assert np.degrees((hgt.south, hgt.north)) == pytest.approx((47 - 0.5 / 1200, 48 + 0.5 / 1200))


def test_a_dted_file_with_another_datum_is_refused(tmp_path: Path) -> None:
    path = Path(write_dted(tmp_path, slope))
    data = path.read_bytes()
    header = data.index(b"DSIU")
    assert data[header + 141 : header + 144] == b"MSL"  # MIL-PRF-89020B, table of the DSI record
    path.write_bytes(data[: header + 141] + b"NVD" + data[header + 144 :])
    with pytest.raises(ConfigError, match="datum is the datum NVD; must be one of egm96, egm2008, ellipsoid"):
        source_of(str(path))


@pytest.mark.parametrize("crs", [UTM, "EPSG:4326", "EPSG:31468"])
def test_reading_agrees_with_rasterio_at_the_posts(tmp_path: Path, crs: str) -> None:
    size, step = 60, (20.0 if crs != "EPSG:4326" else 2e-4)
    path = write_ground(tmp_path / "dem.tif", slope, crs, size, step)
    rows, columns = (13, 41), (5, 59)
    with opened(path) as file, rasterio.open(path) as judge:
        read = file.read(rows, columns)
        x, y = posts_of(judge.transform, judge.shape)
        part = slice(*rows), slice(*columns)
        sampled = [value[0] for value in judge.sample(zip(x[part].ravel(), y[part].ravel(), strict=True))]
        np.testing.assert_array_equal(read.ravel(), sampled)
        row, column = np.meshgrid(np.arange(60.0), np.arange(60.0), indexing="ij")
        lat, lon = file.places(row, column)
        there_row, there_column = file.indices(lat, lon)
        assert max(np.abs(there_row - row).max(), np.abs(there_column - column).max()) < 1e-5
        np.testing.assert_allclose(slope(np.degrees(lat), np.degrees(lon)), judge.read(1), atol=1e-4)


def test_whole_numbers_have_voids_without_a_declaration(tmp_path: Path) -> None:
    heights = np.array([[100, -32768], [300, 400]], dtype=np.int16)
    path = write_tif(tmp_path / "dem.tif", heights, UTM, CORNER)
    with opened(path, "egm96") as file:
        np.testing.assert_array_equal(file.read((0, 2), (0, 2)), [[100.0, np.nan], [300.0, 400.0]])


# -------------------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("no CRS", {"crs": None}, "has no coordinate system: its position on Earth is unknown"),
        ("no place", {"transform": from_origin(0.0, 0.0, 1.0, -1.0)}, "has no position of its first post"),
        ("engine", {"crs": 'LOCAL_CS["engine",UNIT["metre",1]]'}, "'engine' must be geographic or projected"),
        ("one post", {"heights": FLAT[:1]}, "has 1 x 4 posts; must be at least 2 x 2"),
        ("NAVD88", {"crs": "EPSG:32632+5703"}, "datum is 'NAVD88 height'; must be one of egm96, egm2008, ell"),
        ("cubits", {"units": "cubit"}, "the unit of its heights is 'cubit'; must be metre, foot or US survey foot"),
        ("feet", {"crs": "EPSG:2225"}, "its coordinates are in US survey foot, but the unit of its heights is unknown"),
        ("metres and feet", {"crs": "EPSG:32632+5773", "units": "ft"}, "heights in metre, but its values are in ft"),
        ("depths", {"crs": "EPSG:32632+5715"}, "has depths, 'MSL depth': must be heights"),
        (
            "Bessel",
            {"crs": pyproj.CRS("EPSG:31468").to_3d().to_wkt()},
            "its vertical datum is the ellipsoid 'Bessel 1841'; must",
        ),
        ("complex", {"dtype": "complex64"}, "are complex or colour indices"),
        ("off Earth", {"transform": from_origin(1e9, 1e9, 1e7, 1e7)}, "its edges are not valid positions"),
    ],
)
def test_what_is_refused(tmp_path: Path, name: str, arguments: dict[str, Any], words: str) -> None:
    defaults = {"heights": FLAT, "crs": UTM, "transform": CORNER}
    path = write_tif(tmp_path / "wrong.tif", **{**defaults, **arguments})
    with pytest.raises(ConfigError, match=f"wrong.tif: .*{words}"):
        source_of(path, "egm96")


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(MissingError, match=r"none\.tif: file not found"):
        source_of(str(tmp_path / "none.tif"))
    (tmp_path / "letter.tif").write_text("Dear Sir")
    with pytest.raises(ConfigError, match=r"letter\.tif: is not an elevation file that GDAL can read"):
        source_of(str(tmp_path / "letter.tif"))
    with pytest.raises(ConfigError, match="is not an elevation file that GDAL can read"):
        source_of(str(tmp_path))


def test_a_picture_is_refused(tmp_path: Path) -> None:
    with rasterio.open(
        tmp_path / "rgb.tif", "w", driver="GTiff", width=4, height=4, count=3, dtype="uint8", crs=UTM, transform=CORNER
    ) as file:
        file.write(np.zeros((3, 4, 4), np.uint8))
    with pytest.raises(ConfigError, match=r"rgb\.tif: has 3 bands; must have one"):
        source_of(str(tmp_path / "rgb.tif"), "egm96")


def test_a_picture_in_numbers_of_colours_is_refused(tmp_path: Path) -> None:
    path = write_tif(tmp_path / "map.tif", FLAT.astype(np.uint8), UTM, CORNER)
    with rasterio.open(path, "r+") as file:
        file.write_colormap(1, {244: (200, 0, 0)})
    with pytest.raises(ConfigError, match=r"map\.tif: its values are complex or colour indices"):
        source_of(path, "egm96")


@pytest.mark.parametrize("tiled", [False, True])
def test_what_was_never_written_is_a_hole(tmp_path: Path, tiled: bool) -> None:
    """GDAL reads 0 m where a writer was stopped, or left blocks out."""
    path, size = tmp_path / "dem.tif", {"width": 90, "height": 100, "count": 1}
    blocks = {"tiled": True, "blockxsize": 16, "blockysize": 16} if tiled else {"blockysize": 16}
    profile = {"driver": "GTiff", "dtype": "float32", "crs": UTM, "transform": CORNER, "sparse_ok": True, **blocks}
    with rasterio.open(path, "w", **size, **profile) as file:
        file.write(np.full((16, 90), 500.0, np.float32), 1, window=Window(0, 48, 90, 16))
    with opened(str(path)) as opened_file:
        for rows, columns in (((0, 100), (0, 90)), ((50, 70), (3, 35)), ((63, 65), (88, 90)), ((96, 100), (0, 2))):
            read = opened_file.read(rows, columns)
            row = np.arange(*rows)[:, None] + 0 * np.arange(*columns)
            np.testing.assert_array_equal(read, np.where((row >= 48) & (row < 64), 500.0, np.nan))


def test_a_file_that_was_cut_off_is_refused(tmp_path: Path) -> None:
    """Cut behind the directory, as a download that was stopped: it opens, and breaks off in reading."""
    path = Path(
        write_tif(tmp_path / "dem.tif", np.full((1024, 1024), 500.0), UTM, CORNER, driver="COG", compress="none")
    )
    path.write_bytes(path.read_bytes()[:-2_000_000])
    with opened(str(path)) as file:
        assert (file.read((0, 100), (0, 300)) == 500.0).all()
        with pytest.raises(ConfigError, match=r"dem\.tif: cannot be read: .*IReadBlock failed"):
            file.read((0, 1024), (0, 1024))


@pytest.mark.parametrize("name", ["N47E011.hgt", "tile.hgt"])
def test_a_tile_with_a_wrong_size_or_name_is_refused(tmp_path: Path, name: str) -> None:
    data = Path(write_hgt(tmp_path, slope)).read_bytes()
    (tmp_path / name).write_bytes(data[: None if name == "tile.hgt" else -2])
    with pytest.raises(ConfigError, match=f"{name}: is not an elevation file that GDAL can read"):
        source_of(str(tmp_path / name))


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    path = write_tif(tmp_path / "dem.tif", rng.uniform(0, 900, (300, 300)), UTM, CORNER, compress="deflate")
    data = bytearray(Path(path).read_bytes())
    data[len(data) // 2 : len(data) // 2 + 2000] = bytes(2000)
    Path(path).write_bytes(data)
    with opened(path, "egm96") as file, pytest.raises(ConfigError, match=r"dem\.tif: cannot be read"):
        file.read((0, 300), (0, 300))


# -------------------------------------------------------------------------------------------------- vertical datum


def test_a_missing_vertical_datum_is_refused(tmp_path: Path) -> None:
    path = write_tif(tmp_path / "dem.tif", FLAT, UTM, CORNER)
    with pytest.raises(ConfigError, match=r"dem\.tif: its vertical datum is unknown; set"):
        source_of(path)
    with pytest.raises(ConfigError, match="vertical = 'msl': must be one of egm96, egm2008, ellipsoid"):
        source_of(path, "msl")
    assert source_of(path, {path: "egm2008", "*": "egm96"}).vertical == "egm2008"
    assert source_of(path, {"*": "egm96"}).vertical == "egm96"
    with pytest.raises(ConfigError, match=r"vertical: 'dem\.tif': not one of the files"):
        source_of(path, {"dem.tif": "egm2008"})


def test_two_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    by_crs = write_tif(tmp_path / "dem.tif", FLAT, "EPSG:32632+5773", CORNER)
    for path, by in ((by_crs, "its coordinate system"), (write_hgt(tmp_path, slope), "its format")):
        with pytest.raises(ConfigError, match=f"{by} states egm96, but vertical is 'ellipsoid'"):
            source_of(path, "ellipsoid")
        assert source_of(path, {path: "ellipsoid"}).vertical == "ellipsoid"
        assert source_of(path, "egm96").vertical_by == by


def test_a_file_that_states_its_accuracy_has_its_own_sigma(tmp_path: Path) -> None:
    """DTED: 10 m with 90 % are 6.08 m.  A file without has none."""
    with_accuracy = write_dted(tmp_path, lambda lat, lon: 100.0 * lat + lon, tags={"DTED_VerticalAccuracy_ACC": "0010"})
    without = write_dted(tmp_path, lambda lat, lon: 100.0 * lat + lon, south=48)
    sds = [ElevationFile(path, {}).source.sd_m for path in (with_accuracy, without)]
    assert sds == [pytest.approx(6.08, abs=0.01), None]
