"""Show the contents of a recording.

Prints ten lines: session and origin, start and duration, whether the files are whole, losses, alarms, marks, the
approaches in the profile of the clearance monitor with the shares of its states, and the sources of the position.

With -v: the session (origin, mode, start, software, configuration), its files, and for each topic: messages, bytes,
mean and configured rate, jitter (standard deviation and 99th percentile of the interval), the longest interval, gaps,
and the activity over a common time axis, which shows when a sensor stopped.  Then gaps of links, alarms, and marks and
events with their times.

Reads recordings that are finished, packed, unfinished after a kill, or being written (exit code 3 when a file cannot
be read to its end).

  fti info data/da42_20260102T030405Z_0
  fti info -v data/da42_20260102T030405Z_0
  fti info flight_000.mcap --json
  fti info /media/disk/da42_20260102T030405Z_0 spare/da42_20260102T030405Z_0     the medium was changed: all folders
  fti info data/da42_20260102T030405Z_0 --plot activity.html      or .svg: a plot for report and browser
"""

from __future__ import annotations

import argparse

from fti.cli._arguments import new_file
from fti.cli._printing import print_json, print_lines


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SESSION, --verbose, --json and --plot."""
    parser.add_argument("session", metavar="SESSION", nargs="+", help="session folders or MCAP files of one session")
    parser.add_argument("-v", "--verbose", action="store_true", help="print files, topics, activity, gaps and events")
    parser.add_argument("--json", action="store_true", help="print JSON only")
    parser.add_argument(
        "--plot",
        metavar="FILE",
        type=new_file(".svg", ".html"),
        help="also plot the activity to FILE (.svg, .html; must not exist)",
    )


def run(args: argparse.Namespace) -> int:
    """Read everything and print it; 3 when a file could not be read to its end."""
    from fti.cli._info_summary import as_summary
    from fti.cli._info_view import as_json, as_text
    from fti.cli._read_report import report_faults, show_read_progress
    from fti.logger.reading.recording import Recording
    from fti.post.overview import Overview

    recording = Recording.open(*args.session)
    with show_read_progress(recording, "reading"):
        view = Overview.make(recording)
    if args.plot:
        from fti.post.activity_plot import write_plot

        write_plot(view, args.plot)
    if args.json:
        print_json(as_json(view))
    else:
        print_lines(as_text(view) if args.verbose else as_summary(view, args.session))
    report_faults(recording)
    return 3 if recording.faults else 0
