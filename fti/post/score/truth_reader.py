"""What was flown, by the emulator's truth file: when the flight began, what was true, when the bench was late."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from fti.errors import ConfigError, MissingError, RecordingError
from fti.hil.oracle.roles import TruthSeries
from fti.hil.oracle.truth_columns import truth_of_columns
from fti.hil.scenario import Scenario
from fti.hil.truth_log import END_TOPIC, FLIGHT_METADATA, LATE_TOPIC, REAL_TIME_KEY, SCENARIO_ATTACHMENT, TOPIC
from fti.logger.reading.json_message import parse_table, using_message
from fti.logger.reading.mcap_file import Head, McapFile, McapMessage
from fti.logger.reading.recording import Recording
from fti.nav.integrity.approach import ApproachPath, load_airfield
from fti.post.score.truth_table import TruthTable
from fti.terrain.demo_scene import DEMO_AIRFIELD

SECOND_NS = 1_000_000_000
#: What is late by more is a pause of the bench: what the daemon says then is not its fault [s].
PAUSE_S = 0.15
#: A row of a clock that jumps is off by what it was rounded [ns].
ROUNDING_NS = 1000


@dataclass(frozen=True, slots=True)
class FlightPause:
    """From from_s until until_s [s of the flight] somebody did not do what was due."""

    from_s: float
    until_s: float


class SentOnLink(NamedTuple):
    """What the emulator sent on one link."""

    messages: int
    bytes: int


@dataclass(frozen=True, slots=True)
class FlightTruth:
    """One flight.

    begin_ns  : FTI time at which it began
    table     : its rows, read once: the truth file of a flight in progress grows
    pauses    : in which the emulator was late, in order; an accelerated flight has none
    real_time : it was flown over ports, as long as it lasted; else it was accelerated
    sent      : messages and bytes that the emulator sent on each link; nothing in older files
    complete  : the truth has all its rows, and says that the flight ended
    attached  : the configuration that the emulator played, and the texts that it names; nothing in older files
    """

    file: Path
    begin_ns: int
    table: TruthTable
    truth: TruthSeries
    pauses: tuple[FlightPause, ...]
    real_time: bool = True
    attached: Mapping[str, bytes] = field(default_factory=dict)
    sent: Mapping[str, SentOnLink] = field(default_factory=dict)
    complete: bool = True

    def seconds(self, t_ns: int) -> float:
        """Time of the flight [s]."""
        return (t_ns - self.begin_ns) / SECOND_NS


def find_truths(recording: Recording, given: Path | None) -> list[Path]:
    """The truth files of a session, each a flight, or the one that is given.  Raises MissingError."""
    if given is not None:
        return [given]
    if not recording.truth_files:
        raise MissingError(
            f"{recording.path}: holds no truth, so that nobody knows when its flight began: give the file that "
            "`fti hil SCENARIO --truth FILE` wrote with --truth FILE"
        )
    return recording.truth_files


def read_flight_truth(file: Path, scenario: Scenario) -> FlightTruth:
    """A flight of a scenario.  Raises MissingError where nothing is flown, ConfigError where it is another scenario."""
    source = McapFile(file)
    head = source.head()
    if other := differing_keys(scenario, _read_scenario(file, head)):
        not_of = f"of {scenario.title!r} as the scenario is now: they differ in {', '.join(other)}"
        raise _wrong_scenario(file, head, not_of)
    items = list(source.items())
    rows = [item for item in items if item.topic.name == TOPIC]
    if not rows:
        raise MissingError(f"{file}: has no rows: the flight did not begin")
    table = TruthTable.of_rows(rows)
    truth = truth_of_columns(table.seconds(table.t_ns), table.columns, _intercept_m())
    real_time = _is_real_time(head.metadata.get(FLIGHT_METADATA, {}).get(REAL_TIME_KEY), rows)
    late = [item for item in items if item.topic.name in (TOPIC, LATE_TOPIC)]
    pauses = tuple(_pauses(late, rows[0].log_time)) if real_time else ()
    attached = {name: data for name, data in head.attachments.items() if name != SCENARIO_ATTACHMENT}
    stated, sent = _end(items)
    complete = FLIGHT_METADATA not in head.metadata or stated == len(rows)
    return FlightTruth(file, rows[0].log_time, table, truth, pauses, real_time, attached, sent, complete)


def _end(items: Iterable[McapMessage]) -> tuple[int, dict[str, SentOnLink]]:
    """How many rows the emulator wrote, and what it sent; -1 where the flight has no end.  Raises RecordingError."""
    for item in items:
        if item.topic.name == END_TOPIC:
            with using_message(item.topic.name, item.log_time):
                end = parse_table(item.data)
                sent = {name: SentOnLink(int(of["messages"]), int(of["bytes"])) for name, of in end["sent"].items()}
                return int(end["rows"]), sent
    return -1, {}


def _is_real_time(stated: str | None, rows: list[McapMessage]) -> bool:
    """As the emulator states it; an older truth file does not, but its rows are never late when it was accelerated."""
    if stated is not None:
        return stated == "true"
    return any(abs(item.publish_time - item.log_time) > ROUNDING_NS for item in rows)


def find_scenarios(file: Path, scenarios: Iterable[Scenario]) -> list[Scenario]:
    """Those of which this is the truth.

    Raises ConfigError where it is of none of them, MissingError or RecordingError where it does not say.
    """
    named = list(scenarios)
    head = McapFile(file).head()
    flown = _read_scenario(file, head)
    found = [scenario for scenario in named if not differing_keys(scenario, flown)]
    if not found:
        titles = ", ".join(repr(scenario.title) for scenario in named)
        raise _wrong_scenario(file, head, f"of any of the scenarios as they are now: {titles}")
    return found


def _read_scenario(file: Path, head: Head) -> dict[str, object]:
    told = head.attachments.get(SCENARIO_ATTACHMENT)
    if told is None:
        raise MissingError(f"{file}: is no truth of the emulator: it does not say which scenario was flown")
    try:
        return parse_table(told)
    except ValueError as error:
        raise RecordingError(f"{file}: {SCENARIO_ATTACHMENT}: cannot be read: {error}") from None


def differing_keys(scenario: Scenario, flown: Mapping[str, object]) -> list[str]:
    """In which keys a scenario is not the one that was flown."""
    asked: dict[str, object] = json.loads(scenario.flown)
    return [key for key in asked if flown.get(key) != asked[key]]


def _wrong_scenario(file: Path, head: Head, not_of: str) -> ConfigError:
    flown = _read_scenario(file, head)
    return ConfigError(f"{file}: is the truth of {flown.get('title')!r}, seed {flown.get('seed')}, and not {not_of}")


def _intercept_m() -> float:
    """Where the glide path meets the ground, behind the threshold [m]."""
    airfield = load_airfield(DEMO_AIRFIELD.read_text(encoding="utf-8"), str(DEMO_AIRFIELD))
    return float(ApproachPath(airfield).x_gpi)


def _pauses(late: list[McapMessage], begin_ns: int) -> Iterator[FlightPause]:
    """Log and publish time say from when until when the bench was late: with a row, or the kernel with a byte."""
    times = (((item.log_time - begin_ns) / SECOND_NS, (item.publish_time - begin_ns) / SECOND_NS) for item in late)
    return merge_pauses(FlightPause(due, done) for due, done in times if done - due > PAUSE_S)


def merge_pauses(pauses: Iterable[FlightPause]) -> Iterator[FlightPause]:
    """The same pauses, those that touch as one, in order."""
    last: FlightPause | None = None
    for pause in sorted(pauses, key=lambda pause: pause.from_s):
        if last and pause.from_s <= last.until_s:
            last = FlightPause(last.from_s, max(last.until_s, pause.until_s))
            continue
        if last:
            yield last
        last = pause
    if last:
        yield last


def overlap_s(pauses: Iterable[FlightPause], from_s: float, until_s: float) -> float:
    """So much of an interval is in these pauses, which do not overlap each other [s]."""
    return sum(max(0.0, min(p.until_s, until_s) - max(p.from_s, from_s)) for p in pauses)


def length_s(pauses: Iterable[FlightPause]) -> float:
    """How long they are together; where they overlap, once [s]."""
    return sum(pause.until_s - pause.from_s for pause in merge_pauses(pauses))
