"""The flights that a call of ``fti score`` scores: scenarios to fly, or recorded sessions with their scenarios."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fti.errors import FtiError, MissingError
from fti.logger.reading.session_locator import holds_recording

if TYPE_CHECKING:
    from fti.hil.scenario import Scenario
    from fti.logger.reading.recording import Recording
    from fti.post.reprocess import Setup
    from fti.post.score.comparison import Score

#: Stands for all shipped scenarios.
ALL = "all"


@dataclass(frozen=True, slots=True)
class Job:
    """Flights to score.  name : of the scenario or session; score : raises FtiError"""

    name: str
    score: Callable[[], list[Score]]


def split_names(names: Iterable[str], flying: bool) -> tuple[list[str], list[str]]:
    """Split names into scenarios and sessions.

    The name of a shipped scenario is a scenario; a folder with MCAP files, or an MCAP file, is a session.  Any other
    name counts as a missing scenario, or, after a scenario, as a missing session.
    """
    from fti.hil import scenario as scenarios

    shipped = scenarios.shipped_names()
    found, sessions = list[str](), list[str]()
    for name in names:
        if name == ALL:
            found += shipped
        elif name not in shipped and holds_recording(Path(name)):
            sessions.append(name)
        elif name in shipped or Path(name).is_file() or flying or not found:
            found.append(name)
        else:
            sessions.append(name)
    return list(dict.fromkeys(found)), sessions


def flight_jobs(names: Sequence[str], out: Path, config: Path | None, open_: Callable[[Path], Recording]) -> list[Job]:
    """Fly and score each scenario.  out : folder of the sessions; of several scenarios each has a folder of its name"""
    from fti.hil import scenario as scenarios
    from fti.post.reprocess import other_setup

    def score(file: Path) -> list[Score]:
        from fti.cli._compile_notice import announce_compilation
        from fti.cli._emulator_run import print_notice
        from fti.cli._progress import show_progress
        from fti.hil.emulator import make_environment
        from fti.post.offline_run import fly

        scenario = scenarios.load(file)
        folder, step = out if len(names) == 1 else out / file.stem, f"flying {file.stem}"
        with announce_compilation(), show_progress(step) as show:
            setup = scenarios.load_config(scenario, config)
            world = make_environment(scenario, show)
            for remark in world.remarks:
                print_notice(f"warning: {remark}")
            flown = fly(setup, scenario, folder, world=world, progress=lambda share: show(step, share))
        recording = open_(flown)
        return _score_session(recording, scenario, recording.truth_files, other_setup(str(config)) if config else None)

    files = [scenarios.find(name) for name in names]
    return [Job(file.stem, partial(score, file)) for file in files]


def session_jobs(
    names: Sequence[str], recordings: Sequence[Recording], truth: Path | None, setup: Setup | None
) -> list[Job]:
    """Score each flight of each session by the scenario that its truth names.

    names : candidates; none: every shipped scenario
    Raises MissingError where a scenario has no session, ConfigError where a session is of none of the scenarios.
    """
    from fti.hil import scenario as scenarios

    named = {name: scenarios.load(scenarios.find(name)) for name in names or scenarios.shipped_names()}
    if len(named) == len(recordings) == 1:
        (name, scenario), (recording,) = *named.items(), recordings
        return [Job(name, lambda: _score_session(recording, scenario, _truths(recording, truth), setup))]
    jobs, missing = list[Job](), set(names)
    for recording in recordings:
        for job, scenario_names in _match_flights(recording, named, truth, setup):
            missing -= scenario_names
            jobs.append(job)
    unknown = any(job.name not in named for job in jobs)  # may belong to any scenario
    if missing and not unknown:
        raise MissingError(f"{next(name for name in names if name in missing)}: no session belongs to this scenario")
    return sorted(jobs, key=lambda job: names.index(job.name) if job.name in names else len(names))


def _match_flights(
    recording: Recording, named: dict[str, Scenario], truth: Path | None, setup: Setup | None
) -> Iterator[tuple[Job, set[str]]]:
    """The flights of a session, each with its scenarios."""
    from fti.errors import ConfigError
    from fti.post.score.truth_reader import find_scenarios

    try:
        flights = [(file, find_scenarios(file, named.values())) for file in _truths(recording, truth)]
    except ConfigError:
        raise
    except FtiError as error:
        failure = error

        def fail() -> list[Score]:
            raise failure

        yield Job(str(recording.path), fail), set()
        return
    for file, scenarios in flights:
        for name, scenario in named.items():
            if any(scenario is one for one in scenarios):
                yield Job(name, partial(_score_session, recording, scenario, [file], setup)), {name}


def _truths(recording: Recording, setup: Path | None) -> list[Path]:
    from fti.post.score.truth_reader import find_truths

    return find_truths(recording, setup)


def _score_session(
    recording: Recording, scenario: Scenario, truths: Sequence[Path], setup: Setup | None
) -> list[Score]:
    from fti.cli._read_report import show_read_progress
    from fti.post.score.session_score import score_session

    return list(score_session(recording, scenario, truths, setup, lambda: show_read_progress(recording, "score")))
