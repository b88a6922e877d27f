"""The navigation process: decodes what the recorder puts into the ring, navigates, writes the derived file."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Sequence

from fti.clock import SystemClock
from fti.service.control import adopt_channel, read_memory_file
from fti.service.navigating import NavigationOrder, Navigator


def main(argv: Sequence[str] | None = None) -> int:
    """``python -m fti.service.navigation``: started by the supervisor alone."""
    parser = argparse.ArgumentParser()
    for name in ("--control-fd", "--init-fd", "--ring-fd"):
        parser.add_argument(name, type=int, required=True)
    args = parser.parse_args(argv)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the supervisor decides when it ends
    order = NavigationOrder.model_validate_json(read_memory_file(args.init_fd))
    Navigator(order, SystemClock(order.epoch_ns), adopt_channel(args.control_fd), args.ring_fd).run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
