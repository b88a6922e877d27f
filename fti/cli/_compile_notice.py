"""Notice that numerical kernels are compiled, which delays the first use of a command."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

from fti.cli._emulator_run import print_notice

NOTICE = "compiling, at the first use only (about a minute)"


@contextlib.contextmanager
def announce_compilation() -> Iterator[None]:
    """Print the notice once if a kernel is compiled in the block; code in the cache is not compiled."""
    from numba.core import event

    class FirstCompilation(event.Listener):
        is_announced = False

        def on_start(self, _event: object) -> None:
            if not self.is_announced:
                self.is_announced = True
                print_notice(NOTICE)

        def on_end(self, _event: object) -> None:
            pass

    with event.install_listener("numba:compile", FirstCompilation()):
        yield
