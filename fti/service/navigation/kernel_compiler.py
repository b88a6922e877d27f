"""Compiles the kernels of a configuration in a separate process, if they are not in the cache of this machine.

Compiling takes tens of seconds and holds the interpreter lock: in a thread it would delay navigation by that time for
the whole flight.  If the cache has the code, no process is started.

    standard input    the configuration, as JSON
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from fti.config import Config

if TYPE_CHECKING:
    from fti.nav.terrain_reference import Ground

#: Recorder and navigation take precedence.
NICENESS = 10
POLL_PERIOD_S = 0.05


def ensure_kernels_compiled(config: Config, is_needed: Callable[[], bool] = lambda: True) -> bool:
    """Compile the kernels that are not in the cache, and wait for it while ``is_needed``; False if it was aborted."""
    from fti.kernel import is_cached  # noqa: PLC0415 - numba: only loaded if needed

    if all(is_cached(kernel) for kernel in _kernels(config)):
        return True
    command = [sys.executable, "-m", "fti.service.navigation.kernel_compiler"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, text=True) as process:
        assert process.stdin
        process.stdin.write(config.model_dump_json())
        process.stdin.close()
        while process.poll() is None:
            if not is_needed():
                process.kill()
                return False
            time.sleep(POLL_PERIOD_S)
    return True


def _kernels(config: Config) -> list[Any]:
    """The kernels of a configuration that are compiled last."""
    from fti.geodesy import quaternions  # noqa: PLC0415 - see above

    needed: list[Any] = [quaternions.all_quats]
    if config.nav.approach:
        from fti.nav.integrity import window  # noqa: PLC0415 - see above

        needed.append(window.means)
    if config.nav.filter:
        from fti.nav.filter import kernels  # noqa: PLC0415

        needed.append(kernels.correct)
    if config.nav.scan_drift:
        from fti.nav.scan_matching import residuals  # noqa: PLC0415

        needed.append(residuals.add_scores)
    if config.nav.terrain_position:
        from fti.nav.terrain_matching import nearest_surface  # noqa: PLC0415

        needed.append(nearest_surface.fill_nearest)
    if config.nav.terrain and config.nav.altimeters:
        from fti.nav.altimetry import scalar_kernels  # noqa: PLC0415

        needed.append(scalar_kernels.height_and_variances)
    return needed


def _flat_terrain() -> Ground:
    """A flat terrain that any altimeter can use."""
    import numpy as np  # noqa: PLC0415

    from fti.nav.terrain_reference import Ground  # noqa: PLC0415
    from fti.terrain.terrain import Terrain  # noqa: PLC0415

    return Ground(Terrain.from_array(np.zeros((64, 64)), 30.0), 1.0, "plane")


def main() -> None:
    """``python -m fti.service.navigation.kernel_compiler``: started by ``ensure_kernels_compiled`` alone."""
    from fti.nav.kernel_warmup import warm_up  # noqa: PLC0415

    os.nice(NICENESS)
    config = Config.model_validate_json(sys.stdin.read())
    warm_up(config, _flat_terrain() if config.nav.terrain else None)


if __name__ == "__main__":
    main()
