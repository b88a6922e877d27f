"""Send a recorded session again: the same bytes on the same links, at their timing.

Serial and slcan ports appear as symlinks in a folder; give the same folder to the daemon.  The replay begins when
every serial line, slcan channel and UDP port has been opened, and half a second later (a CAN bus does not tell who
listens).  Nothing is lost: while a line is full, the replay waits.  A snapshot, or a session in mode "snapshot", is
sent as far as it was recorded, with its pauses; it begins with its first frame.

    fti replay data/demo_20260101T120000Z_0 --links /tmp/links &
    fti run configs/demo.toml --links /tmp/links --origin replay
"""

from __future__ import annotations

import argparse

from fti.cli._arguments import factor, seconds
from fti.cli.main import EXIT_INTERRUPTED


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of ``fti replay``."""
    parser.add_argument("session", metavar="SESSION", help="folder of a session, or one of its files")
    parser.add_argument("--speed", type=factor, default=1.0, metavar="X", help="times as fast (default: 1)")
    parser.add_argument("--from", type=seconds, default=0.0, dest="from_s", metavar="T", help="leave out the first T s")
    parser.add_argument("--links", default="links", metavar="DIR", help="folder of the ports (default: links)")
    parser.add_argument("--config", metavar="CONFIG", help="another configuration than the session's own")
    parser.add_argument(
        "--wait",
        type=seconds,
        default=0.5,
        metavar="S",
        help="wait so long after every port was opened (default: 0.5)",
    )


def run(args: argparse.Namespace) -> int:
    """Replay to the end or to a signal."""
    import asyncio
    import sys
    from pathlib import Path

    from fti import config as configuration
    from fti.cli._playing import print_report, until_stopped
    from fti.cli._reading import report_remarks
    from fti.hil.replay import Replay, recorded_config
    from fti.logger.reading.recording import Recording

    session = Path(args.session)
    recording = Recording.open(session)
    report_remarks(recording)
    config = configuration.load(args.config) if args.config else recorded_config(recording, session)
    replay = Replay(recording, config, Path(args.links), speed=args.speed, from_s=args.from_s, wait_s=args.wait)

    def progress(step: str) -> None:
        print(step, file=sys.stderr, flush=True)

    report, interrupted = asyncio.run(until_stopped(lambda stop: replay.run(stop, progress), replay.ready))
    print_report(report)
    return EXIT_INTERRUPTED if interrupted else 0
