"""What a configuration needs compiled, by a process of its own where it was never compiled on this machine.

Compiling takes tens of seconds and holds the interpreter: on a thread beside navigation it kept that late by all of
them for the whole flight.  Where the code is on disk already, nothing is started.

    standard input    the configuration, as JSON
"""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING, Any

from fti.config import Config

if TYPE_CHECKING:
    from fti.nav.terrain_reference import Ground

#: It gives way to what records and navigates.
NICENESS = 10


def ensure_kernels_compiled(config: Config) -> None:
    """Compile what is not compiled yet, and wait for it."""
    from fti.terrain.kernel import is_cached  # noqa: PLC0415 - numba: whoever needs no kernel loads none

    if not all(is_cached(kernel) for kernel in _kernels(config)):
        command = [sys.executable, "-m", "fti.service.navigation.kernel_compiler"]
        subprocess.run(command, input=config.model_dump_json(), text=True, check=False)


def _kernels(config: Config) -> list[Any]:
    """Those that are compiled last of what a configuration needs."""
    needed: list[Any] = []
    if config.nav.approach:
        from fti.nav.integrity import window  # noqa: PLC0415 - see above

        needed.append(window.means)
    if config.nav.filter:
        from fti.nav.filter import kernels  # noqa: PLC0415

        needed.append(kernels.correct)
    if config.nav.terrain and config.nav.altimeters:
        from fti.nav.altimetry import scalar_kernels  # noqa: PLC0415

        needed.append(scalar_kernels.told)
    return needed


def _flat_terrain() -> Ground:
    """A ground that any altimeter finds below it."""
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
