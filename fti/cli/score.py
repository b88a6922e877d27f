"""Compare what the daemon said of an emulated flight with what its scenario expected.

SCENARIO is the name of a shipped one (fti hil --list) or a file, SESSION what the daemon recorded while it was flown.
For each fault the flags that the daemon had to raise, whether they are in the session, after how long, and whether they
went away again; then flags that no fault explains; then the scenario's own [[expect]] rows.

  fti hil altimeter_failure --links /tmp/links --truth flight_truth_000.mcap --wait &
  fti run configs/demo.toml --links /tmp/links --origin hil
  fti score altimeter_failure data/demo_20260102T030405Z_0 --truth flight_truth_000.mcap

A session of fti demo has its truth beside it; it may be several flights, and each is judged:

  fti demo --scenario silence --duration 100
  fti score silence data/demo_20260102T030405Z_0 --plot silence.png

  fti score silence --fly /tmp                     flies it first, faster than time, without a port or a daemon

  found           raised in time, and gone in time
  late, missing   a miss: exit code 1            does not clear   it stands longer than its cause explains: 1
  not expected    a flag that nothing explains: 1
  not known yet   no part of the daemon compares this so far: neither a miss nor a success
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
has losses.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from fti.cli._printing import print_json, print_lines
from fti.cli.main import EXIT_LOSSES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fti.hil.scenario import Scenario
    from fti.post.score.judging import Score


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SCENARIO, SESSION and what belongs to them."""
    parser.add_argument("scenario", metavar="SCENARIO", help="name of a shipped scenario, or a file")
    parser.add_argument("session", metavar="SESSION", nargs="?", help="session folder")
    parser.add_argument("--truth", metavar="FILE", help="truth of the flight (default: those in SESSION)")
    parser.add_argument("--config", metavar="CONFIG", help="expect flags by this configuration, not by the played one")
    parser.add_argument("--fly", metavar="DIR", help="fly it first, accelerated, and record below DIR")
    parser.add_argument("--plot", metavar="FILE", help="draw faults and flags over time (.png, .svg)")
    parser.add_argument("--junit", metavar="FILE", help="write JUnit XML: a miss is a failure, a late bench an error")
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Judge every flight of the session; 1 when one does not hold."""
    from fti.cli._reading import reading, report_faults
    from fti.hil import scenario as scenarios
    from fti.logger.reading.recording import Recording
    from fti.post.reprocess import other_setup
    from fti.post.score import junit
    from fti.post.score.flown import find_truths
    from fti.post.score.report import as_json, as_text
    from fti.post.score.session_score import judge_session

    if args.plot and Path(args.plot).suffix not in (".png", ".svg"):
        args.parser.error(f"--plot {args.plot}: must end with .png or .svg")
    scenario = scenarios.load(scenarios.find(args.scenario))
    recording = Recording.open(_fly(scenario, args) if args.fly else _named(args))
    given = other_setup(args.config) if args.config else None
    truths = find_truths(recording, Path(args.truth) if args.truth else None)
    scores = list(judge_session(recording, scenario, truths, given, lambda: reading(recording, "score")))
    if args.json:
        print_json([as_json(score) for score in scores])
    else:
        for number, score in enumerate(scores):
            print_lines(["", *as_text(score)] if number else as_text(score))
    _draw(scores, args.plot)
    if args.junit:
        junit.write(scores, Path(args.junit))
    report_faults(recording)
    if not all(score.holds for score in scores):
        return 1
    return EXIT_LOSSES if recording.faults else 0


def _fly(scenario: Scenario, args: argparse.Namespace) -> Path:
    from fti.hil.accelerated import fly
    from fti.hil.scenario import load_config

    _refuse(args, args.session, "SESSION and --fly: one of them, for --fly records its own")
    return fly(load_config(scenario, Path(args.config) if args.config else None), scenario, Path(args.fly))


def _named(args: argparse.Namespace) -> Path:
    _refuse(args, not args.session, "which SESSION? Or --fly DIR, which records one")
    return Path(args.session)


def _refuse(args: argparse.Namespace, wrong: object, text: str) -> None:
    if wrong:
        args.parser.error(text)


def _draw(scores: Sequence[Score], file: str | None) -> None:
    """Each flight into a file of its own."""
    from fti.post.score.picture import draw

    if file is None:
        return
    for number, score in enumerate(scores):
        path = Path(file)
        draw(score, path if len(scores) == 1 else path.with_stem(f"{path.stem}_{number}"))
