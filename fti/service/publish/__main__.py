"""Start of the publish process: ``python -m fti.service.publish``, started by the supervisor alone."""

from __future__ import annotations

import argparse
import os
import signal
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from fti.clock import SystemClock
from fti.config import Publish
from fti.messages.control import Ready
from fti.publish.message import SessionIdentity
from fti.service.control_channel import open_inherited_channel
from fti.service.publish.process import PublishProcess

#: It must not delay recorder and navigation on a busy computer.
NICE = 10


def main(argv: Sequence[str] | None = None) -> NoReturn:
    """See the module."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--bus", required=True, type=Path)
    parser.add_argument("--session", required=True)
    parser.add_argument("--aircraft", required=True)
    parser.add_argument("--table", required=True, help="[publish] as JSON")
    parser.add_argument("--epoch-ns", type=int, required=True)
    parser.add_argument("--control-fd", type=int, required=True)
    args = parser.parse_args(argv)
    os.nice(NICE)
    for number in (signal.SIGINT, signal.SIGTERM):  # the supervisor decides when it ends
        signal.signal(number, signal.SIG_IGN)
    channel = open_inherited_channel(args.control_fd)
    process = PublishProcess(
        Publish.model_validate_json(args.table),
        SessionIdentity(args.aircraft, args.session),
        args.bus,
        clock=SystemClock(args.epoch_ns),
        channel=channel,
    )
    channel.send(Ready())
    process.run()
    channel.flush()
    os._exit(0)  # the interpreter would wait for a library that connects, until the supervisor kills it


if __name__ == "__main__":
    main()
