"""Estimate latency and averaging time of the altimeters of a session.

Correlates the recorded ranges with the ranges predicted from the terrain, over the whole flight: at least 80 s over
terrain with relief, with [nav] terrain in the configuration.  100 ms are 6 m along the track at 60 m/s.

  fti latency data/da42_20261121T101500Z_0
  fti latency SESSION --json

The estimate is in addition to latency_ms of the device; add it there.  Sigma is one standard deviation.
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
    """Estimate and print; 3 when a file could not be read to its end."""
    from pathlib import Path

    from fti.cli._read_report import report_faults, report_remarks, show_read_progress
    from fti.logger.reading.recording import Recording
    from fti.post.latency import altimeter_latencies, as_line

    session = Path(args.session)
    recording = Recording.open(session)
    report_remarks(recording)
    with show_read_progress(recording, "reading", files=recording.derived_files):
        estimates = altimeter_latencies(recording, session)
    if args.json:
        print_json({name: estimate and dataclasses.asdict(estimate) for name, estimate in estimates.items()})
    else:
        print_lines(as_line(name, estimate) for name, estimate in estimates.items())
    report_faults(recording)
    return 3 if recording.faults else 0
