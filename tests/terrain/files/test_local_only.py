"""What a recording may name as an elevation file: single local files of five formats; no address is connected to."""

from __future__ import annotations

import os
import socket
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.shutil import copy

from fti.errors import ConfigError, FtiError
from fti.terrain.files.local_only import local_environment, open_local
from fti.terrain.files.open_terrain import open_terrain
from fti.terrain.terrain import Terrain
from tests.terrain.elevation_files import LAT, LON, Array, from_origin, write_ground, write_hgt, write_tif

CENTRE = (np.radians(LAT), np.radians(LON))


def _slope(lat: Array, lon: Array) -> Array:
    return 600.0 + 1000.0 * (lat - LAT) + 500.0 * (lon - LON)


Server = tuple[str, Callable[[], bool]]


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    """An address of this machine, and whether somebody has connected to it.

    The kernel takes the connection; nobody answers, for GDAL may hold the interpreter's lock while it waits.
    """
    for option in ("GDAL_HTTP_TIMEOUT", "GDAL_HTTP_CONNECTTIMEOUT"):
        monkeypatch.setenv(option, "1")
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        listening.setblocking(False)

        def connected() -> bool:
            try:
                listening.accept()[0].close()
            except BlockingIOError:
                return False
            return True

        yield f"http://127.0.0.1:{listening.getsockname()[1]}", connected


def _tif(folder: Path, name: str = "a.tif") -> str:
    return write_ground(folder / name, _slope, "EPSG:4326", 40, 1e-4)


def _open(path: str, *, local_only: bool) -> Terrain:
    return open_terrain([path], centre=CENTRE, radius_m=100.0, vertical={path: "ellipsoid"}, local_only=local_only)


def test_the_promised_formats_are_opened_as_by_a_user(tmp_path: Path) -> None:
    tif = _tif(tmp_path)
    copy(tif, tmp_path / "a.asc", driver="AAIGrid")
    copy(tif, tmp_path / "a.img", driver="HFA")
    seconds = from_origin(11 - 1.5 / 3600, 48 + 1.5 / 3600, 3 / 3600, 3 / 3600)
    whole = write_tif(tmp_path / "whole.tif", np.full((1201, 1201), 600, dtype=np.int16), "EPSG:4326", seconds)
    copy(whole, tmp_path / "n47.dt1", driver="DTED")
    with zipfile.ZipFile(tmp_path / "tiles.zip", "w") as archive:
        archive.write(tif, "sub/a.tif")
    for path in (
        tif,
        str(tmp_path / "a.asc"),
        str(tmp_path / "a.img"),
        str(tmp_path / "n47.dt1"),
        write_hgt(tmp_path, _slope),
        f"/vsizip/{tmp_path}/tiles.zip/sub/a.tif",
        f"/vsizip/{{{tmp_path}/tiles.zip}}/sub/a.tif",
    ):
        limited, own = (_open(path, local_only=only) for only in (True, False))
        assert np.array_equal(limited.finest.heights, own.finest.heights), path


@pytest.mark.parametrize(
    "named",
    [
        "/vsicurl/{url}/a.tif",
        "/vsicurl_streaming/{url}/a.tif",
        "/vsizip//vsicurl/{url}/a.zip/a.tif",
        "{url}/a.tif",
        "GTIFF_DIR:1:{folder}/a.tif",
        "/vsisubfile/0_10,{folder}/a.tif",
        "a.tif",
        "{folder}",
        "{folder}/fifo",
        "{folder}/a.vrt",
        "{folder}/a_vrt.tif",
    ],
)
def test_everything_else_is_refused_and_named(tmp_path: Path, server: Server, named: str) -> None:
    url, connected = server
    os.mkfifo(tmp_path / "fifo")
    copy(_tif(tmp_path), tmp_path / "a.vrt", driver="VRT")
    (tmp_path / "a_vrt.tif").write_bytes((tmp_path / "a.vrt").read_bytes())
    path = named.format(url=url, folder=tmp_path)
    with pytest.raises(ConfigError) as refused:
        _open(path, local_only=True)
    assert str(refused.value).startswith(f"{path}: the recording names")
    assert "GTiff, SRTMHGT, DTED, AAIGrid, HFA" in str(refused.value)
    assert not connected()


def test_no_address_in_a_file_or_beside_it_is_followed(tmp_path: Path, server: Server) -> None:
    url, connected = server
    path = _tif(tmp_path)
    Path(f"{path}.aux.xml").write_text(
        '<PAMDataset><Metadata domain="OVERVIEWS">'
        f'<MDI key="OVERVIEW_FILE">/vsicurl/{url}/overview.tif</MDI></Metadata></PAMDataset>'
    )
    _open(path, local_only=True)
    with local_environment(), open_local(path) as dataset:
        assert dataset.overviews(1) == []
    assert not connected()
    with rasterio.open(path) as dataset:
        assert dataset.overviews(1) == []
    assert connected(), "without the limits GDAL loads it"


def test_a_file_that_is_not_there_is_named_as_the_recordings(tmp_path: Path) -> None:
    with pytest.raises(FtiError, match="file not found; the recording names it"):
        _open(str(tmp_path / "lost.tif"), local_only=True)
