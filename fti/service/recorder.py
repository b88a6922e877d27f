"""The recorder process: bytes only.

Asyncio readers stamp and number what arrives and put it into the triple buffer of its link and into the ring; one
writer thread carries the buffers into the MCAP file.  Nothing here understands a byte, and nothing downstream can
stop it.  This module reaches no numpy, numba, zenoh, aiohttp, driver or navigation; a test looks.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import signal
import sys
from collections.abc import Sequence

from fti.clock import SystemClock
from fti.service.control import adopt_channel, read_memory_file
from fti.service.recording import Recorder, RecorderOrder


def main(argv: Sequence[str] | None = None) -> int:
    """``python -m fti.service.recorder``: started by the supervisor alone."""
    parser = argparse.ArgumentParser()
    for name in ("--control-fd", "--init-fd", "--ring-fd"):
        parser.add_argument(name, type=int, required=True)
    args = parser.parse_args(argv)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the supervisor decides when it ends
    order = RecorderOrder.model_validate_json(read_memory_file(args.init_fd))
    recorder = Recorder(order, SystemClock(order.epoch_ns), adopt_channel(args.control_fd), args.ring_fd)
    gc.freeze()
    asyncio.run(recorder.run())
    return 0


if __name__ == "__main__":
    sys.exit(main())
