"""Elevation larger than memory: squares around the aircraft, loaded one after the other.

``TerrainAreas`` chooses and loads them; offline, the next one is there at once.  ``TerrainAreaLoader`` does it in a
thread of the flight (docs/decisions/0051-elevation-larger-than-memory.md).
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from fti.config import Config, TerrainFiles
from fti.errors import ConfigError, MissingError
from fti.messages.outputs import NavSolution
from fti.service.fault_guard import catch_failures
from fti.service.navigation.kernel_compiler import ensure_kernels_compiled
from fti.service.navigation.terrain_loader import LoadedTerrain, load_terrain
from fti.terrain.area import TerrainArea

if TYPE_CHECKING:
    from fti.service.navigation.decode_chain import ChainOutput
    from fti.terrain.files.catalogue import TerrainCatalogue

#: After a square that cannot be loaded the next try is so far away: half a side [m].
RETRY_RADIUS_M = 5000.0


class TerrainAreas:
    """Chooses and loads the squares of a flight.

    settings : ``[nav.terrain]`` with ``memory_mb``;  local_only : see ``open_terrain``
    """

    def __init__(self, settings: TerrainFiles, *, local_only: bool = False) -> None:
        self._settings, self._local_only = settings, local_only
        self._catalogue: TerrainCatalogue | None = None
        self._area: TerrainArea | None = None

    def is_wanted(self, nav: NavSolution) -> bool:
        """Whether the position has left the middle of the square."""
        if nav.lat is None or nav.lon is None:
            return False
        return self._area is None or self._area.is_left_by(nav.lat, nav.lon)

    def load(self, nav: NavSolution) -> LoadedTerrain:
        """The square for a position; the fault where there is none."""
        assert nav.lat is not None and nav.lon is not None
        place = nav.lat, nav.lon
        if self._area is not None:
            place = self._area.next_middle(nav.lat, nav.lon, nav.vel_north or 0.0, nav.vel_east or 0.0)
        try:
            self._area = self._choose(*place)
            return LoadedTerrain(load_terrain(self._settings, local_only=self._local_only, area=self._area))
        except (ConfigError, MissingError) as error:
            self._area = TerrainArea(nav.lat, nav.lon, RETRY_RADIUS_M, ())
            return LoadedTerrain(None, str(error))

    def _choose(self, lat: float, lon: float) -> TerrainArea:
        from fti.terrain.files.catalogue import list_files, read_catalogue  # noqa: PLC0415 - GDAL: only if needed
        from fti.terrain.files.stated_properties import check_paths, stated_datums  # noqa: PLC0415 - see above

        settings = self._settings
        assert settings.square_mb is not None
        if self._catalogue is None:
            files = list_files(settings.files)
            check_paths(settings, files)
            self._catalogue = read_catalogue(files, stated_datums(settings, files), local_only=self._local_only)
        return self._catalogue.area_around(lat, lon, settings.square_mb, settings.cell_m)


def wanted_areas(areas: TerrainAreas | None, products: Iterable[ChainOutput]) -> Iterator[NavSolution]:
    """The solutions among outputs at which the next square is needed, one at a time."""
    if areas is not None:
        solutions = (output for each in products for output in each.outputs if isinstance(output, NavSolution))
        yield from filter(areas.is_wanted, solutions)


class TerrainAreaLoader:
    """Loads each square of a flight in a thread; ``take`` returns it once.  without : reason for not loading any"""

    def __init__(self, config: Config, settings: TerrainFiles, without: str | None = None) -> None:
        self._config, self._without = config, without
        self._areas = TerrainAreas(settings)
        self._result: LoadedTerrain | None = LoadedTerrain(None, without) if without else None
        self._taken: str | None = None
        self._is_loading = False

    def follow(self, nav: NavSolution) -> bool:
        """Take a solution; True if it begins to load the square around it."""
        if self._without or self._is_loading or not self._areas.is_wanted(nav):
            return False
        self._is_loading = True
        # a daemon thread: a flight that ends before loading has ended does not wait for it
        threading.Thread(target=self._run, args=(nav,), name="ground", daemon=True).start()
        return True

    def take(self) -> LoadedTerrain | None:
        """The result, once, after a square was loaded; otherwise None."""
        result, self._result = self._result, None
        if result is not None:
            self._is_loading = False
            self._taken = f"not available: {result.fault}" if result.ground is None else result.ground.name
        return result

    @property
    def is_done(self) -> bool:
        """A first result was taken."""
        return self._taken is not None

    @property
    def state(self) -> str:
        """The state as a text for people."""
        return self._taken or ("loading" if self._is_loading else "waits for a position")

    def _run(self, nav: NavSolution) -> None:
        with catch_failures("terrain", self._fail):
            self._result = self._load(nav)

    def _load(self, nav: NavSolution) -> LoadedTerrain:
        """Do all slow steps here."""
        from fti.nav.kernel_warmup import warm_up  # noqa: PLC0415 - numba: only loaded if needed

        ensure_kernels_compiled(self._config)
        result = self._areas.load(nav)
        if result.ground:
            warm_up(self._config, result.ground)
            assert result.ground.digest and result.ground.checksums
        return result

    def _fail(self, unit: str, error: Exception) -> None:
        del unit
        self._result = LoadedTerrain(None, f"{type(error).__name__}: {error}")
