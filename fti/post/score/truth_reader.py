"""Reads the truth file of the emulator: begin of the flight, ground truth, times at which the bench was late."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from fti.constants import SECOND_NS
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

#: A longer lateness is a pause of the bench, in which flags may be missing [s].
PAUSE_S = 0.15
#: Titles of scenarios in an error.
MAX_TITLES = 3
#: Rounding of the times of an accelerated flight [ns].
ROUNDING_NS = 1000


@dataclass(frozen=True, slots=True)
class FlightPause:
    """Interval from from_s until until_s [s of the flight] in which the bench, or the unit, was late."""

    from_s: float
    until_s: float


class SentOnLink(NamedTuple):
    """Messages and bytes that the emulator sent on one link."""

    messages: int
    bytes: int


@dataclass(frozen=True, slots=True)
class FlightTruth:
    """One flight.

    begin_ns  : FTI time of its begin
    table     : its rows, read once: the truth file of a flight in progress grows
    pauses    : in which the emulator was late, in order; an accelerated flight has none
    real_time : flown over ports in real time; else accelerated
    sent      : messages and bytes that the emulator sent on each link; empty in older files
    complete  : the truth has all its rows and the end of the flight
    attached  : the configuration of the emulator, and the files that it names; empty in older files
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


def find_truths(recording: Recording, file: Path | None) -> list[Path]:
    """The truth files of a session, one per flight, or ``file`` if given.  Raises MissingError."""
    if file is not None:
        return [file]
    if not recording.truth_files:
        raise MissingError(
            f"{recording.path}: contains no truth file; give that of `fti hil SCENARIO --truth FILE` with --truth FILE"
        )
    return recording.truth_files


def read_flight_truth(file: Path, scenario: Scenario) -> FlightTruth:
    """A flight of a scenario.  Raises MissingError where it has no rows, ConfigError where it is another scenario."""
    source = McapFile(file)
    head = source.head()
    if other := differing_keys(scenario, _read_scenario(file, head)):
        not_of = f"of the present version of {scenario.title!r}: they differ in {', '.join(other)}"
        raise _wrong_scenario(file, head, not_of)
    items = list(source.items())
    rows = [item for item in items if item.topic.name == TOPIC]
    if not rows:
        raise MissingError(f"{file}: contains no {TOPIC}: the flight did not begin")
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
    """Number of rows that the emulator wrote (-1 without an end), and sent messages.  Raises RecordingError."""
    for item in items:
        if item.topic.name == END_TOPIC:
            with using_message(item.topic.name, item.log_time):
                end = parse_table(item.data)
                sent = {name: SentOnLink(int(of["messages"]), int(of["bytes"])) for name, of in end["sent"].items()}
                return int(end["rows"]), sent
    return -1, {}


def _is_real_time(stated: str | None, rows: list[McapMessage]) -> bool:
    """As stated in the truth file; in an older one, whether rows are late, which they never are if accelerated."""
    if stated is not None:
        return stated == "true"
    return any(abs(item.publish_time - item.log_time) > ROUNDING_NS for item in rows)


def find_scenarios(file: Path, scenarios: Iterable[Scenario]) -> list[Scenario]:
    """The scenarios to which a truth file belongs.

    Raises ConfigError where it belongs to none of them, MissingError or RecordingError where it names no scenario.
    """
    named = list(scenarios)
    head = McapFile(file).head()
    truth_scenario = _read_scenario(file, head)
    matches = [scenario for scenario in named if not differing_keys(scenario, truth_scenario)]
    if not matches:
        titles = ", ".join(repr(scenario.title) for scenario in named[:MAX_TITLES])
        more = ", ..." if len(named) > MAX_TITLES else ""
        raise _wrong_scenario(
            file,
            head,
            f"of the present version of any scenario: {titles}{more}; name the file of its scenario: "
            "fti score SCENARIO.toml SESSION",
        )
    return matches


def _read_scenario(file: Path, head: Head) -> dict[str, object]:
    data = head.attachments.get(SCENARIO_ATTACHMENT)
    if data is None:
        raise MissingError(f"{file}: is not a truth file of the emulator: it names no scenario")
    try:
        return parse_table(data)
    except ValueError as error:
        raise RecordingError(f"{file}: {SCENARIO_ATTACHMENT}: cannot be read: {error}") from None


def differing_keys(scenario: Scenario, truth_scenario: Mapping[str, object]) -> list[str]:
    """The keys in which a scenario differs from that of a truth file."""
    keys: dict[str, object] = json.loads(scenario.flight_key)
    return [key for key in keys if truth_scenario.get(key) != keys[key]]


def _wrong_scenario(file: Path, head: Head, not_of: str) -> ConfigError:
    own = _read_scenario(file, head)
    return ConfigError(f"{file}: is the truth of {own.get('title')!r}, seed {own.get('seed')}, and not {not_of}")


def _intercept_m() -> float:
    """Distance from the threshold to the intercept point of the glide path [m]."""
    airfield = load_airfield(DEMO_AIRFIELD.read_text(encoding="utf-8"), str(DEMO_AIRFIELD))
    return float(ApproachPath(airfield).x_gpi)


def _pauses(late: list[McapMessage], begin_ns: int) -> Iterator[FlightPause]:
    """Intervals between log and publish time in which the bench was late: with a row, or the kernel with a byte."""
    times = (((item.log_time - begin_ns) / SECOND_NS, (item.publish_time - begin_ns) / SECOND_NS) for item in late)
    return merge_pauses(FlightPause(due, done) for due, done in times if done - due > PAUSE_S)


def merge_pauses(pauses: Iterable[FlightPause]) -> Iterator[FlightPause]:
    """The same pauses in order, overlapping ones merged."""
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
    """Part of an interval in these pauses, which do not overlap each other [s]."""
    return sum(max(0.0, min(p.until_s, until_s) - max(p.from_s, from_s)) for p in pauses)


def length_s(pauses: Iterable[FlightPause]) -> float:
    """Total length; overlapping parts count once [s]."""
    return sum(pause.until_s - pause.from_s for pause in merge_pauses(pauses))
