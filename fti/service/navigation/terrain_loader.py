"""Loads the terrain and compiles its kernels in a separate thread, while navigation works without terrain.

Neither recording nor navigation waits for it.  ``/fti/terrain`` records from which frame on the terrain was used, so
that reprocessing uses it from the same frame on.
"""

from __future__ import annotations

import functools
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from fti.config import Config, TerrainFiles
from fti.nav.terrain_reference import Ground
from fti.service.fault_guard import catch_failures
from fti.service.navigation.kernel_compiler import ensure_kernels_compiled
from fti.terrain.area import TerrainArea

if TYPE_CHECKING:
    from fti.terrain.terrain import Terrain

Progress = Callable[[float], None]


def load_terrain(
    settings: TerrainFiles,
    progress: Progress | None = None,
    *,
    local_only: bool = False,
    area: TerrainArea | None = None,
) -> Ground:
    """The terrain of a configuration.  progress : called with the loaded share, 0 to 1

    local_only : see ``open_terrain``; for the configuration of a recording
    area : the square to load; None: all that is configured

    Raises ConfigError or MissingError as ``open_terrain`` does.
    """
    if settings.scene:
        return Ground(_scene(settings.scene), settings.sd_m, f"scene {settings.scene}")
    from fti.terrain.files.catalogue import list_files  # noqa: PLC0415 - numba, GDAL: only loaded if needed
    from fti.terrain.files.open_terrain import open_terrain  # noqa: PLC0415 - see above
    from fti.terrain.files.stated_properties import check_paths, stated_datums, with_stated  # noqa: PLC0415 - see above

    files, centre, radius_m = settings.files, None, settings.radius_m
    if area:
        files, centre, radius_m = area.files, (area.lat, area.lon), area.radius_m
    elif settings.centre_deg:
        centre = (math.radians(settings.centre_deg[0]), math.radians(settings.centre_deg[1]))
    files = list_files(files)
    if area is None:
        check_paths(settings, files)
    terrain = open_terrain(
        files,
        centre=centre,
        radius_m=radius_m,
        cell_m=settings.cell_m,
        vertical=stated_datums(settings, files),
        progress=progress,
        local_only=local_only,
    )
    terrain = replace(terrain, sources=tuple(with_stated(settings, source) for source in terrain.sources))
    name = _area_name(area) if area else ", ".join(files)
    ground = Ground(terrain, settings.sd_m, name, files, area.radius_m if area else None)
    return _with_land_cover(ground, settings, local_only) if settings.land_cover else ground


def _with_land_cover(ground: Ground, settings: TerrainFiles, local_only: bool) -> Ground:
    from fti.nav.land_cover import sensed_grounds  # noqa: PLC0415
    from fti.terrain.files.land_cover import read_land_cover  # noqa: PLC0415 - see above

    assert settings.land_cover is not None
    classes = read_land_cover(settings.land_cover, ground.terrain, local_only=local_only)
    return replace(ground, sensed=sensed_grounds(ground, classes, settings.cover))


def _area_name(area: TerrainArea) -> str:
    place = f"{math.degrees(area.lat):.4f}, {math.degrees(area.lon):.4f}"
    return f"{area.radius_m / 1000:.1f} km around {place}, files: {len(area.files)}"


@functools.cache
def _scene(name: str) -> Terrain:
    from fti.terrain.demo_coast import demo_coast  # noqa: PLC0415
    from fti.terrain.demo_region import demo_region  # noqa: PLC0415
    from fti.terrain.demo_scene import demo_scene  # noqa: PLC0415 - see above

    return {"demo": demo_scene, "demo_country": demo_region, "demo_coast": demo_coast}[name]()


@dataclass(frozen=True, slots=True)
class LoadedTerrain:
    """The loaded terrain, or the fault that prevented loading."""

    ground: Ground | None
    fault: str | None = None


class TerrainLoader:
    """Loads the terrain of a configuration; ``take`` returns it once.  without : reason for not loading it"""

    def __init__(self, config: Config, without: str | None = None) -> None:
        self._config, self._without = config, without
        self._share = 0.0
        self._result: LoadedTerrain | None = None
        self._taken: LoadedTerrain | None = None
        # a daemon thread: a flight that ends before loading has ended does not wait for it
        self._thread = threading.Thread(target=self._run, name="ground", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def take(self) -> LoadedTerrain | None:
        """The result, once, after loading has ended; otherwise None."""
        if self._taken is not None or self._result is None:
            return None
        self._taken = self._result
        return self._taken

    @property
    def is_done(self) -> bool:
        """Loading has ended and the result was taken."""
        return self._taken is not None

    @property
    def state(self) -> str:
        """The state as a text for people."""
        if self._taken is None:
            return f"loading, {100 * self._share:.0f} %"
        if self._taken.fault:
            return f"not available: {self._taken.fault}"
        assert self._taken.ground
        return self._taken.ground.name

    def _run(self) -> None:
        with catch_failures("terrain", self._fail):
            if self._without:
                self._result = LoadedTerrain(None, self._without)
            elif settings := self._config.nav.terrain:
                self._result = LoadedTerrain(self._load(settings))

    def _load(self, settings: TerrainFiles) -> Ground:
        """Do all slow steps here; the checksum of many posts would delay navigation by seconds."""
        from fti.nav.kernel_warmup import warm_up  # noqa: PLC0415 - see above

        ensure_kernels_compiled(self._config)
        ground = load_terrain(settings, self._on_progress)
        warm_up(self._config, ground)
        assert ground.digest and ground.checksums
        return ground

    def _on_progress(self, share: float) -> None:
        self._share = share

    def _fail(self, unit: str, error: Exception) -> None:
        del unit
        self._result = LoadedTerrain(None, f"{type(error).__name__}: {error}")
