"""Record every byte and navigate live, until Ctrl-C.

Opens the links of CONFIG, records every received byte into MCAP, decodes the same bytes in a separate process,
navigates, and shows the outputs on a page.

  fti run configs/research_aircraft.toml
  fti run configs/bench.toml --duration 60 --out /data/flights

Each session is written to a new folder below [session] directory.  After Ctrl-C or SIGTERM its files are finished;
files that a killed session left open are closed at the next start in the same directory.

The exit code is 0 after --duration, 130 after Ctrl-C or SIGTERM.  In both cases it is 3 when frames were lost because
no storage target accepted them; the number is printed, "fti verify" lists them.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from fti.cli._arguments import seconds
from fti.cli._daemon import early_recorder, serve


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``fti run``."""
    parser.add_argument("config", metavar="CONFIG", help="the configuration (TOML)")
    parser.add_argument("--duration", type=seconds, metavar="S", help="end after S seconds of recording")
    parser.add_argument("--out", metavar="DIR", help="record below DIR instead of [session] directory")
    parser.add_argument("--links", metavar="DIR", help="open every serial and slcan port at DIR/<link> (an emulator)")
    parser.add_argument("--origin", choices=("flight", "hil", "replay"), help="origin of the data, always displayed")
    parser.add_argument("--run-dir", metavar="DIR", help="run directory for fti watch, mark, send and page")


def run(args: argparse.Namespace) -> int:
    """Run the daemon to its end."""
    with early_recorder() as recorder:
        from fti import config as configuration
        from fti.private_folder import check_trusted

        config = configuration.load(args.config)
        changes = {"directory": args.out, "origin": args.origin}
        config = configuration.with_session(config, **{k: v for k, v in changes.items() if v is not None})
        if args.links:
            check_trusted(Path(args.links))
            config = configuration.with_links(config, args.links)
        return serve(config, recorder, run_dir=args.run_dir, duration_s=args.duration)
