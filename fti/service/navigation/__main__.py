"""The navigation process: decodes the frames in the ring, navigates, writes the derived file."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path

from fti.buffers.ring import Ring
from fti.clock import SystemClock
from fti.config import Config, position_sources
from fti.logger.file_mode import set_file_mode
from fti.messages.control import ToNavigation
from fti.messages.outputs import Event
from fti.quick_exit import run_and_exit
from fti.service.control_channel import await_startup
from fti.service.navigation.kernel_compiler import ensure_kernels_compiled
from fti.service.navigation.process import NavigationProcess
from fti.service.startup import NavigationStartup

NOT_COMPILED = "the session ended while navigation was compiled (first start only); fti reprocess computes its outputs"


def main(argv: Sequence[str] | None = None) -> int:
    """``python -m fti.service.navigation``: started by the supervisor alone."""
    _end_before_recorder()
    if received := await_startup(argv, ToNavigation):
        channel, text, ring_fds = received
        startup = NavigationStartup.model_validate_json(text)
        set_file_mode(int(startup.config.session.file_mode, 8))
        ring, clock = Ring.attach(ring_fds), SystemClock(startup.epoch_ns)
        if _load_kernels(startup.config, lambda: not ring.has_ended):
            NavigationProcess(startup, clock, channel, ring).run()
        else:
            channel.send(Event(t_ns=clock.now_ns(), level="warning", source="navigation", text=NOT_COMPILED))
    return 0


def _load_kernels(config: Config, is_needed: Callable[[], bool]) -> bool:
    """Load all kernels but those of the terrain before the first frame; frames wait in the ring meanwhile.

    Without a source of position, filter and approach none is used: such a daemon starts at once.  Returns False if
    they had to be compiled, and were no longer needed.
    """
    if position_sources(config.nav) or config.nav.filter or config.nav.approach:
        from fti.nav.kernel_warmup import warm_up  # noqa: PLC0415 - filter, integrity, terrain: only loaded if needed

        if not ensure_kernels_compiled(config, is_needed):
            return False
        warm_up(config, None)
    return True


def _end_before_recorder() -> None:
    """When memory runs out (a large terrain), let the kernel end this process and not the recorder."""
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("500", encoding="ascii")


if __name__ == "__main__":
    run_and_exit(main)
