"""Print a go/no-go list of a running daemon before the flight.

  fti run CONFIG &             start the daemon, with all devices switched on
  fti preflight CONFIG         one line for each item: GO or NO-GO, and why
  fti preflight CONFIG --hours 6 --json

Items: the recording, hours of disk left at the present rate, each link, each device with its clock, navigation, the
roles, terrain and approach reference where configured, alarms.  An altimeter may be below its range on the ground: it
is GO when it sends heights.  Wait for a minute after switching on: a device clock is learned from some seconds of
messages.

The exit code is 0 when all items are GO, and 1 otherwise.
"""

from __future__ import annotations

import argparse

from fti.cli._printing import print_json, print_line

EXIT_NO_GO = 1
MIN_HOURS = 4.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti preflight``."""
    from fti.cli._arguments import factor

    parser.add_argument("config", metavar="CONFIG", help="configuration of the daemon")
    parser.add_argument("--run-dir", metavar="DIR", help="run directory of the daemon (default: by its session name)")
    parser.add_argument(
        "--hours", type=factor, default=MIN_HOURS, metavar="H", help=f"hours of disk needed (default: {MIN_HOURS:g})"
    )
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Print the list."""
    from dataclasses import asdict

    from fti import config as configuration
    from fti.cli._go_items import go_items
    from fti.cli._live_state import live_states
    from fti.run_directory import base, find_daemon

    config = configuration.load(args.config)
    with live_states(find_daemon(args.run_dir or str(base() / config.session.name)), "preflight") as read:
        items = list(go_items(config, read(), args.hours))
    if args.json:
        print_json([asdict(item) for item in items], indent=2)
    else:
        for item in items:
            print_line(f"{'GO' if item.is_go else 'NO-GO':6} {item.name:24} {item.text}".rstrip())
        no_go = [item.name for item in items if not item.is_go]
        print_line(f"{'NO-GO' if no_go else 'GO':6} {', '.join(no_go) or 'everything'}")
    return 0 if all(item.is_go for item in items) else EXIT_NO_GO
