"""Compare what the daemon said of an emulated flight with what its scenario expected.

SCENARIO is the name of a shipped one (fti hil --list), "all" of them, or a file.  SESSION is what the daemon recorded
while it was flown.  Of several sessions the truth of each says which of the scenarios was flown.

For each fault the flags that the daemon had to raise, and the alarms that follow from them (/fti/alarm IDENTITY),
whether they are in the session, after how long, and whether they went away again; then flags and alarms that no fault
explains; then the scenario's own [[expect]] rows.

  fti hil altimeter_failure --links /tmp/links --truth flight_truth_000.mcap --wait &
  fti run configs/demo.toml --links /tmp/links --origin hil
  fti score altimeter_failure data/demo_20260102T030405Z_0 --truth flight_truth_000.mcap

A session of fti demo has its truth beside it; it may be several flights, and each is judged:

  fti demo --scenario silence --duration 100
  fti score silence data/demo_20260102T030405Z_0 --plot silence.png

  fti score silence --fly /tmp                     flies it first, faster than time, without a port or a daemon
  fti score all --fly /tmp/flown --junit all.xml   flies and judges every one, each below /tmp/flown/SCENARIO
  fti score silence obstacle data/demo_*           each session by the scenario that was flown; a table at the end

  found           raised in time, and gone in time
  late, missing   a miss: exit code 1            does not clear   it stands longer than its cause explains: 1
  not expected    a flag that nothing explains: 1
  not known yet   no part of the daemon compares this so far: neither a miss nor a success
  outputs compared   no flag is due; a wrong value of navigation that is called valid fails as an output
  not flown       the flight ended before        needs real ports   an accelerated flight has no ports
  nothing is due  too short or too small to be seen; or of a device that navigation does not use
  not judged: start   the unit was starting, for which it has 10 s, and none in an accelerated flight
  bench was late  the emulator was late just then, as its truth file says; an accelerated flight has no such excuse
  not configured  due with the configuration that the scenario names, and not with the one that was played: a miss

Flags are expected by the configuration that the emulator played, which its truth file has; a session that was recorded
with other devices, links or roles fails, and the keys are named.  --config expects them by another one, uncompared.

Neither how late navigation calls itself nor missing ticks of the recorder excuse anything.  Navigation that is behind
for more than a fifth of a flight, that begins after 10 s or says nothing for the last 5 s, and a recorder that stands
still are misses.  Where the emulator was late for more than a fifth of the flight, and there is no miss, the flight
proves nothing: exit code 1.

When the flight began stands in the truth file alone, with the scenario that was flown: another one is refused.
Exit code 0: all holds; 1: it does not, or proves nothing; 2: wrong call, no truth, another scenario; 3: the recording
has losses.  Of several flights one that cannot be judged does not hide the others; where any does not hold it is 1.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fti.cli._printing import print_json, print_line, print_lines
from fti.cli.main import EXIT_LOSSES, EXIT_WRONG
from fti.errors import FtiError, MissingError, RecordingError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from fti.cli._score_jobs import Job
    from fti.logger.reading.recording import Recording
    from fti.post.score.comparison import Score
    from fti.post.score.unscored_flight import UnscoredFlight


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SCENARIO, SESSION and what belongs to them."""
    parser.add_argument(
        "files",
        metavar="SCENARIO|SESSION",
        nargs="+",
        help='a scenario: name of a shipped one ("all": each), or a file; a session: its folder, or an MCAP file',
    )
    parser.add_argument("--truth", metavar="FILE", help="truth of the flight (default: those in SESSION)")
    parser.add_argument("--config", metavar="CONFIG", help="expect flags by this configuration, not by the played one")
    parser.add_argument("--fly", metavar="DIR", help="fly each first, accelerated, and record below DIR")
    parser.add_argument("--plot", metavar="FILE", help="draw faults and flags over time (.png, .svg)")
    parser.add_argument("--junit", metavar="FILE", help="write JUnit XML: a miss is a failure, a late bench an error")
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Judge every flight; 1 when one does not hold."""
    from fti.cli._read_report import report_faults
    from fti.post.score import junit
    from fti.post.score.summary import as_json_list, as_summary

    _check_files(args)
    opened: list[Recording] = []
    jobs = _jobs(args, opened)
    scores: list[Score | UnscoredFlight] = []
    for score in _judge(jobs):
        scores.append(score)
        if not args.json:
            _print(score, first=len(scores) == 1)
    if args.json:
        print_json(list(as_json_list(scores)))
    elif len(jobs) > 1:
        print_lines(["", *as_summary(scores)])
    _draw(scores, args.plot)
    if args.junit:
        junit.write(scores, Path(args.junit))
    for recording in opened:
        report_faults(recording)
    return _exit_code(scores) or (EXIT_LOSSES if any(recording.faults for recording in opened) else 0)


def _exit_code(scores: Sequence[Score | UnscoredFlight]) -> int:
    """1 where a flight does not hold; else what the first that could not be judged says."""
    from fti.post.score.comparison import Score

    if any(isinstance(score, Score) and not score.holds for score in scores):
        return 1
    return next((score.exit_code for score in scores if not isinstance(score, Score)), 0)


def _check_files(args: argparse.Namespace) -> None:
    """What is to be written must be new; asked before an hour of flights."""
    if args.plot and Path(args.plot).suffix not in (".png", ".svg"):
        args.parser.error(f"--plot {args.plot}: must end with .png or .svg")
    for file in (args.plot, args.junit):
        if file and Path(file).exists():
            raise MissingError(f"{file}: cannot be written: File exists")


def _jobs(args: argparse.Namespace, opened: list[Recording]) -> list[Job]:
    """What is to be judged.  opened : filled with the sessions that are read"""
    from fti.cli._score_jobs import flight_jobs, session_jobs, split_names
    from fti.logger.reading.recording import Recording
    from fti.post.reprocess import other_setup

    def open_(session: Path) -> Recording:
        opened.append(Recording.open(session))
        return opened[-1]

    names, sessions = split_names(args.files, bool(args.fly))
    _refuse(args, not names, "which SCENARIO? Name one; it says what is expected")
    _refuse(args, args.fly and sessions, "SESSION and --fly: one of them, for --fly records its own")
    _refuse(args, not args.fly and not sessions, "which SESSION? Or --fly DIR, which records one")
    _refuse(args, args.truth and len(sessions) != 1, "--truth: belongs to one SESSION")
    if args.fly:
        return flight_jobs(names, Path(args.fly), Path(args.config) if args.config else None, open_)
    given = other_setup(args.config) if args.config else None
    truth = Path(args.truth) if args.truth else None
    return session_jobs(names, [open_(Path(session)) for session in sessions], truth, given)


def _refuse(args: argparse.Namespace, wrong: object, text: str) -> None:
    if wrong:
        args.parser.error(text)


def _judge(jobs: Sequence[Job]) -> Iterator[Score | UnscoredFlight]:
    """Each in turn; of several, one that cannot be judged does not hide the others."""
    from fti.post.score.unscored_flight import UnscoredFlight

    if len(jobs) == 1:
        yield from jobs[0].judge()
        return
    for number, job in enumerate(jobs, 1):
        print_line(f"{number} of {len(jobs)}: {job.name}", error=True, flush=True)
        try:
            yield from job.judge()
        except FtiError as error:
            print_line(f"fti: {job.name}: {error}", error=True)
            yield UnscoredFlight(job.name, str(error), EXIT_LOSSES if isinstance(error, RecordingError) else EXIT_WRONG)


def _print(score: Score | UnscoredFlight, first: bool) -> None:
    """The text of a score, apart from the one before it."""
    from fti.post.score.comparison import Score
    from fti.post.score.report import as_text

    if isinstance(score, Score):
        print_lines(as_text(score) if first else ["", *as_text(score)])


def _draw(scores: Sequence[Score | UnscoredFlight], file: str | None) -> None:
    """Each flight into a file of its own."""
    from fti.post.score.comparison import Score
    from fti.post.score.plot import draw

    if file is None:
        return
    for number, score in enumerate(scores):
        path = Path(file)
        if isinstance(score, Score):
            draw(score, path if len(scores) == 1 else path.with_stem(f"{path.stem}_{number}"))
