"""The ground of navigation: read, and its code compiled, on a thread of its own while navigation works without it.

The recording waits for none of this, and navigation does not either.  From which frame on the ground was there stands
on ``/fti/terrain``, so that reprocessing takes it at the same frame.
"""

from __future__ import annotations

import functools
import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from fti.config import Config, TerrainFiles
from fti.nav.terrain_reference import Ground
from fti.service.fault_guard import catch_failures
from fti.service.navigation.kernel_compiler import ensure_kernels_compiled

if TYPE_CHECKING:
    from fti.terrain.terrain import Terrain

Progress = Callable[[float], None]


def load_terrain(settings: TerrainFiles, progress: Progress | None = None, *, local_only: bool = False) -> Ground:
    """The ground that a configuration names.  progress : hears how far it is, 0 to 1.

    local_only : a recording names it (``Terrain.open``)

    Raises ConfigError or MissingError as ``Terrain.open`` does.
    """
    from fti.terrain.terrain import Terrain  # noqa: PLC0415 - numba: whoever navigates without terrain needs none

    if settings.scene:
        return Ground(_scene(settings.scene), settings.sd_m, f"scene {settings.scene}")
    centre = settings.centre_deg
    terrain = Terrain.open(
        settings.files,
        centre=(math.radians(centre[0]), math.radians(centre[1])) if centre else None,
        radius_m=settings.radius_m,
        cell_m=settings.cell_m,
        vertical=settings.vertical,
        progress=progress,
        local_only=local_only,
    )
    return Ground(terrain, settings.sd_m, ", ".join(settings.files), settings.files)


@functools.cache
def _scene(name: str) -> Terrain:
    from fti.terrain.demo_region import demo_region  # noqa: PLC0415
    from fti.terrain.demo_scene import demo_scene  # noqa: PLC0415 - see above

    return demo_region() if name == "demo_country" else demo_scene()


@dataclass(frozen=True, slots=True)
class LoadedTerrain:
    """What became of the ground: it is there, or a fault in words kept it away."""

    ground: Ground | None
    fault: str | None = None


class TerrainLoader:
    """Loads the ground of a configuration; ``take`` hands it over once.  without : why it is not to be loaded"""

    def __init__(self, config: Config, without: str | None = None) -> None:
        self._config, self._without = config, without
        self._share = 0.0
        self._found: LoadedTerrain | None = None
        self._taken: LoadedTerrain | None = None
        # a daemon: where the flight ends before the ground is there, nothing waits for it
        self._thread = threading.Thread(target=self._run, name="ground", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def take(self) -> LoadedTerrain | None:
        """What was found, the first time that it is there; otherwise None."""
        if self._taken is not None or self._found is None:
            return None
        self._taken = self._found
        return self._taken

    @property
    def is_done(self) -> bool:
        """It was found, or that there is none."""
        return self._taken is not None

    @property
    def state(self) -> str:
        """How it stands, for people."""
        if self._taken is None:
            return f"being loaded, {100 * self._share:.0f} %"
        if self._taken.fault:
            return f"not there: {self._taken.fault}"
        assert self._taken.ground
        return self._taken.ground.name

    def _run(self) -> None:
        with catch_failures("terrain", self._fail):
            if self._without:
                self._found = LoadedTerrain(None, self._without)
            elif settings := self._config.nav.terrain:
                self._found = LoadedTerrain(self._load(settings))

    def _load(self, settings: TerrainFiles) -> Ground:
        """All that takes long is done here: navigation would be late by seconds with the sum of many posts."""
        from fti.nav.kernel_warmup import warm_up  # noqa: PLC0415 - see above

        ensure_kernels_compiled(self._config)
        ground = load_terrain(settings, self._on_progress)
        warm_up(self._config, ground)
        assert ground.digest
        return ground

    def _on_progress(self, share: float) -> None:
        self._share = share

    def _fail(self, unit: str, error: Exception) -> None:
        del unit
        self._found = LoadedTerrain(None, f"{type(error).__name__}: {error}")
