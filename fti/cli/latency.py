"""How late the altimeters of a session spoke, and over how long they averaged.

What they said is laid beside what the known ground says they should have said, over the whole flight: 80 s or
more, over ground with relief, with [nav] terrain in the configuration.  100 ms are 6 m along the track at 60 m/s.

  fti latency data/da42_20261121T101500Z_0
  fti latency SESSION --json

What is found comes on top of latency_ms of the device; add it there.  Sigma is one standard deviation.
"""

from __future__ import annotations

import argparse
import dataclasses

from fti.cli._printing import print_json, print_lines


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SESSION, --json."""
    parser.add_argument("session", metavar="SESSION", help="session folder, recorded or reprocessed")
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """3 when a file broke off."""
    from pathlib import Path

    from fti.cli._read_report import report_faults, report_remarks
    from fti.logger.reading.recording import Recording
    from fti.post.latency import altimeter_latencies, as_line

    session = Path(args.session)
    recording = Recording.open(session)
    report_remarks(recording)
    found = altimeter_latencies(recording, session)
    if args.json:
        print_json({name: one and dataclasses.asdict(one) for name, one in found.items()})
    else:
        print_lines(as_line(name, one) for name, one in found.items())
    report_faults(recording)
    return 3 if recording.faults else 0
