"""A source refused by a navigation process is refused by its successor, too, until the operator readmits it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from fti.logger.reading.recording import Recording
from fti.messages.control import Readmit
from fti.messages.reasons import Reason
from fti.messages.refusals import CarriedRefusal, RefusedPart
from fti.messages.tables import from_table
from fti.service.control_channel import encode
from fti.service.startup import NavigationStartup
from tests.service.slow_navigation import LAT_0, RADIUS, RATE, START_NS, World, north_at, outputs, reprocessed

FAST = 0.1 / RATE
#: The INS lies from 13 s on; the process ends at 15 s; the operator readmits the INS at 50 s [s].
LIE_S, END_S, READMIT_S, DURATION_S = 13.0, 15.0, 50.0, 54.0
SECOND_NS = 10**9


class FlightRun(NamedTuple):
    """A world at its end, and the refusals that its first process sent to the supervisor."""

    world: World
    refusals: tuple[CarriedRefusal, ...]


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FlightRun]:
    """A process that refuses the INS, and another one in its place."""
    commands = [encode(Readmit("ins"))]

    def cost(now: float) -> float:
        if now > READMIT_S and commands:
            world._far.sendall(commands.pop())
        return FAST

    world = World(tmp_path_factory.mktemp("again"), DURATION_S, cost, LIE_S)
    world.finish_at_s = END_S
    world.run()
    world.refusals = refusals = tuple(world.last_refusals())
    world.run()
    world.finish()
    yield FlightRun(world, refusals)


def errors(rows: list[dict[str, Any]], begin_s: float, end_s: float) -> list[float]:
    """Of valid positions in a time [m]."""
    late = [r for r in rows if begin_s <= (r["t_ns"] - START_NS) / SECOND_NS < end_s]
    return [abs((r["lat"] - LAT_0) * RADIUS - north_at(r["t_ns"])) for r in late if r["valid"]]


def test_the_process_reports_what_it_refuses(flight: FlightRun) -> None:
    (refusal,) = flight.refusals
    assert (refusal.source, refusal.part, refusal.reason) == ("ins", RefusedPart.POSITION, Reason.JUMP)
    assert refusal.is_standing
    assert (refusal.onset_ns - START_NS) / SECOND_NS == pytest.approx(LIE_S, abs=0.1)


def test_a_source_that_lies_is_not_valid_in_the_next_process(flight: FlightRun) -> None:
    """Its tests pass for 35 s there: a step of 100 m that lasts agrees with its velocity."""
    rows = flight.world.rows("/nav/nav_solution")
    assert len(errors(rows, 0.0, LIE_S)) > 200
    assert max(errors(rows, LIE_S + 0.1, READMIT_S), default=0.0) < 2.0, "12.5 fixes a second are tested"
    assert not errors(rows, END_S, READMIT_S)
    assert min(errors(rows, READMIT_S + 1.0, DURATION_S)) == pytest.approx(100.0, abs=2.0), "the operator wanted it"


def test_the_next_process_reports_them(flight: FlightRun) -> None:
    validities = [
        r for r in flight.world.rows("/nav/source_validity/ins") if r["t_ns"] > START_NS + (END_S + 1) * SECOND_NS
    ]
    first = validities[0]
    assert (first["valid"], first["reasons"]) == (False, ["jump", "unconfirmed"])
    assert first["readmission"].startswith("fti readmit")
    texts = [row["message"] for row in flight.world.rows("/fti/event") if row["name"] == "ins"]
    assert any("position still refused after navigation was started again: jump" in text for text in texts)


def test_it_is_repeated_by_reprocessing(flight: FlightRun, tmp_path: Path) -> None:
    (gap,) = flight.world.rows("/fti/gap")
    assert [row["source"] for row in gap["refusals"]] == ["ins"]
    again = reprocessed(flight.world, tmp_path / "again")
    flight_again, first = (
        [o for o in outputs(path) if o[1] >= gap["t_ns"]] for path in (again, flight.world.session.path)
    )
    assert len(first) > 1000
    assert flight_again == first
    events = [json.loads(data)["message"] for *_, data in Recording.open(again).messages("/fti/event", kind="derived")]
    assert any("still refused after navigation was started again" in text for text in events)


def test_the_startup_message_of_the_next_process_has_them(flight: FlightRun) -> None:
    """Through JSON, as the supervisor sends it."""
    startup = flight.world.startup()
    assert NavigationStartup.model_validate_json(startup.model_dump_json()).refusals == flight.refusals


@pytest.mark.parametrize("wrong", [{"part": "all"}, {"reason": "no reason"}, {"onset_ns": "now"}, {"onset_ns": None}])
def test_what_is_no_refusal_is_an_error(wrong: dict[str, Any]) -> None:
    row = {"source": "a", "part": "position", "reason": "jump", "onset_ns": 1, "is_standing": True, "size_m": 0.0}
    assert from_table(CarriedRefusal, row).source == "a"
    with pytest.raises(ValueError, match=next(iter(wrong))):
        from_table(CarriedRefusal, {**row, **wrong})
