"""Undulation: against published values, against an independent reading of the grid, and what happens without it."""

import os
import struct
from pathlib import Path

import numpy as np
import pyproj
import pytest
from pyproj.network import is_network_enabled  # type: ignore[attr-defined]  # public in its documents

from fti.errors import MissingError
from fti.geodesy import geoid
from fti.geodesy.geoid import Geoid, find_grid, grid_directories, load_geoid
from tests.grids import needs_egm96

#: Test points of NGA's interpolation program for EGM96 (INPUT.DAT, OUTINTPT.DAT): latitude, longitude [deg], [m].
NGA = [
    (38.6281550, 269.7791550, -31.628),
    (-14.6212170, 305.0211140, -2.969),
    (46.8743190, 102.4487290, -43.575),
    (-23.6174460, 133.8747120, 15.871),
    (38.6254730, 359.9995000, 50.066),
    (-0.4667440, 0.0023000, 17.329),
]


@needs_egm96
def test_agrees_with_published_undulations() -> None:
    """Within 6 cm: NGA goes between the posts by splines, PROJ in straight lines."""
    lat, lon, expected = np.array(NGA).T
    assert np.abs(load_geoid("egm96").undulation(np.radians(lat), np.radians(lon)) - expected).max() < 0.06


def bilinear_gtx(path: Path, lat: np.ndarray, lon: np.ndarray) -> np.ndarray:
    """The grid read by hand: header of four doubles and two integers, rows from the south, all big-endian."""
    data = path.read_bytes()
    south, west, dlat, dlon, rows, columns = struct.unpack(">4d2i", data[:40])
    posts = np.frombuffer(data, ">f4", offset=40).reshape(rows, columns).astype(np.float64)
    row, column = (np.degrees(lat) - south) / dlat, ((np.degrees(lon) - west) % 360.0) / dlon
    i, j = np.minimum(row, rows - 2).astype(int), column.astype(int)
    v, u = row - i, column - j
    east = (j + 1) % columns
    low = posts[i, j % columns] * (1 - u) + posts[i, east] * u
    high = posts[i + 1, j % columns] * (1 - u) + posts[i + 1, east] * u
    return np.asarray(low * (1 - v) + high * v)


@needs_egm96
def test_agrees_with_an_independent_reading_of_the_grid() -> None:
    rng = np.random.default_rng(5)
    lat, lon = np.radians(rng.uniform(-90, 90, 5000)), np.radians(rng.uniform(-180, 180, 5000))
    expected = bilinear_gtx(find_grid("egm96", grid_directories()), lat, lon)
    assert np.abs(load_geoid("egm96").undulation(lat, lon) - expected).max() < 1e-5  # posts in single precision


@needs_egm96
def test_shapes_and_places_that_are_none() -> None:
    values = load_geoid("egm96").undulation(np.radians([[48.0], [np.nan], [91.0]]), np.radians([11.0, 371.0]))
    assert values.shape == (3, 2)
    assert values[0, 0] == pytest.approx(values[0, 1], abs=1e-9)
    assert 40 < values[0, 0] < 50
    assert np.isnan(values[1:]).all()


def test_a_missing_grid_is_refused_where_proj_would_shift_by_nothing(tmp_path: Path) -> None:
    with pytest.raises(MissingError, match=r"egm96_15\.gtx") as refused:
        find_grid("egm96", [tmp_path, tmp_path / "other"])
    assert str(tmp_path / "other") in str(refused.value)
    assert "proj-data" in str(refused.value)
    with pytest.raises(MissingError, match="no directory"):
        find_grid("egm2008", [])
    with pytest.raises(MissingError, match="cannot read this geoid grid"):
        Geoid("egm96", tmp_path / "egm96_15.gtx")


def test_proj_itself_shifts_by_nothing_where_the_grid_is_missing(tmp_path: Path) -> None:
    """Why the grid is looked for here: no error, and mean sea level is taken for the ellipsoid."""
    assert not is_network_enabled()
    before = pyproj.datadir.get_data_dir()
    (tmp_path / "proj.db").symlink_to(Path(before.split(os.pathsep)[0]) / "proj.db")
    pyproj.datadir.set_data_dir(tmp_path)
    try:
        silent = pyproj.Transformer.from_crs("EPSG:4326+5773", "EPSG:4979", always_xy=True)
        assert silent.transform(11.0, 48.0, 500.0)[2] == 500.0
    finally:
        pyproj.datadir.set_data_dir(before)


def test_the_refusal_comes_from_the_search_of_this_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(geoid, "grid_directories", lambda: (tmp_path,))
    with pytest.raises(MissingError, match=str(tmp_path)):
        load_geoid.__wrapped__("egm96")


def test_a_directory_of_the_environment_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PROJ_DATA", str(tmp_path))
    (tmp_path / "egm96_15.gtx").write_bytes(b"no grid")
    assert find_grid("egm96", grid_directories()) == tmp_path / "egm96_15.gtx"
    with pytest.raises(MissingError, match="cannot read"):
        Geoid("egm96", tmp_path / "egm96_15.gtx")


def test_a_model_that_nobody_knows() -> None:
    with pytest.raises(ValueError, match="unknown geoid 'egm84'; must be one of egm96, egm2008"):
        load_geoid("egm84")
