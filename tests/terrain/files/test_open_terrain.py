"""Elevation files as a terrain: the file's surface, exactly, in the local frame; layers, seams, holes."""

import contextlib
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine

from fti.errors import ConfigError, MissingError
from fti.geodesy import geoid as geoids
from fti.geodesy.geoid import load_geoid
from fti.terrain.file_info import NO_SOURCE
from fti.terrain.files import resample
from fti.terrain.files.elevation_file import ElevationFile
from fti.terrain.files.mosaic import Mosaic, assemble
from fti.terrain.files.open_terrain import open_terrain
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.seams import check_stack
from fti.terrain.terrain import Terrain
from tests.grids import needs_egm96
from tests.terrain.elevation_files import (
    LAT,
    LON,
    Array,
    back_to_earth,
    bilinear_in,
    from_origin,
    move,
    write_dted,
    write_ground,
    write_hgt,
    write_tif,
)

CENTRE = math.radians(LAT), math.radians(LON)
EARTH = 6.4e6
UTM, GAUSS_KRUEGER = "EPSG:32632", "EPSG:31468"


def hills(lat: Array, lon: Array) -> Array:
    """Waves of 3 and 2 km, 150 m high, on a gentle slope."""
    north, east = (lat - LAT) * 111_000.0, (lon - LON) * 74_000.0
    return 700.0 + 150.0 * np.sin(north / 3000.0 * 2 * np.pi) * np.cos(east / 2000.0 * 2 * np.pi) + 0.02 * east


def level(lat: Array, lon: Array) -> Array:
    return np.full(np.broadcast_shapes(lat.shape, lon.shape), 640.0)


def check_against(terrain: Terrain, path: str, undulated: bool, metres: float = 1e-5) -> None:
    """Posts lie on the file's bilinear surface; 1e-5 m is where the steps to them come to rest, ten times over."""
    chosen, rng = terrain.finest, np.random.default_rng(11)
    row, column = (rng.integers(0, size, 300) for size in chosen.heights.shape)
    up = chosen.heights[row, column]
    lat, lon, alt = back_to_earth(terrain, chosen.east[column], chosen.north[row], up)
    shift = load_geoid("egm96").undulation(np.radians(lat), np.radians(lon)) if undulated else 0.0
    known = np.isfinite(up)
    assert known.mean() > 0.9
    off = np.abs((alt - shift)[known] - bilinear_in(path, lat[known], lon[known]))
    assert np.isfinite(off).mean() > 0.9  # the others lie between outermost posts and edge
    assert np.nanmax(off) < metres


# ------------------------------------------------------------------------------------------ formats and coordinates


@pytest.mark.parametrize(
    ("crs", "place", "metres"),
    [
        (UTM, (LAT, LON), 1e-5),
        (GAUSS_KRUEGER, (LAT, LON), 1e-3),  # its change of datum is a grid with kinks, 1 m exact
        ("EPSG:3035", (LAT, LON), 1e-5),
        ("EPSG:32734", (-33.9, 18.4), 1e-5),  # Cape Town
        ("EPSG:3413", (78.2, 15.5), 1e-5),  # Svalbard, polar stereographic
        ("EPSG:3857", (-54.8, -68.3), 1e-5),  # Ushuaia, web Mercator
    ],
)
def test_a_projected_file_keeps_its_surface(
    tmp_path: Path, crs: str, place: tuple[float, float], metres: float
) -> None:
    def wavy(lat: Array, lon: Array) -> Array:
        return hills(lat - place[0] + LAT, lon - place[1] + LON)

    path = write_ground(tmp_path / "dem.tif", wavy, crs, 240, 25.0, at=place)
    centre = math.radians(place[0]), math.radians(place[1])
    terrain = open_terrain([path], centre=centre, radius_m=1000.0, vertical="ellipsoid")
    assert terrain.finest.cell_m == pytest.approx(float(f"{min(terrain.sources[0].spacing_m):.3g}"))
    check_against(terrain, path, False, metres)


@pytest.mark.parametrize(
    "transform", [Affine(3e-4, 1e-4, 11.75, 1e-4, -3e-4, 47.9), from_origin(11.76, 47.93, 3e-4, 2e-4)]
)
def test_a_geographic_file_may_be_turned(tmp_path: Path, transform: Affine) -> None:
    path = write_ground(tmp_path / "dem.tif", hills, "EPSG:4326", 300, 0.0, transform=transform)
    terrain = open_terrain([path], centre=CENTRE, radius_m=1500.0, vertical="ellipsoid")
    check_against(terrain, path, undulated=False)


@needs_egm96
@pytest.mark.parametrize("write", [write_hgt, write_dted])
def test_formats_that_are_above_sea_level(tmp_path: Path, write: type) -> None:
    path = write(tmp_path, hills)
    terrain = open_terrain([path], centre=CENTRE, radius_m=8000.0)
    assert (terrain.sources[0].vertical, terrain.sources[0].vertical_by) == ("egm96", "its format")
    check_against(terrain, path, undulated=True)


def test_a_change_of_datum_that_is_unknown_there_is_refused(tmp_path: Path) -> None:
    """Swiss coordinates near Munich: PROJ would take the datums for one and be 100 m off."""
    path = write_ground(tmp_path / "dem.tif", hills, "EPSG:2056", 50, 25.0)
    with pytest.raises(ConfigError, match=r"no transformation from WGS84 to 'CH1903\+ / LV95' in the area of the file"):
        open_terrain([path], vertical="ellipsoid")


def test_far_from_the_origin_the_earth_falls_away(tmp_path: Path) -> None:
    """80 km from the frame's origin ``up`` is 500 m below the height, and still exact."""
    path = write_ground(tmp_path / "dem.tif", hills, UTM, 200, 50.0, at=(LAT + 0.7, LON))
    terrain = open_terrain([path], centre=CENTRE, radius_m=85_000.0, vertical="ellipsoid")
    assert np.nanmean(terrain.finest.heights) == pytest.approx(700.0 - 77_800.0**2 / 2 / EARTH, abs=150.0)
    check_against(terrain, path, undulated=False)


def test_across_the_antimeridian(tmp_path: Path) -> None:
    """Two tiles, the second one at -180 degrees, and a frame beyond."""
    step = 1 / 1200
    paths = [
        write_tif(
            tmp_path / f"{west:g}.tif", np.full((120, 120), high), "EPSG:4326", from_origin(west, 0.05, step, step)
        )
        for west, high in ((179.9, 100.0), (-180.0, 101.0))
    ]
    terrain = open_terrain(paths, vertical="ellipsoid")
    assert terrain.height(0.0, math.radians(179.95)) == pytest.approx(100.0, abs=1e-3)
    assert terrain.height(0.0, math.radians(-179.95)) == pytest.approx(101.0, abs=1e-3)
    assert 100.0 < terrain.height(0.0, math.pi) < 101.0
    assert not np.isnan(terrain.height(0.0, np.radians(np.linspace(179.91, 180.09, 500)))).any()


@pytest.mark.parametrize("pixel", ["Area", "Point"])
def test_a_post_is_the_middle_of_its_pixel(tmp_path: Path, pixel: str) -> None:
    """GDAL writes the tie point of a point raster half a pixel in, and takes it back when it reads."""
    path = write_ground(tmp_path / "dem.tif", hills, UTM, 100, 20.0, tags={"AREA_OR_POINT": pixel})
    terrain = open_terrain([path], centre=CENTRE, radius_m=500.0, vertical="ellipsoid")
    assert terrain.sources[0].pixel == pixel.lower()
    check_against(terrain, path, undulated=False)
    lat, lon, _ = back_to_earth(terrain, np.array([100.0]), np.array([-200.0]), np.array([700.0]))
    # a quarter of a post's move to the side would be 1 m here
    assert terrain.height(np.radians(lat), np.radians(lon)) == pytest.approx(hills(lat, lon), abs=0.15)


@pytest.mark.parametrize(("units", "metres"), [("metre", 1.0), ("ft", 0.3048), ("US survey foot", 1200 / 3937)])
def test_heights_in_feet(tmp_path: Path, units: str, metres: float) -> None:
    path = write_ground(tmp_path / "dem.tif", level, UTM, 50, 10.0, units=units)
    terrain = open_terrain([path], centre=CENTRE, radius_m=100.0, vertical="ellipsoid")
    assert terrain.height(*CENTRE) == pytest.approx(640.0 * metres, abs=1e-3)


def test_the_vertical_part_of_the_coordinate_system_has_a_unit_too(tmp_path: Path) -> None:
    path = write_ground(tmp_path / "dem.tif", level, "EPSG:32632+6360", 50, 10.0)  # NAVD88 in US survey feet
    terrain = open_terrain([path], centre=CENTRE, radius_m=100.0, vertical={path: "ellipsoid"})
    assert terrain.height(*CENTRE) == pytest.approx(640.0 * 1200 / 3937, abs=1e-3)


def test_scale_and_offset_of_the_file_count(tmp_path: Path) -> None:
    path = write_ground(tmp_path / "dem.tif", level, UTM, 50, 10.0)
    with rasterio.open(path, "r+") as file:
        file.scales, file.offsets = (0.5,), (100.0,)
    terrain = open_terrain([path], centre=CENTRE, radius_m=100.0, vertical="ellipsoid")
    assert terrain.height(*CENTRE) == pytest.approx(420.0, abs=1e-3)


# ---------------------------------------------------------------------------------------------------- vertical datum


@needs_egm96
def test_the_datum_moves_the_surface_by_the_undulation(tmp_path: Path) -> None:
    here = float(load_geoid("egm96").undulation(*CENTRE))
    assert here == pytest.approx(46.0, abs=1.5)
    for crs, vertical, expected, by in [
        (UTM, "egm96", 640.0 + here, "the caller"),
        (UTM, "ellipsoid", 640.0, "the caller"),
        ("EPSG:32632+5773", None, 640.0 + here, "its coordinate system"),
        ("EPSG:32632+5773", "egm96", 640.0 + here, "its coordinate system"),
    ]:
        path = write_ground(tmp_path / "dem.tif", level, crs, 50, 10.0)
        terrain = open_terrain([path], centre=CENTRE, radius_m=100.0, vertical=vertical)
        assert terrain.height(*CENTRE) == pytest.approx(expected, abs=1e-3)
        assert terrain.sources[0].vertical_by == by
    path = write_ground(tmp_path / "dem.tif", level, "EPSG:4979", 50, 1e-4)
    assert open_terrain([path], centre=CENTRE, radius_m=100.0).height(*CENTRE) == pytest.approx(640.0, abs=1e-3)


def test_a_missing_geoid_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_ground(tmp_path / "dem.tif", level, "EPSG:32632+3855", 50, 10.0)
    monkeypatch.setattr(geoids, "grid_directories", lambda: (tmp_path,))
    monkeypatch.setattr("fti.terrain.files.open_terrain.load_geoid", load_geoid.__wrapped__)
    with pytest.raises(MissingError, match=r"egm2008 \(us_nga_egm08_25\.tif") as refused:
        open_terrain([path])
    assert str(tmp_path) in str(refused.value)


# ------------------------------------------------------------------------------------------- what resampling costs


def test_a_plane_costs_nothing_but_the_curvature_of_the_earth(tmp_path: Path) -> None:
    """cell^2 / 8 R per axis: 4e-5 m at 12.5 m; the rest is single precision of the file."""

    def plane(lat: Array, lon: Array) -> Array:
        x, y = to_utm.transform(lon, lat)
        return np.asarray(600.0 + 0.1 * (x - x0) - 0.05 * (y - y0))

    import pyproj

    to_utm = pyproj.Transformer.from_crs("EPSG:4326", UTM, always_xy=True)
    x0, y0 = to_utm.transform(LON, LAT)
    path = write_ground(tmp_path / "dem.tif", plane, UTM, 200, 10.0)
    for cell in (7.0, 12.5, 31.0):
        terrain = open_terrain([path], centre=CENTRE, radius_m=600.0, cell_m=cell, vertical="ellipsoid")
        lat, lon = (np.radians(np.random.default_rng(3).uniform(c - 0.004, c + 0.004, 500)) for c in (LAT, LON))
        error = terrain.height(lat, lon) - plane(np.degrees(lat), np.degrees(lon))
        assert np.abs(error).max() < 2 * cell**2 / 8 / EARTH + 5e-5


def test_a_paraboloid_costs_what_is_stated(tmp_path: Path) -> None:
    """Against the ground k (cell^2 + spacing^2) / 8 per axis, and about as much where both are worst."""
    curvature, spacing = 2e-3, 20.0

    def bowl(lat: Array, lon: Array) -> Array:
        north, east = (lat - LAT) * 111_000.0, (lon - LON) * 111_000.0 * math.cos(math.radians(LAT))
        return np.asarray(600.0 + curvature / 2 * (north**2 + east**2))

    path = write_ground(tmp_path / "dem.tif", bowl, UTM, 100, spacing)
    lat, lon = (np.radians(np.random.default_rng(3).uniform(c - 0.003, c + 0.003, 1500)) for c in (LAT, LON))
    surface = bilinear_in(path, np.degrees(lat), np.degrees(lon))
    for cell in (5.0, 10.0, 20.0):
        terrain = open_terrain([path], centre=CENTRE, radius_m=600.0, cell_m=cell, vertical="ellipsoid")
        error = terrain.height(lat, lon) - bowl(np.degrees(lat), np.degrees(lon))
        bound = 2 * curvature * (cell**2 + spacing**2) / 8
        assert 0.6 * bound < error.max() < 1.02 * bound
        assert error.min() > -0.02 * bound  # a chord lies above a bowl
        assert np.abs(terrain.height(lat, lon) - surface).max() < 1.02 * 2 * curvature * cell * spacing / 4


# ----------------------------------------------------------------------------------------------------- many files


def test_tiles_of_one_lattice_leave_no_gap(tmp_path: Path) -> None:
    """Four tiles that share no post: cells between the last post of one and the first of the next are whole."""
    whole = write_ground(tmp_path / "whole.tif", hills, UTM, 200, 10.0)
    with rasterio.open(whole) as file:
        heights, transform = file.read(1), file.transform
    tiles = [
        write_tif(
            tmp_path / f"{i}{j}.tif",
            heights[i : i + 100, j : j + 100],
            UTM,
            Affine(10.0, 0.0, move(transform, j, i)[0], 0.0, -10.0, move(transform, j, i)[1]),
        )
        for i in (0, 100)
        for j in (0, 100)
    ]
    arguments: dict[str, Any] = {"centre": CENTRE, "radius_m": 700.0, "vertical": "ellipsoid"}
    one, four = open_terrain([whole], **arguments), open_terrain(tiles, **arguments)
    np.testing.assert_allclose(four.finest.heights, one.finest.heights, rtol=0, atol=1e-9)
    numbers = {int(four.source(e, n)) for e in (-500.0, 500.0) for n in (-500.0, 500.0)}
    assert numbers == {0, 1, 2, 3}
    assert four.sources[2].path == tiles[2]


def test_tiles_of_two_lattices_leave_no_gap(tmp_path: Path) -> None:
    """A file reaches to the edge of its pixels, where the neighbour's begin; here their posts are 10 and 12 m apart."""
    west = write_ground(tmp_path / "west.tif", hills, UTM, 100, 10.0)
    with rasterio.open(west) as file:
        edge = move(file.transform, 100, 0)
    corner = from_origin(*edge, 12.0, 12.0)
    east = write_ground(tmp_path / "east.tif", hills, UTM, 80, 0.0, transform=corner)
    terrain = open_terrain([west, east], vertical="ellipsoid")
    assert len(terrain.layers) == 1
    places, across = np.linspace(-900.0, 900.0, 1801), np.linspace(-400.0, 400.0, 81)
    assert not np.isnan(terrain.up(places[None, :], across[:, None])).any()


def mosaics_of(folder: Path, crs: str, *tiles: tuple[float, float, str]) -> list[tuple[int, ...]]:
    """Which tiles of 10 x 10 posts, 100 m apart, make which mosaic; west, north [m] and vertical datum of each."""
    with contextlib.ExitStack() as stack:
        files = []
        for number, (west, north, vertical) in enumerate(tiles):
            corner = from_origin(west, north, 100.0, 100.0)
            path = write_tif(folder / f"{number}.tif", np.zeros((10, 10)), crs, corner)
            files.append(stack.enter_context(contextlib.closing(ElevationFile(path, {"*": vertical}))))
        return [mosaic.numbers for mosaic in assemble(enumerate(files))]


def test_one_lattice_with_two_steps_from_wgs84_is_two(tmp_path: Path) -> None:
    """European datum 1950 in Spain and off Norway: one grid of numbers, and two changes of datum, 3.7 m apart."""
    tiles = [(4e5, north, "egm96") for north in (4_650_000.0, 4_649_000.0, 6_700_000.0)]
    assert mosaics_of(tmp_path, "EPSG:23031", *tiles) == [(0, 1), (2,)]


def test_files_of_two_datums_or_beside_the_lattice_are_no_mosaic(tmp_path: Path) -> None:
    """2 m are 0.02 of a post distance; 0.5 m are not seen."""
    places = ((7e5, 5.3e6, "egm96"), (7.01e5, 5.3e6, "ellipsoid"), (7.02e5 + 2.0, 5.3e6, "egm96"))
    assert mosaics_of(tmp_path, UTM, *places, (7.03e5 + 0.5, 5.3e6, "egm96")) == [(0, 3), (1,), (2,)]


@needs_egm96
def test_tiles_of_two_datums_keep_each_its_own(tmp_path: Path) -> None:
    south = write_ground(tmp_path / "south.tif", level, UTM, 100, 10.0)
    west, north = rasterio_corner(south)
    upper = from_origin(west, north + 1000.0, 10.0, 10.0)
    other = write_ground(tmp_path / "north.tif", level, UTM, 100, 0.0, transform=upper)
    terrain = open_terrain([south, other], vertical={south: "egm96", other: "ellipsoid"})
    lat = CENTRE[0] + 1000.0 / EARTH
    undulation = float(load_geoid("egm96").undulation(*CENTRE))
    assert terrain.height(*CENTRE) == pytest.approx(640.0 + undulation, abs=1e-2)
    assert terrain.height(lat, CENTRE[1]) == pytest.approx(640.0, abs=1e-3)


def rasterio_corner(path: str) -> tuple[float, float]:
    """x and y of the outer corner of the first pixel [m]."""
    with rasterio.open(path) as file:
        return file.transform[2], file.transform[5]


def test_where_files_overlap_the_finest_counts_then_the_first(tmp_path: Path) -> None:
    low = write_ground(tmp_path / "low.tif", lambda lat, lon: level(lat, lon) - 40.0, UTM, 100, 10.0)
    high = write_ground(tmp_path / "high.tif", level, UTM, 100, 10.0)
    fine = write_ground(tmp_path / "fine.tif", lambda lat, lon: level(lat, lon) + 10.0, UTM, 50, 8.0)
    for paths, expected in (([low, high], 600.0), ([high, low], 640.0), ([low, high, fine], 650.0)):
        terrain = open_terrain(paths, centre=CENTRE, radius_m=300.0, vertical="ellipsoid")
        assert terrain.height(*CENTRE) == pytest.approx(expected, abs=1e-3)
        assert len(terrain.layers) == 1  # 8 and 10 m are one layer


def test_of_files_about_as_fine_the_first_counts(tmp_path: Path) -> None:
    """One lattice, but the second reaches farther south, where posts lie 3e-5 farther apart: that is not coarser."""
    north = write_ground(tmp_path / "north.tif", level, "EPSG:4326", 60, 1e-4)
    corner = from_origin(LON - 0.003, LAT + 0.003, 1e-4, 1e-4)
    south = write_tif(tmp_path / "south.tif", np.full((90, 60), 600.0), "EPSG:4326", corner)
    for paths, expected in (([north, south], 640.0), ([south, north], 600.0)):
        terrain = open_terrain(paths, centre=CENTRE, radius_m=100.0, vertical="ellipsoid")
        assert terrain.height(*CENTRE) == pytest.approx(expected, abs=1e-3)


@pytest.fixture
def fine_over_coarse(tmp_path: Path) -> Terrain:
    """A surface model of 2 m with trees of 12 m and a hole, 480 m wide, in a terrain of 30 m."""

    def wooded(lat: Array, lon: Array) -> Array:
        trees = 12.0 * (np.sin(lat * 4e5) * np.sin(lon * 4e5) > 0.2)
        hole = np.hypot((lat - LAT) * 111e3, (lon - LON) * 74e3) < 30.0
        return np.where(hole, -9999.0, hills(lat, lon) + trees)

    fine = write_ground(tmp_path / "fine.tif", wooded, UTM, 240, 2.0, nodata=-9999.0)
    coarse = write_ground(tmp_path / "coarse.tif", hills, GAUSS_KRUEGER, 100, 30.0)
    return open_terrain([coarse, fine], centre=CENTRE, radius_m=1000.0, vertical="ellipsoid")


def test_a_fine_layer_lies_in_a_coarse_one_without_a_gap(fine_over_coarse: Terrain) -> None:
    fine, coarse = fine_over_coarse.layers
    assert coarse.cell_m / fine.cell_m == 15
    assert fine.cell_m == pytest.approx(2.0, rel=0.01)
    check_stack(fine_over_coarse.layers)
    alone = Terrain((coarse,), fine_over_coarse.frame)
    for east in (fine.east0, fine.east1):
        assert np.abs(fine_over_coarse.up(east, fine.north) - alone.up(east, fine.north)).max() < 1e-6
    assert not np.isnan(fine.heights).any()
    assert not np.isnan(coarse.heights).any()


def test_where_the_area_cuts_the_fine_file_it_ends_on_the_coarse_one(tmp_path: Path) -> None:
    fine = write_ground(tmp_path / "fine.tif", lambda lat, lon: hills(lat, lon) + 9.0, UTM, 200, 4.0)
    coarse = write_ground(tmp_path / "coarse.tif", hills, UTM, 100, 20.0)
    terrain = open_terrain([fine, coarse], centre=CENTRE, radius_m=200.0, vertical="ellipsoid")
    below = Terrain(terrain.layers[1:], terrain.frame)
    layer = terrain.finest
    above = layer.heights - below.up(layer.east[None, :], layer.north[:, None])
    assert np.abs(above[1:-1, 1:-1] - 9.0).max() < 0.5
    above[1:-1, 1:-1] = 0.0
    assert np.abs(above).max() < 1e-9
    assert (layer.origin is not None) and (np.unique(layer.origin[0]) == [1]).all()


def test_what_the_fine_file_does_not_know_comes_from_the_coarse_one(fine_over_coarse: Terrain) -> None:
    assert fine_over_coarse.source(0.0, 0.0) == 0  # the coarse file was named first
    assert fine_over_coarse.source(100.0, 100.0) == 1
    assert fine_over_coarse.source(0.0, 800.0) == 0
    assert fine_over_coarse.source(0.0, 5000.0) == NO_SOURCE
    coarse = Terrain(fine_over_coarse.layers[1:], fine_over_coarse.frame)
    assert fine_over_coarse.up(0.0, 10.0) == pytest.approx(float(coarse.up(0.0, 10.0)), abs=0.05)
    trees = fine_over_coarse.up(*np.meshgrid(np.arange(60.0, 200.0), 120.0)) - coarse.up(
        *np.meshgrid(np.arange(60.0, 200.0), 120.0)
    )
    assert trees.max() == pytest.approx(12.0, abs=2.0)


def test_beside_a_hole_of_the_coarse_file_nothing_more_is_lost(tmp_path: Path) -> None:
    """The fine layer's cells end where the coarse file's hole begins, not one before."""

    def half(lat: Array, lon: Array) -> Array:
        return np.where(lon > LON, np.nan, hills(lat, lon))

    def strip(lat: Array, lon: Array) -> Array:
        return np.where(np.abs(lat - LAT) < 0.001, np.nan, hills(lat, lon))

    fine = write_ground(tmp_path / "fine.tif", strip, UTM, 100, 4.0)
    coarse = write_ground(tmp_path / "coarse.tif", half, UTM, 60, 20.0)
    terrain = open_terrain([fine, coarse], centre=CENTRE, radius_m=400.0, vertical="ellipsoid")
    east, north = np.random.default_rng(6).uniform(-200.0, 200.0, (2, 20_000))
    known = np.isfinite(Terrain(terrain.layers[1:], terrain.frame).up(east, north))
    assert 0.4 < known.mean() < 0.6
    assert np.isfinite(terrain.up(east[known], north[known])).all()


def test_three_resolutions_lie_in_each_other(tmp_path: Path) -> None:
    paths = [
        write_ground(tmp_path / f"{step}.tif", hills, UTM, size, step)
        for step, size in ((100.0, 60), (25.0, 80), (4.0, 100))
    ]
    terrain = open_terrain(paths, centre=CENTRE, radius_m=2500.0, vertical="ellipsoid")
    cells = [layer.cell_m for layer in terrain.layers]
    assert [round(cells[1] / cells[0]), round(cells[2] / cells[1])] == [6, 4]
    assert [int(terrain.source(e, 0.0)) for e in (0.0, 500.0, 2000.0)] == [2, 1, 0]
    assert not np.isnan(terrain.up(*np.meshgrid(*[np.linspace(-2400, 2400, 300)] * 2))).any()


# ------------------------------------------------------------------------------------------------------------ holes


@pytest.mark.parametrize(("void", "nodata"), [(-9999.0, -9999.0), (np.nan, None), (-32768.0, None)])
def test_a_hole_is_a_hole(tmp_path: Path, void: float, nodata: float | None) -> None:
    def with_hole(lat: Array, lon: Array) -> Array:
        return np.where(np.hypot((lat - LAT) * 111e3, (lon - LON) * 74e3) < 55.0, void, 640.0)

    path = write_ground(tmp_path / "dem.tif", with_hole, UTM, 100, 10.0, nodata=nodata)
    terrain = open_terrain([path], centre=CENTRE, radius_m=300.0, vertical="ellipsoid")
    assert np.isnan(terrain.up(0.0, 0.0))
    assert terrain.source(0.0, 0.0) == NO_SOURCE
    assert np.isfinite(terrain.up([150.0, 0.0], [0.0, -200.0])).all()
    lost = np.isnan(terrain.finest.heights).mean() * 600.0**2
    assert 3.14 * 55.0**2 < lost < 3.14 * 75.0**2  # every cell that touches a missing post, and none beyond
    ranges, outcomes = terrain.trace([[0.0, 0.0, 2000.0], [200.0, 0.0, 2000.0]], [0.0, 0.0, -1.0], 5000.0)
    assert ranges == pytest.approx([np.nan, 1360.0], abs=0.1, nan_ok=True)
    assert outcomes.tolist() == [RayOutcome.HOLE, RayOutcome.HIT]


def test_a_height_that_no_ground_has_is_refused(tmp_path: Path) -> None:
    def forgotten(lat: Array, lon: Array) -> Array:
        return np.where(lat > LAT + 0.001, -9999.0, 640.0)

    path = write_ground(tmp_path / "dem.tif", forgotten, UTM, 100, 10.0)
    with pytest.raises(ConfigError, match=r"dem\.tif: a height of -9999 m; must be -500 to 9000 m"):
        open_terrain([path], vertical="ellipsoid")


# ------------------------------------------------------------------------------------------------------------- area


def test_without_an_area_all_that_the_files_cover(tmp_path: Path) -> None:
    path = write_ground(tmp_path / "dem.tif", hills, UTM, 100, 10.0)
    terrain = open_terrain([path], vertical="ellipsoid")
    assert terrain.frame.lat0 == pytest.approx(CENTRE[0], abs=1e-5)
    assert terrain.frame.lon0 == pytest.approx(CENTRE[1], abs=1e-5)
    assert terrain.finest.east1 - terrain.finest.east0 == pytest.approx(1000.0 * 1.03, abs=30.0)  # turned by 2 degrees
    assert np.isfinite(terrain.up([-450.0, 450.0], [450.0, -450.0])).all()


def test_too_many_posts_are_refused_with_cell_and_area(tmp_path: Path) -> None:
    path = write_ground(tmp_path / "dem.tif", hills, UTM, 500, 100.0)
    with pytest.raises(ConfigError, match=r"1 m apart over .* km; must be at most 67 million: use a larger cell_m"):
        open_terrain([path], cell_m=1.0, vertical="ellipsoid")


def test_a_cell_that_leaves_out_nearly_all_posts_is_refused(tmp_path: Path) -> None:
    """A block of posts would lie over more of the file than the machine holds."""
    path = write_ground(tmp_path / "dem.tif", hills, UTM, 500, 2.0)
    with pytest.raises(ConfigError, match=r"cell_m = 520: must be at most 512 m, 256 times the distance"):
        open_terrain([path], cell_m=520.0, vertical="ellipsoid")


def test_no_more_of_a_file_is_read_at_once_than_the_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A long and narrow area, a cell of many posts: cut up along the longer side."""
    corner = from_origin(709_300.0, 5_309_500.0, 2.0, 2.0)
    path, read = write_tif(tmp_path / "dem.tif", np.full((2400, 100), 640.0), UTM, corner), list[int]()
    inner = Mosaic.read

    def spy(self: Mosaic, rows: tuple[int, int], columns: tuple[int, int]) -> Any:
        read.append((rows[1] - rows[0]) * (columns[1] - columns[0]))
        return inner(self, rows, columns)

    monkeypatch.setattr(Mosaic, "read", spy)
    monkeypatch.setattr(resample, "_MAX_WINDOW", 40_000)
    terrain = open_terrain([path], cell_m=30.0, vertical="ellipsoid")
    assert min(terrain.finest.heights.shape) < 2 * resample._MIN_BLOCK
    assert max(read) <= 40_000
    assert np.isfinite(terrain.finest.heights).mean() > 0.4  # a strip that is turned by 2 degrees in its rectangle


def test_of_many_tiles_those_beside_the_area_are_left_out(tmp_path: Path) -> None:
    paths = [
        write_ground(tmp_path / f"{north:g}.tif", hills, UTM, 50, 10.0, at=(LAT + north, LON))
        for north in (0.5, 0.0, -0.5)
    ]
    terrain = open_terrain(paths, centre=CENTRE, radius_m=200.0, vertical="ellipsoid")
    assert terrain.source(0.0, 0.0) == 1
    assert [source.path for source in terrain.sources] == paths
    with pytest.raises(ConfigError, match=r"0\.5\.tif: does not touch .*, and none of the 2 other files touches it"):
        open_terrain(paths, centre=(0.0, 0.0), radius_m=200.0, vertical="ellipsoid")


def test_a_file_beside_the_area_is_refused(tmp_path: Path) -> None:
    path = write_ground(tmp_path / "dem.tif", hills, UTM, 50, 10.0)
    for lat, lon in ((LAT + 0.1, LON), (-LAT, LON - 180.0)):
        centre = math.radians(lat), math.radians(lon)
        with pytest.raises(ConfigError, match=r"dem\.tif: does not touch the area within 2 km .* covers 47\.89"):
            open_terrain([path], centre=centre, radius_m=2000.0, vertical="ellipsoid")


def test_nothing_but_holes_is_refused(tmp_path: Path) -> None:
    path = write_ground(tmp_path / "dem.tif", lambda lat, lon: np.full_like(lat, np.nan), UTM, 50, 10.0)
    with pytest.raises(ConfigError, match=r"dem\.tif: no heights in the area"):
        open_terrain([path], vertical="ellipsoid")


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"paths": []}, "at least one file"),
        ({"centre": CENTRE}, "must be given together"),
        ({"radius_m": 100.0}, "must be given together"),
        ({"centre": (47.9, 11.8), "radius_m": 100.0}, "in radians"),
        ({"centre": CENTRE, "radius_m": 0.0}, "radius_m = 0.0: must be positive"),
        ({"cell_m": math.inf}, "cell_m = inf: must be positive"),
    ],
)
def test_arguments_that_make_no_sense(wrong: dict[str, object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        open_terrain(**{"paths": ["dem.tif"], **wrong})  # type: ignore[arg-type]


def test_more_files_than_can_be_numbered() -> None:
    with pytest.raises(ConfigError, match="256 files; must be at most 255: join tiles"):
        open_terrain(["dem.tif"] * 256)


# ----------------------------------------------------------------------------------------------------------- blocks


def test_cutting_blocks_up_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Small windows and small blocks, as a large file needs them, give the same surface."""
    path = write_ground(tmp_path / "dem.tif", hills, UTM, 200, 10.0)
    arguments: dict[str, Any] = {"centre": CENTRE, "radius_m": 800.0, "vertical": "ellipsoid"}
    shares: list[float] = []
    whole = open_terrain([path], **arguments, progress=shares.append)
    assert shares[-1] == 1.0
    monkeypatch.setattr(resample, "_MAX_WINDOW", 2000)
    monkeypatch.setattr(resample, "_BLOCK", 100)
    more: list[float] = []
    parts = open_terrain([path], **arguments, progress=more.append)
    assert np.abs(parts.finest.heights - whole.finest.heights).max() < 1e-6
    assert len(more) > len(shares)
    assert more == sorted(more)
    assert more[-1] == 1.0
