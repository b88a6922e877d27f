"""The shift between two LAS or LAZ files; the files are written by laspy from real points with a known shift."""

from __future__ import annotations

import json
from pathlib import Path

import laspy
import numpy as np
import pyproj
import pytest

from fti.arrays import Array
from fti.cli.main import main
from fti.errors import ConfigError, MissingError
from fti.post.laser_strips import MAX_POINTS, compare_strips, read_strip
from fti.study.scan_registration.strip import load_strip

ORIGIN = np.array([492_000.0, 4_878_000.0, 130.0])  # UTM zone 10, near the place of the strip
SHIFT = np.array([0.45, -0.30, 0.20])
US_FOOT_M = 1200.0 / 3937.0


def write(path: Path, points: Array, t: Array, unit_m: float = 1.0, crs: str | None = "EPSG:32610") -> Path:
    """A file of points in metres."""
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = points.mean(axis=0) / unit_m, np.full(3, 0.001)
    if crs:
        header.add_crs(pyproj.CRS.from_user_input(crs))
    file = laspy.LasData(header)
    file.x, file.y, file.z = points.T / unit_m
    file.gps_time = t
    file.return_number = np.ones(len(points), dtype=np.uint8)
    file.number_of_returns = np.ones(len(points), dtype=np.uint8)
    file.write(path)
    return path


def halves(seed: int = 3) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """The strip in random halves, the second one shifted."""
    points, t = load_strip()
    order = np.random.default_rng(seed).permutation(len(t))
    first, second = np.sort(order[: len(t) // 2]), np.sort(order[len(t) // 2 :])
    return (points[first] + ORIGIN, t[first]), (points[second] + ORIGIN + SHIFT, t[second])


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    first, second = halves()
    return write(tmp_path / "first.las", *first), write(tmp_path / "second.laz", *second)


def test_an_injected_shift_is_found_inside_its_sigma(files: tuple[Path, Path]) -> None:
    first, second = map(read_strip, files)
    result = compare_strips(first, second, 0.03, 1.0)
    shift, sigma = result.enu()
    assert (np.abs(shift - SHIFT) < 3.0 * sigma).all()
    assert (sigma < 0.2).all() and sigma[2] < 0.02
    assert result.found.overlap > 0.5


def test_the_unit_of_the_file_counts(files: tuple[Path, Path], tmp_path: Path) -> None:
    """The same points in feet, with a coordinate system in feet, and without one but with --unit."""
    _, second = halves()
    in_feet = write(tmp_path / "feet.las", *second, unit_m=US_FOOT_M, crs="EPSG:2992")  # Oregon, international feet
    assert read_strip(in_feet).unit_m == pytest.approx(0.3048)
    without = write(tmp_path / "without.las", *second, unit_m=US_FOOT_M, crs=None)
    result = compare_strips(read_strip(files[0]), read_strip(without, US_FOOT_M), 0.03, 1.0)
    shift, sigma = result.enu()
    assert (np.abs(shift - SHIFT) < 3.0 * sigma).all()
    assert read_strip(without).unit_m == 1.0 and read_strip(without).crs == ""


def test_noise_withheld_points_and_first_returns_are_left_out(tmp_path: Path) -> None:
    points, t = halves()[0]
    path = write(tmp_path / "a.las", points, t)
    file = laspy.read(path)
    file.classification[:10] = 7
    file.withheld[10:30] = 1
    file.number_of_returns[30:60] = 2
    file.write(path)
    strip = read_strip(path)
    assert len(strip.points) == len(points) - 60
    assert strip.points[0] == pytest.approx(points[60], abs=0.002)


def test_many_points_are_thinned(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    places = rng.uniform(0.0, 400.0, (3 * MAX_POINTS, 2))
    places = places[np.argsort(places[:, 0])]  # a pass from west to east
    heights = 10.0 * np.sin(places[:, 0] / 20.0) * np.cos(places[:, 1] / 31.0)
    points = np.column_stack([places, heights])
    first = write(tmp_path / "a.las", points[::2] + ORIGIN, np.arange(len(points[::2])) / 1e4)
    second = write(tmp_path / "b.las", points[1::2] + ORIGIN + SHIFT, np.arange(len(points[1::2])) / 1e4)
    result = compare_strips(read_strip(first), read_strip(second), 0.03, 1.0)
    assert max(result.counts) <= 1.2 * MAX_POINTS
    shift, sigma = result.enu()
    assert (np.abs(shift - SHIFT) < 4.0 * sigma + 0.01).all()


def test_flat_ground_gives_a_height_only(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(2)
    names = []
    for name, offset in (("a", 0.0), ("b", 0.25)):
        points = np.column_stack([rng.uniform(0.0, 200.0, (8000, 2)), offset + rng.normal(0.0, 0.03, 8000)])
        names.append(str(write(tmp_path / f"{name}.las", points + ORIGIN, np.arange(8000) / 1e4)))
    assert main(["terrain", "strips", *names]) == 0
    printed = capsys.readouterr().out
    assert "refused     flat" in printed
    assert "east" not in printed and "north" not in printed
    (up,) = [line for line in printed.splitlines() if line.startswith("up ")]
    assert float(up.split()[1]) == pytest.approx(0.25, abs=0.01)


def test_the_command_prints_text_and_json(files: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["terrain", "strips", *map(str, files)]) == 0
    printed = capsys.readouterr().out
    assert "first.las: 4000 last returns, 4000 compared; WGS 84 / UTM zone 10N, unit 1 m" in printed
    east = next(line for line in printed.splitlines() if line.startswith("east"))
    assert float(east.split()[1]) == pytest.approx(SHIFT[0], abs=0.3)
    assert main(["terrain", "strips", *map(str, files), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["axes"]) == len(found["shift_m"]) == 3
    assert found["refusals"] == []


# ------------------------------------------------------------------------------------------------------- bad input


def test_strips_without_common_ground_are_an_error(files: tuple[Path, Path], tmp_path: Path) -> None:
    points, t = halves()[0]
    elsewhere = write(tmp_path / "c.las", points + np.array([5000.0, 0.0, 0.0]), t)
    with pytest.raises(ConfigError, match=r"first\.las, .*c\.las: have no ground in common"):
        compare_strips(read_strip(files[0]), read_strip(elsewhere), 0.03, 1.0)


def test_angles_as_coordinates_are_an_error(tmp_path: Path) -> None:
    points, t = halves()[0]
    path = write(tmp_path / "d.las", points * [1e-5, 1e-6, 1.0], t, crs="EPSG:4326")
    with pytest.raises(ConfigError, match="has angles as coordinates"):
        read_strip(path)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.9])
def test_a_file_that_was_cut_off_is_an_error(files: tuple[Path, Path], share: float) -> None:
    for path in files:
        data = path.read_bytes()
        path.write_bytes(data[: int(share * len(data))])
        with pytest.raises(MissingError, match=path.name):
            read_strip(path)


def test_damaged_bytes_never_raise_another_error(files: tuple[Path, Path], scale: int) -> None:
    rng = np.random.default_rng(5)
    for path in files:
        data = path.read_bytes()
        for _ in range(100 * scale):
            damaged = bytearray(data)
            damaged[int(rng.integers(0, min(len(data), 2000)))] ^= 1 << int(rng.integers(0, 8))
            path.write_bytes(damaged)
            try:
                read_strip(path)
            except (MissingError, ConfigError) as error:
                assert path.name in str(error)
        path.write_bytes(data)


def test_a_missing_file_and_no_laspy_are_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(MissingError, match=r"no\.las: cannot be read: No such file"):
        read_strip(tmp_path / "no.las")
    monkeypatch.setitem(__import__("sys").modules, "laspy", None)
    with pytest.raises(MissingError, match=r"pip install \"fti\[las\]\""):
        read_strip(tmp_path / "no.las")
