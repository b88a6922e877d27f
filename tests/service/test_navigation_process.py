"""Navigation slower than its input: it stays in time, reports skipped frames, and is never wrongly valid."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from fti.drivers import freeflight_ra4500
from fti.logger.reading.recording import Recording
from fti.messages.control import Readmit
from fti.service.control_channel import encode
from fti.service.navigation.decode_chain import Chain
from tests.service.slow_navigation import (
    LAT_0,
    RADIUS,
    RATE,
    START_NS,
    World,
    height_at,
    north_at,
    outputs,
    reprocessed,
)

#: Computing time of a frame [s]: twice the limit, and a tenth.
SLOW, FAST = 2 / RATE, 0.1 / RATE
#: Half of the steps of 20 ft in which the altimeter speaks at most here, and a little [m].
HEIGHT_STEP_M = 3.3
#: 0.01 s of flying [m].
NORTH_STEP_M = 0.6


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> FlightRun:
    """A navigation that is always too slow."""
    world = World(tmp_path_factory.mktemp("slow"), 25.0, lambda now: SLOW)
    navigator = world.run()
    return FlightRun(world, navigator._reader.lost_frames, world.finish())


class FlightRun(NamedTuple):
    """A world at its end, what its reader had lost, and the events of navigation."""

    world: World
    lost: int
    events: list[dict[str, Any]]


def test_a_slow_navigation_is_in_time_again_once_it_was_overrun(slow: FlightRun) -> None:
    world = slow.world
    jumped_s = (world.rows("/fti/gap")[0]["t_ns"] - START_NS) / 1e9
    before = [age for t, age, _ in world.ages if t <= jumped_s]
    after = [(age, valid) for t, age, valid in world.ages if t > jumped_s]
    assert max(before) > 2500
    assert max(age for age, _ in after) < 1000
    assert min(age for age, _ in after) < 50
    assert sum(valid for _, valid in after) > 0.6 * len(after)


def test_every_frame_was_seen_or_stands_in_a_gap(slow: FlightRun) -> None:
    missed = _missed(slow.world)
    assert sorted(slow.world.fed + missed) == list(range(slow.world.frames))
    assert slow.lost == len(missed) > 2000
    assert {row["kind"] for row in slow.world.rows("/fti/gap")} == {"ring"}


def test_what_was_skipped_is_reported_at_once_and_then_seldom(slow: FlightRun) -> None:
    gaps = slow.world.gaps()
    assert len(gaps) > 5
    assert [event["level"] for event in slow.events] == ["warning"] * 2  # at once, and in the end
    first, last = (event["text"] for event in slow.events)
    assert f"{len(gaps[0])} frames ({len(gaps[0]) / RATE:.1f} s) were skipped to" in first
    assert f"{sum(map(len, gaps[1:]))} frames (" in last
    assert f"in {len(gaps) - 1} steps" in last


def test_a_gap_is_no_silence_of_the_sources(slow: FlightRun) -> None:
    """Dozens of gaps, each longer than the age limits: the log is not filled with sources that went and came."""
    texts = [event["message"] for event in slow.world.rows("/fti/event") if event["name"] == "nav"]
    assert sorted(texts) == ["attitude: from ins", "position: from ins"]


def test_a_gap_is_repeated_by_reprocessing(slow: FlightRun, tmp_path: Path) -> None:
    live = outputs(slow.world.session.path)
    assert len(live) > 1000
    assert outputs(reprocessed(slow.world, tmp_path / "again")) == live


def test_nothing_wrong_is_valid_across_gaps(slow: FlightRun) -> None:
    """The altimeter has no checksum here: half a frame before a gap and half of one behind it would be a height."""
    _assert_nothing_wrong_is_valid(slow.world)
    clock = slow.world.rows("/fti/device_clock")[-1]["clocks"]["ins_gps"]
    assert (clock["state"], clock["segments"]) == ("good", 1)


def test_without_a_fresh_start_of_decoders_a_wrong_height_would_be_valid(tmp_path: Path) -> None:
    """So the test before this one can fail; the altimeter's own guard against pauses is taken away, too."""
    world = World(tmp_path, 25.0, lambda now: SLOW)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Chain, "reset_after_gap", lambda chain: None)
        patch.setattr(freeflight_ra4500, "FRAME_TIMEOUT_NS", 10**12)
        world.run()
    world.finish()
    with pytest.raises(AssertionError, match="comparison failed"):
        _assert_nothing_wrong_is_valid(world)


@pytest.mark.parametrize(("source", "text"), [("ins", "nothing to readmit"), ("*", "restarts")])
def test_a_readmission_by_the_operator_is_recorded_and_repeated(source: str, text: str, tmp_path: Path) -> None:
    commands = [encode(Readmit(source))]

    def cost(now: float) -> float:
        if now > 2.0 and commands:
            world._far.sendall(commands.pop())
        return FAST

    world = World(tmp_path, 5.0, cost)
    world.run()
    world.finish()
    (note,) = world.rows("/fti/readmission")
    assert note["source"] == source
    (event,) = [event for event in world.rows("/fti/event") if text in event["message"]]
    assert event["name"] == ("nav" if source == "*" else "ins")
    assert 450 <= note["after_seq"] < 600
    again = reprocessed(world, tmp_path / "again")
    assert outputs(again) == outputs(world.session.path)
    (repeated,) = [json.loads(data) for *_, data in Recording.open(again).messages("/fti/readmission", kind="derived")]
    assert repeated == note


def _missed(world: World) -> list[int]:
    return [seq for gap in world.gaps() for seq in gap]


def _assert_nothing_wrong_is_valid(world: World) -> None:
    heights = [row for row in world.rows("/nav/height_above_ground/altimeter") if row["valid"]]
    places = [row for row in world.rows("/nav/nav_solution") if row["valid"]]
    assert len(heights) > 300
    assert len(places) > 100
    for row in heights:
        assert row["height_agl"] == pytest.approx(height_at(row["t_valid_ns"]), abs=HEIGHT_STEP_M)
    for row in places:
        assert (row["lat"] - LAT_0) * RADIUS == pytest.approx(north_at(row["t_ns"]), abs=NORTH_STEP_M)


@pytest.mark.parametrize("stop_s", [0.7, 2.7])
def test_what_the_ring_holds_is_caught_up_with(tmp_path: Path, stop_s: float) -> None:
    """A compilation, a stop of the process: late, but whole."""
    stops = [stop_s]
    world = World(tmp_path, 5.0, lambda now: stops.pop() if now > 1 and stops else FAST)
    navigator = world.run()
    assert world.finish() == []
    assert world.fed == list(range(world.frames))
    assert navigator._reader.lost_frames == 0
    assert max(age for _, age, _ in world.ages) > 1000 * stop_s - 50
    assert world.ages[-1][1] < 50


def test_who_follows_again_is_patient_again(tmp_path: Path) -> None:
    """Overrun for a time; then a stop that the ring can hold costs nothing."""
    stops = [2.5]

    def cost(now: float) -> float:
        return SLOW if now < 8 else stops.pop() if now > 11 and stops else FAST

    world = World(tmp_path, 14.0, cost)
    world.run()
    world.finish()
    gaps = world.gaps()
    assert gaps
    assert world.fed[-1] == world.frames - 1
    assert max(gap.stop for gap in gaps) < 9 * RATE


def test_who_is_started_again_after_an_overrun_goes_on_in_time(tmp_path: Path) -> None:
    """Frames missed by a process and by its successor form one gap, of kind restart."""
    world = World(tmp_path, 10.0, lambda now: FAST)
    world.finish_at_s = 2.0
    world.run()
    done, committed = len(world.fed), world.ring.reader_state().next_seq
    world.sleep(5.0)
    world.run()
    world.finish()
    [row] = world.rows("/fti/gap")
    assert (row["kind"], row["after_seq"], row["before_seq"]) == ("restart", committed - 1, world.fed[done])
    assert world.fed[done:] == list(range(row["before_seq"], world.frames))
    assert world.fed[done] > 6 * RATE
