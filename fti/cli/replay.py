"""Send a recorded session again: the same bytes on the same links, at their timing.

Serial and slcan ports appear as symlinks in a folder; give the same folder to the daemon.  The replay begins when
every serial line, slcan channel and UDP port has been opened, and half a second later (a CAN bus does not tell who
listens).  Nothing is lost: while a line is full, the replay waits.  What the daemon had sent itself is not sent again.
A snapshot, or a session in mode "snapshot", is sent as far as it was recorded, with its pauses; it begins with its
first frame.

With the configuration of the recording nothing leaves this machine: an address that is not loopback, and a CAN bus that
is not a vcan, is refused unless --allow-remote is given.  --config gives a configuration of your own, which may name
them.

In a terminal: space pauses and goes on, "." or s sends one frame and pauses, q ends.  A daemon of the same name shows
the position, on its page and in ``fti watch``.

At the end stands how late the frames of each link were; ``fti compare`` proves that recording them gave the same.

    fti replay data/demo_20260101T120000Z_0 --links /tmp/links &
    fti run configs/demo.toml --links /tmp/links --origin replay
    fti replay data/demo_20260101T120000Z_0 --only gnss_line,ins_eth --from 120 --loop
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from fti.cli._arguments import factor, seconds
from fti.cli._printing import print_line, print_status
from fti.cli.main import EXIT_INTERRUPTED

if TYPE_CHECKING:
    import asyncio

    from fti.hil.replay import Replay
    from fti.hil.report import TransmissionReport

#: How often the position is shown on a terminal, and told elsewhere [s].
SHOW_PERIOD_S, PRINT_PERIOD_S = 0.5, 60.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of ``fti replay``."""
    parser.add_argument("session", metavar="SESSION", help="folder of a session, or one of its files")
    parser.add_argument("--speed", type=factor, default=1.0, metavar="X", help="times as fast (default: 1)")
    parser.add_argument("--from", type=seconds, default=0.0, dest="from_s", metavar="T", help="leave out the first T s")
    parser.add_argument("--loop", action="store_true", help="again and again, until it is interrupted")
    parser.add_argument("--only", type=_names, default=(), metavar="LINK[,LINK]", help="these links alone")
    parser.add_argument("--links", default="links", metavar="DIR", help="folder of the ports (default: links)")
    parser.add_argument("--config", metavar="CONFIG", help="another configuration than the session's own")
    parser.add_argument(
        "--allow-remote",
        action="store_true",
        help="send also to addresses beyond this machine and to real CAN buses that the recording names",
    )
    parser.add_argument("--report", metavar="FILE", help="write what was sent, and how late, to this JSON file")
    parser.add_argument(
        "--wait",
        type=seconds,
        default=0.5,
        metavar="S",
        help="wait so long after every port was opened (default: 0.5)",
    )


def _names(text: str) -> tuple[str, ...]:
    return tuple(text.split(","))


def run(args: argparse.Namespace) -> int:
    """Replay to the end or to a signal."""
    from pathlib import Path

    from fti.cli._emulator_run import check_report, claim_ports, print_report, run_until_stopped, write_report
    from fti.clock import SystemClock, choose_epoch_ns
    from fti.hil import event_loop
    from fti.hil.status import StatusPublisher, describe_replay

    check_report(args.report)
    replay, length_s = _open(args)
    title, clock = Path(args.session).name, SystemClock(choose_epoch_ns())
    teller = StatusPublisher(lambda: describe_replay(replay, title, length_s), clock, replay.session_name, None)
    with claim_ports(Path(args.links)), teller:
        report, interrupted = event_loop.run(
            run_until_stopped(lambda stop: _play(replay, length_s, stop), replay.ready)
        )
    print_report(report)
    write_report(report, args.report)
    return EXIT_INTERRUPTED if interrupted else 0


def _open(args: argparse.Namespace) -> tuple[Replay, float | None]:
    """The replay, and how long the session is [s]."""
    from pathlib import Path

    from fti import config as configuration
    from fti.cli._read_report import report_remarks
    from fti.hil.replay import Replay, length_s
    from fti.hil.replay_addresses import check_links
    from fti.hil.session_config import recorded_config
    from fti.logger.reading.recording import Recording

    session = Path(args.session)
    recording = Recording.open(session)
    report_remarks(recording)
    config = configuration.load(args.config) if args.config else recorded_config(recording, session)
    if not (args.config or args.allow_remote):
        check_links([link for link in config.link if not args.only or link.name in args.only], str(session))
    replay = Replay(
        recording,
        config,
        Path(args.links),
        speed=args.speed,
        from_s=args.from_s,
        wait_s=args.wait,
        loop=args.loop,
        only=args.only,
    )
    return replay, length_s(recording)


async def _play(replay: Replay, length_s: float | None, stop: asyncio.Event) -> TransmissionReport:
    """Replay, with keys and the position where somebody sees them."""
    import asyncio

    from fti.cli._emulator_run import print_notice
    from fti.cli._keyboard import handle_keys

    replay_clock = replay.replay_clock
    with handle_keys({" ": replay_clock.pause, ".": replay_clock.step, "s": replay_clock.step, "q": stop.set}):
        showing = asyncio.create_task(_show(replay, length_s), name="fti-replay-position")
        try:
            return await replay.run(stop, print_notice)
        finally:
            showing.cancel()


async def _show(replay: Replay, length_s: float | None) -> None:
    """Show the position: in place on a terminal, else a line a minute."""
    import asyncio
    import sys

    seen = sys.stderr.isatty()
    while True:
        await asyncio.sleep(SHOW_PERIOD_S if seen else PRINT_PERIOD_S)
        if (position_s := replay.position_s) is not None:
            whole = f" of {length_s:.0f}" if length_s else ""
            state = ", paused" if replay.replay_clock.is_paused else ""
            text = f"{position_s:.1f}{whole} s{state}"
            print_status(text) if seen else print_line(text, error=True, flush=True)
