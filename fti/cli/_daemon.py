"""Shared by ``fti run`` and ``fti demo``: start the recorder process early, run the daemon in this terminal."""

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
    """The recorder process of ``fti.service.daemon``.

    The imports in the block build the tables of the configuration and may swallow an interrupt; then ``serve`` ends
    at once.
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
    """Run the daemon to its end and print its announcements.  Returns the exit code.

    duration_s, companion : see ``fti.service.daemon.serve``
    """
    import asyncio

    from fti.service import daemon

    signalled = asyncio.run(
        daemon.serve(
            config,
            recorder=recorder,
            announce=lambda line: print_line(line, flush=True, is_folded=False),  # addresses and paths are copied
            run_dir=run_dir,
            duration_s=duration_s,
            companion=companion,
            shows_key=sys.stdout.isatty(),
        )
    )
    return EXIT_INTERRUPTED if signalled else 0
