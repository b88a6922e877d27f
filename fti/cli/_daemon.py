"""What ``fti run`` and ``fti demo`` share: a recorder that starts first, and a daemon that talks to this terminal."""

from __future__ import annotations

import contextlib
import sys
from typing import TYPE_CHECKING

from fti.cli._printing import print_line
from fti.cli.main import EXIT_INTERRUPTED
from fti.interrupts import track_interrupts

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fti.config import Config
    from fti.service.children import Child
    from fti.service.daemon import Companion


@contextlib.contextmanager
def early_recorder() -> Iterator[Child]:
    """The recorder of ``fti.service.daemon``; an interrupt that an import swallows in the block ends ``serve`` at once.

    The imports build the tables of the configuration.
    """
    with track_interrupts():
        from fti.service import daemon

        with daemon.early_recorder() as recorder:
            yield recorder


def serve(
    config: Config,
    recorder: Child,
    *,
    run_dir: str | None,
    duration_s: float | None = None,
    companion: Companion | None = None,
) -> int:
    """Run the daemon to its end; what it announces is printed.  Returns the exit code.

    duration_s, companion : as of ``fti.service.daemon.serve``
    """
    import asyncio

    from fti.service import daemon

    signalled = asyncio.run(
        daemon.serve(
            config,
            recorder=recorder,
            announce=lambda line: print_line(line, flush=True),
            run_dir=run_dir,
            duration_s=duration_s,
            companion=companion,
            shows_key=sys.stdout.isatty(),
        )
    )
    return EXIT_INTERRUPTED if signalled else 0
