"""Send a recorded session again: the same bytes on the same links, with the recorded timing.

Serial and slcan ports appear as symlinks in a folder; give the same folder to the daemon.  The replay begins half a
second after every serial line, slcan channel and UDP port has been opened (readers of a CAN bus cannot be detected).
Nothing is lost: while a line is full, the replay waits.  Frames that the daemon had sent are not sent again.  A
snapshot, or a session in mode "snapshot", is sent with its gaps; it begins with its first frame.

With the configuration of the recording nothing leaves this machine: an address that is not loopback, and a CAN bus that
is not a vcan, is rejected without --allow-remote.  With --config such addresses are allowed.

In a terminal: space pauses and resumes, "." or s sends one frame and pauses, q quits.  A daemon of the same name shows
the position, on its page and in ``fti watch``.

On exit it prints per-link lateness; ``fti compare`` checks that the re-recorded bytes are identical.

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

#: Period at which the position is shown on a terminal, and printed elsewhere [s].
SHOW_PERIOD_S, PRINT_PERIOD_S = 0.5, 60.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of ``fti replay``."""
    parser.add_argument("session", metavar="SESSION", help="folder of a session, or one of its files")
    parser.add_argument("--speed", type=factor, default=1.0, metavar="X", help="speed factor (default: 1)")
    parser.add_argument("--from", type=seconds, default=0.0, dest="from_s", metavar="T", help="skip the first T s")
    parser.add_argument("--loop", action="store_true", help="repeat until interrupted")
    parser.add_argument(
        "--only", type=lambda text: tuple(text.split(",")), default=(), metavar="LINK[,LINK]", help="only these links"
    )
    parser.add_argument("--links", default="links", metavar="DIR", help="folder of the ports (default: links)")
    parser.add_argument("--config", metavar="CONFIG", help="configuration, instead of the session's own")
    parser.add_argument(
        "--allow-remote",
        action="store_true",
        help="also send to remote addresses and real CAN buses that the recording names",
    )
    parser.add_argument("--report", metavar="FILE", help="write sent messages and lateness to this JSON file")
    parser.add_argument(
        "--wait",
        type=seconds,
        default=0.5,
        metavar="S",
        help="wait S seconds after every port was opened (default: 0.5)",
    )


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
    publisher = StatusPublisher(lambda: describe_replay(replay, title, length_s), clock, replay.session_name, None)
    with claim_ports(Path(args.links)), publisher:
        report, interrupted = event_loop.run(
            run_until_stopped(lambda stop: _play(replay, length_s, stop), replay.ready)
        )
    print_report(report)
    write_report(report, args.report)
    return EXIT_INTERRUPTED if interrupted else 0


def _open(args: argparse.Namespace) -> tuple[Replay, float | None]:
    """The replay, and the length of the session [s]."""
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
    """Replay, with keys and position display in a terminal."""
    import asyncio

    from fti.cli._emulator_run import print_notice
    from fti.cli._keyboard import handle_keys

    replay_clock = replay.replay_clock
    with handle_keys({" ": replay_clock.pause, ".": replay_clock.step, "s": replay_clock.step, "q": stop.set}):
        display = asyncio.create_task(_show(replay, length_s), name="fti-replay-position")
        try:
            return await replay.run(stop, print_notice)
        finally:
            display.cancel()


async def _show(replay: Replay, length_s: float | None) -> None:
    """Show the position: in place on a terminal, else one line per minute."""
    import asyncio
    import sys

    is_terminal = sys.stderr.isatty()
    while True:
        await asyncio.sleep(SHOW_PERIOD_S if is_terminal else PRINT_PERIOD_S)
        if (position_s := replay.position_s) is not None:
            total = f" of {length_s:.0f}" if length_s else ""
            state = ", paused" if replay.replay_clock.is_paused else ""
            text = f"{position_s:.1f}{total} s{state}"
            print_status(text) if is_terminal else print_line(text, error=True, flush=True)
