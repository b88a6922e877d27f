"""Compare the recorded session of an emulated flight with its scenario: flags, alarms and outputs.

SCENARIO is the name of a shipped scenario (fti hil --list), "all", or a file.  SESSION is the recording of the daemon
during the flight.  With several sessions, or without SCENARIO, the truth file of each session names its scenario;
without SCENARIO it must be a shipped one.

For each fault it lists the expected flags and the alarms that follow from them (/fti/alarm IDENTITY), whether they are
in the session, with which latency, and whether they cleared; then flags and alarms that no fault explains; then the
scenario's own [[expect]] rows.

  fti hil altimeter_failure --links /tmp/links --truth flight_truth_000.mcap --wait &
  fti run configs/demo.toml --links /tmp/links --origin hil
  fti score altimeter_failure data/demo_20260102T030405Z_0 --truth flight_truth_000.mcap

A session of fti demo contains its truth files; it may hold several flights, and each is scored:

  fti demo --scenario silence --duration 100
  fti score data/demo_20260102T030405Z_0 --plot silence.png

  fti score silence --fly /tmp                     flies it first, accelerated, without ports and daemon
  fti score all --fly /tmp/flown --junit all.xml   flies and scores every scenario, each below /tmp/flown/SCENARIO
  fti score silence obstacle data/demo_*           each session by its scenario; a table at the end

  found           raised in time, and cleared in time
  late, missing   a miss: exit code 1
  does not clear  set longer than its cause explains: 1
  not expected    a flag that nothing explains: 1
  not known yet   the daemon does not monitor this effect: not a miss and not a success
  outputs compared   no flag is expected; a wrong output of navigation that is flagged valid fails
  not flown       the flight ended before
  needs real ports   an accelerated flight has no ports
  nothing is due  too short or too small to be detected; or of a device that navigation does not use
  not compared: start   the unit was starting, which may take 10 s, and no time in an accelerated flight
  bench was late  the emulator was late at that time, according to its truth file; never in an accelerated flight
  not configured  expected with the configuration of the scenario, not with the emulated one: a miss

The expected flags follow from the configuration of the emulator, which its truth file contains; a session recorded with
other devices, links or roles fails, with the differing keys.  --config takes another configuration, without comparison.

Late navigation and missing ticks of the recorder explain no miss.  Misses are: navigation is behind for more than a
fifth of a flight, starts after 10 s, or publishes nothing for the last 5 s; the recorder stalls.  If the emulator was
late for more than a fifth of the flight, and there is no miss, the flight is inconclusive: exit code 1.

The truth file holds the start time of the flight and its scenario: another scenario is rejected.
Exit code 0: all holds; 1: it does not, or is inconclusive; 2: usage error, no truth, another scenario; 3: the recording
has losses.  With several flights all are scored, even if one cannot be; the exit code is 1 where any does not hold.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fti.cli._arguments import new_file, picture
from fti.cli._printing import print_json, print_line, print_lines
from fti.cli.main import EXIT_LOSSES, EXIT_WRONG
from fti.errors import FtiError, RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from fti.cli._score_jobs import Job
    from fti.logger.reading.recording import Recording
    from fti.post.score.comparison import Score
    from fti.post.score.outcome import UnscoredFlight


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SCENARIO, SESSION and options."""
    parser.add_argument(
        "files",
        metavar="SCENARIO|SESSION",
        nargs="+",
        help='scenario: name of a shipped one ("all": every one), or a file; session: its folder, or an MCAP file',
    )
    parser.add_argument("--truth", metavar="FILE", help="truth file of the flight (default: those in SESSION)")
    parser.add_argument("--config", metavar="CONFIG", help="configuration for the expected flags, not the emulator's")
    parser.add_argument("--fly", metavar="DIR", help="fly each scenario first, accelerated, and record below DIR")
    parser.add_argument(
        "--plot", type=picture, metavar="FILE", help="plot faults and flags over time to FILE (.png, .svg)"
    )
    parser.add_argument(
        "--junit", type=new_file(), metavar="FILE", help="write JUnit XML: a miss is a failure, a late bench an error"
    )
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Score every flight; 1 when one does not hold."""
    from fti.cli._read_report import report_faults
    from fti.post.score import junit
    from fti.post.score.comparison import Score
    from fti.post.score.report import as_json_list, as_summary, as_text

    opened: list[Recording] = []
    jobs = _jobs(args, opened)
    scores: list[Score | UnscoredFlight] = []
    for score in _scores(jobs):
        scores.append(score)
        if not args.json and isinstance(score, Score):
            print_lines(["", *as_text(score)] if len(scores) > 1 else as_text(score))
    if args.json:
        print_json(list(as_json_list(scores)))
    elif len(jobs) > 1:
        print_lines(["", *as_summary(scores)])
    _draw(scores, args.plot)
    if args.junit:
        junit.write(scores, args.junit)
    for recording in opened:
        report_faults(recording)
    if any(isinstance(score, Score) and not score.holds for score in scores):
        return 1
    unscored = next((score.exit_code for score in scores if not isinstance(score, Score)), 0)
    return unscored or (EXIT_LOSSES if any(recording.faults for recording in opened) else 0)


def _jobs(args: argparse.Namespace, opened: list[Recording]) -> list[Job]:
    """The flights to score.  opened : filled with the sessions that are read"""
    from fti.cli._score_jobs import flight_jobs, session_jobs, split_names
    from fti.logger.reading.recording import Recording
    from fti.post.reprocess import other_setup

    def open_(session: Path) -> Recording:
        opened.append(Recording.open(session))
        return opened[-1]

    names, sessions = split_names(args.files, bool(args.fly))
    _reject(args, args.fly and sessions, "SESSION: not with --fly, which records its own session")
    _reject(args, not args.fly and not sessions, "SESSION: missing; name one, or give --fly DIR")
    _reject(args, args.truth and len(sessions) != 1, "--truth: only with exactly one SESSION")
    if args.fly:
        return flight_jobs(names, Path(args.fly), Path(args.config) if args.config else None, open_)
    setup = other_setup(args.config) if args.config else None
    truth = Path(args.truth) if args.truth else None
    return session_jobs(names, [open_(Path(session)) for session in sessions], truth, setup)


def _reject(args: argparse.Namespace, is_wrong: object, text: str) -> None:
    if is_wrong:
        args.parser.error(text)


def _scores(jobs: Sequence[Job]) -> Iterator[Score | UnscoredFlight]:
    """Score the flights in turn; with several jobs an error of one does not stop the others."""
    from fti.post.score.outcome import UnscoredFlight

    if len(jobs) == 1:
        yield from jobs[0].score()
        return
    for number, job in enumerate(jobs, 1):
        print_line(f"{number} of {len(jobs)}: {job.name}", error=True, flush=True)
        try:
            yield from job.score()
        except FtiError as error:
            print_line(f"fti: {job.name}: {error}", error=True)
            yield UnscoredFlight(job.name, str(error), EXIT_LOSSES if isinstance(error, RecordingError) else EXIT_WRONG)


def _draw(scores: Sequence[Score | UnscoredFlight], file: Path | None) -> None:
    """Plot each flight to a separate file."""
    if file is None:
        return
    from fti.plot_style import write_figure
    from fti.post.score.comparison import Score
    from fti.post.score.plot import draw_score

    for number, score in enumerate(scores):
        if isinstance(score, Score):
            path = file if len(scores) == 1 else file.with_stem(f"{file.stem}_{number}")
            write_figure(partial(draw_score, score), path)
