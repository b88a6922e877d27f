"""The recorder process: records bytes without decoding them.

Asyncio readers timestamp and number incoming frames and put them into the triple buffer of their link and into the
ring; a writer thread writes the buffers to the MCAP file.  No other process can block it.  It must not import numpy,
numba, zenoh, aiohttp, drivers or navigation; a test checks this.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import os
import sys
from collections.abc import Sequence

from fti.clock import SystemClock
from fti.logger.file_mode import set_file_mode
from fti.messages.control import ToRecorder
from fti.service import realtime
from fti.service.control_channel import await_startup
from fti.service.recorder.process import RecorderProcess
from fti.service.startup import RecorderStartup

#: Niceness of the recorder.
PRIORITY = -10


def main(argv: Sequence[str] | None = None) -> int:
    """``python -m fti.service.recorder``: started by the supervisor alone."""
    _ask_for_priority()
    if received := await_startup(argv, ToRecorder):
        channel, text, ring_fds = received
        startup = RecorderStartup.model_validate_json(text)
        set_file_mode(int(startup.config.session.file_mode, 8))
        recorder = RecorderProcess(startup, SystemClock(startup.epoch_ns), channel, ring_fds)
        gc.freeze()
        recorder.report_refused(realtime.apply(startup.config.recorder))
        asyncio.run(recorder.run())
    return 0


def _ask_for_priority() -> None:
    """Raise the priority of the process, if permitted."""
    with contextlib.suppress(PermissionError):
        os.nice(PRIORITY)


if __name__ == "__main__":
    sys.exit(main())
