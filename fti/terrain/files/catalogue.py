"""Elevation files that are larger than the memory: their headers, and the square of them around a place."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fti.errors import ConfigError
from fti.geodesy.formulas import wrap_half_turn
from fti.terrain.area import TerrainArea
from fti.terrain.file_info import ElevationFileInfo
from fti.terrain.files.elevation_file import ElevationFile
from fti.terrain.files.layout import make_plans, place_area
from fti.terrain.files.local_only import local_environment
from fti.terrain.files.open_terrain import check_arguments
from fti.terrain.files.vertical import datum_names_by_file, datums_of

#: Endings of elevation files in a folder.
SUFFIXES = frozenset({".tif", ".tiff", ".hgt", ".dt0", ".dt1", ".dt2", ".asc", ".img"})
#: Memory of a post with its share of the trees of the ray caster and of its source [B], measured.
BYTES_PER_POST = 24
#: Memory for a post of one square and its share in the square before [MiB].
POST_MB = 2.0 * BYTES_PER_POST / 2**20
#: Half sides of squares [m], the largest first.
RADII_M = tuple(50_000.0 * 2.0 ** (-0.5 * k) for k in range(12))
#: Files with less than this times the spacing of the finest one are in its layer.
SAME_LAYER = 1.9
#: A share of an estimate from headers that the true number exceeds.
SURELY = 0.8
#: The surroundings of a square contain its corners.
MARGIN = 1.5
#: A radius that is smaller than those of the Earth [m]: angles are not too small.
EARTH_RADIUS_M = 6.33e6


def list_files(paths: Sequence[str]) -> tuple[str, ...]:
    """The paths; a folder is replaced by its elevation files, by name.  Raises ConfigError for one without."""
    found: list[str] = []
    for path in paths:
        if not Path(path).is_dir():
            found.append(path)
            continue
        inside = sorted(entry for entry in Path(path).iterdir() if entry.suffix.lower() in SUFFIXES)
        if not inside:
            raise ConfigError(f"{path}: contains no elevation files ({', '.join(sorted(SUFFIXES))})")
        found += map(os.fspath, inside)
    return tuple(dict.fromkeys(found))


@dataclass(frozen=True)
class TerrainCatalogue:
    """Headers of elevation files.  vertical, local_only : as in ``open_terrain``"""

    files: tuple[ElevationFileInfo, ...]
    vertical: str | Mapping[str, str] | None
    local_only: bool = False

    @property
    def finest(self) -> ElevationFileInfo:
        """The file with the smallest distance between posts."""
        return min(self.files, key=lambda file: min(file.spacing_m))

    def files_near(self, lat: float, lon: float, radius_m: float) -> tuple[str, ...]:
        """Paths of the files whose box touches the surroundings of a square."""
        return tuple(file.path for file in self.files if _is_near(file, lat, lon, MARGIN * radius_m / EARTH_RADIUS_M))

    def area_around(self, lat: float, lon: float, memory_mb: float, cell_m: float | None = None) -> TerrainArea:
        """The largest square whose posts need not more than half of the memory.

        Raises ConfigError if no file is there, or if the smallest square needs more.
        """
        problem: ConfigError | None = None
        for radius_m in RADII_M:
            around = f"{radius_m / 1000:.1f} km around {math.degrees(lat):.4f}, {math.degrees(lon):.4f}"
            paths = self.files_near(lat, lon, radius_m)
            if not paths:
                problem = problem or ConfigError(f"no elevation file within {around}")
                break
            if POST_MB * self._estimate_posts(paths, lat, lon, radius_m, cell_m) > memory_mb and radius_m > RADII_M[-1]:
                continue
            try:
                needed_mb = POST_MB * self._posts(paths, (lat, lon), radius_m, cell_m)
            except ConfigError as error:  # too many files or posts, or no file touches the square itself
                problem = error
                continue
            if needed_mb <= memory_mb:
                return TerrainArea(lat, lon, radius_m, paths)
            problem = ConfigError(f"memory_mb = {memory_mb:g}: {around} need {needed_mb:.0f} MiB")
        raise problem or ConfigError("no elevation files")

    def _estimate_posts(
        self, paths: Collection[str], lat: float, lon: float, radius_m: float, cell_m: float | None
    ) -> float:
        """Posts of the finest layer of a square, the rectangle around the coverage of its files: roughly and not more.

        From the headers: no file is opened.
        """
        names = set(paths)
        near = [file for file in self.files if file.path in names]
        finest = min(min(file.spacing_m) for file in near)
        boxes = [_box_in(file, lat, lon, radius_m) for file in near if min(file.spacing_m) < SAME_LAYER * finest]
        inside = np.array([box for box in boxes if box[0] < box[1] and box[2] < box[3]]).reshape(-1, 4)
        if not len(inside):
            return 0.0
        high, wide = np.ptp(inside[:, :2]), np.ptp(inside[:, 2:])
        return float(SURELY * high * wide / (cell_m or finest) ** 2)

    def _posts(self, paths: Sequence[str], centre: tuple[float, float], radius_m: float, cell_m: float | None) -> int:
        """Posts of all layers of a square.  Raises ConfigError as ``make_plans``."""
        check_arguments(paths, centre, radius_m, cell_m)
        words = datum_names_by_file(self._vertical_of(paths), paths)
        with contextlib.ExitStack() as stack:
            if self.local_only:
                stack.enter_context(local_environment())
            opened = (ElevationFile(path, words, local_only=self.local_only) for path in paths)
            files = [stack.enter_context(contextlib.closing(file)) for file in opened]
            plans = make_plans(files, *place_area(files, centre, radius_m), cell_m)
        return sum(math.prod(plan.shape) for plan in plans)

    def _vertical_of(self, paths: Sequence[str]) -> str | Mapping[str, str] | None:
        """The datums without those of other files."""
        if self.vertical is None or isinstance(self.vertical, str):
            return self.vertical
        return datums_of(self.vertical, paths)


def read_catalogue(
    paths: Sequence[str], vertical: str | Mapping[str, str] | None, *, local_only: bool = False
) -> TerrainCatalogue:
    """The headers of files, and of those in folders.  Raises as ``open_terrain``."""
    names = list_files(paths)
    words = datum_names_by_file(vertical, names)
    headers = []
    with local_environment() if local_only else contextlib.nullcontext():
        for name in names:
            with contextlib.closing(ElevationFile(name, words, local_only=local_only)) as file:
                headers.append(file.source)
    return TerrainCatalogue(tuple(headers), vertical, local_only)


def _is_near(file: ElevationFileInfo, lat: float, lon: float, angle: float) -> bool:
    """Whether a file reaches within an angle of a place [rad]."""
    if not file.south - angle <= lat <= file.north + angle:
        return False
    farthest = abs(lat) + angle
    if farthest >= math.pi / 2:
        return True
    wide, width = angle / math.cos(farthest), file.east - file.west
    width += math.tau if width < 0.0 else 0.0
    return (lon - file.west + wide) % math.tau <= width + 2.0 * wide


def _box_in(file: ElevationFileInfo, lat: float, lon: float, radius_m: float) -> tuple[float, float, float, float]:
    """South, north, west and east of the part of a file in a square, from its middle [m]; roughly."""
    per_lon, width = EARTH_RADIUS_M * math.cos(lat), file.east - file.west
    west = wrap_half_turn(file.west - lon)
    east = west + width + (math.tau if width < 0.0 else 0.0)
    south, north = (EARTH_RADIUS_M * (side - lat) for side in (file.south, file.north))
    return max(south, -radius_m), min(north, radius_m), max(west * per_lon, -radius_m), min(east * per_lon, radius_m)
