"""The pipeline: interpolation, ages, roles, order; all times are stamps and ticks."""

import itertools
import math
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from fti.config import Config, parse
from fti.messages.measurements import Attitude, Measurement, Position, RadioHeight, Range, Stamp, Velocity
from fti.messages.outputs import Event, HeightAboveGround, NavSolution, Output
from fti.messages.reasons import Reason
from fti.nav.pipeline import Pipeline

MS = 1_000_000
S = 1_000_000_000
T0 = 1_000 * S


def config(**changes: Any) -> Config:
    device = {"link": "l", "driver": "d"}
    table: dict[str, Any] = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [
            {"name": "ins", "max_age_ms": 300.0, **device},
            {"name": "gnss", "max_age_ms": 1500.0, **device},
            {
                "name": "radar",
                "max_age_ms": 200.0,
                "latency_ms": 100.0,
                "lever_arm_b": [0.0, 0.0, 2.0],
                "altimeter": {"kind": "radar", "range_m": [1.0, 700.0], "max_roll_deg": 20.0},
                **device,
            },
            {"name": "laser", "altimeter": {"kind": "laser", "range_m": [1.0, 700.0], "sd_m": 0.1}, **device},
        ],
        "nav": {"attitude": ["ins"], "position": ["ins", "gnss"], "altimeters": ["radar", "laser"]},
    }
    table.update(changes)
    return parse(table, "", Path("t.toml"))


def attitude(t: int, roll: float = 0.0, **changes: Any) -> Attitude:
    return replace(Attitude(stamp=Stamp(t), roll=roll, pitch=0.0, heading=1.0), **changes)


def position(t: int, lat: float = 0.6, **changes: Any) -> Position:
    filled = Position(stamp=Stamp(t), lat=lat, lon=0.1, alt=500.0, horizontal_sd=2.0, vertical_sd=3.0)
    return replace(filled, **changes)


def heights(out: list[Output | Event], sensor: str) -> list[HeightAboveGround]:
    return [o for o in out if isinstance(o, HeightAboveGround) and o.sensor == sensor]


def feed_all(pipeline: Pipeline, *pairs: tuple[str, Measurement]) -> list[Output | Event]:
    return [o for device, m in pairs for o in pipeline.feed(device, m)]


def test_radar_height_is_moved_to_p_and_stamped_back_by_its_latency() -> None:
    pipeline = Pipeline(config(), None)
    pipeline.feed("ins", attitude(T0))
    (height,) = heights(
        pipeline.feed("radar", RadioHeight(stamp=Stamp(T0 + 50 * MS), height_agl=98.0, sd=0.5)), "radar"
    )
    assert height.valid
    assert height.height_agl == pytest.approx(100.0)
    assert height.raw == 98.0
    assert height.t_ns == T0 + 50 * MS
    assert height.t_valid_ns == T0 - 50 * MS
    assert height.nearest_sd == pytest.approx(0.5, abs=1e-3)


def test_laser_is_projected_with_the_roll_at_its_own_time() -> None:
    pipeline = Pipeline(config(), None)
    feed_all(pipeline, ("ins", attitude(T0, 0.0)), ("ins", attitude(T0 + 100 * MS, 0.4)))
    (height,) = heights(pipeline.feed("laser", Range(stamp=Stamp(T0 + 50 * MS), slant_range=100.0)), "laser")
    assert height.height_agl == pytest.approx(100 * math.cos(0.2))


def test_parts_of_an_attitude_are_joined() -> None:
    pipeline = Pipeline(config(), None)
    feed_all(
        pipeline,
        ("ins", Attitude(stamp=Stamp(T0), roll=0.1)),
        ("laser", Range(stamp=Stamp(T0 + 1), slant_range=100.0)),
        ("ins", Attitude(stamp=Stamp(T0 + 5 * MS), pitch=0.2)),
    )
    (height,) = heights(pipeline.feed("laser", Range(stamp=Stamp(T0 + 6 * MS), slant_range=100.0)), "laser")
    assert height.height_agl == pytest.approx(100 * math.cos(0.1) * math.cos(0.2))


def test_each_height_names_its_point_and_the_wheels_have_one_of_their_own() -> None:
    """Antenna 2 m below P, wheels 3 m below and 1 m to the right of it: banked by 5 deg to the right they are lower."""
    nav = {"attitude": ["ins"], "altimeters": ["radar"]}
    bank = math.radians(5.0)
    lowest = 98.0 + 2.0 * math.cos(bank) - (math.sin(bank) + 3.0 * math.cos(bank))
    for wheels, expected in ({}, None), ({"wheels_b": [0.0, 1.0, 3.0]}, lowest):
        pipeline, t = Pipeline(config(nav=nav | wheels), None), T0
        pipeline.feed("ins", attitude(t, roll=bank))
        (height,) = [
            o for o in pipeline.feed("radar", RadioHeight(stamp=Stamp(t), height_agl=98.0))
            if isinstance(o, HeightAboveGround)
        ]  # fmt: skip
        assert (height.raw, height.point) == (98.0, "p")
        assert height.height_agl == pytest.approx(98.0 + 2.0 * math.cos(bank))
        assert height.wheels == (None if expected is None else pytest.approx(expected))


def test_without_attitude_the_height_is_unknown_and_reports_the_reason() -> None:
    pipeline = Pipeline(config(), None)
    (height,) = heights(pipeline.feed("laser", Range(stamp=Stamp(T0), slant_range=100.0)), "laser")
    assert (height.valid, height.height_agl, height.raw) == (False, None, 100.0)
    assert height.reasons == (Reason.NO_ATTITUDE,)


def test_an_invalid_part_takes_the_attitude_away() -> None:
    pipeline = Pipeline(config(), None)
    feed_all(pipeline, ("ins", attitude(T0)), ("ins", Attitude(stamp=Stamp(T0 + 10 * MS), roll=0.0, valid=False)))
    (height,) = heights(pipeline.feed("laser", Range(stamp=Stamp(T0 + 20 * MS), slant_range=100.0)), "laser")
    assert Reason.NO_ATTITUDE in height.reasons


def test_an_altimeter_that_stops_is_invalid_within_max_age_and_a_tick_then_twice_a_second() -> None:
    pipeline = Pipeline(config(), None)
    pipeline.feed("ins", attitude(T0))
    pipeline.feed("radar", RadioHeight(stamp=Stamp(T0), height_agl=98.0))
    outputs = []
    for k in range(1, 200):
        t = T0 + k * 20 * MS
        pipeline.feed("ins", attitude(t))
        outputs += heights(pipeline.tick(t), "radar")
    assert outputs[0].t_ns - (T0 - 100 * MS) <= 200 * MS + 20 * MS
    assert {o.reasons for o in outputs} == {(Reason.STALE,)}
    gaps = [b.t_ns - a.t_ns for a, b in itertools.pairwise(outputs)]
    assert set(gaps) == {500 * MS}


def test_an_altimeter_never_received_is_silent() -> None:
    pipeline = Pipeline(config(), None)
    outputs = [h for k in range(60) for h in heights(pipeline.tick(T0 + k * 20 * MS), "laser")]
    assert outputs
    assert outputs[0].reasons[0] is Reason.SILENT
    assert outputs[0].t_ns == T0 + 1020 * MS


def test_samples_return_after_silence() -> None:
    pipeline = Pipeline(config(), None)
    pipeline.feed("ins", attitude(T0))
    pipeline.feed("radar", RadioHeight(stamp=Stamp(T0), height_agl=98.0))
    pipeline.tick(T0 + 2 * S)
    pipeline.feed("ins", attitude(T0 + 2 * S))
    (height,) = heights(pipeline.feed("radar", RadioHeight(stamp=Stamp(T0 + 2 * S), height_agl=98.0)), "radar")
    assert height.valid
    assert not heights(pipeline.tick(T0 + 2 * S + 20 * MS), "radar")


def solution_at(pipeline: Pipeline, t: int) -> NavSolution:
    return next(o for k in (0, 1) for o in pipeline.tick(t + k) if isinstance(o, NavSolution))


def test_position_is_moved_on_with_the_velocity() -> None:
    pipeline = Pipeline(config(), None)
    velocity = Velocity(stamp=Stamp(T0), north=60.0, east=0.0, down=3.0)
    feed_all(pipeline, ("ins", attitude(T0)), ("ins", position(T0)), ("ins", velocity))
    solution = solution_at(pipeline, T0 + 100 * MS)
    assert solution.valid
    assert solution.lat is not None
    assert solution.alt is not None
    assert (solution.lat - 0.6) * 6.37e6 == pytest.approx(6.0, abs=0.05)
    assert solution.alt == pytest.approx(499.7, abs=1e-6)


def test_position_without_velocity_moves_at_the_rate_of_its_positions() -> None:
    pipeline = Pipeline(config(), None)
    for k in range(3):
        feed_all(pipeline, ("gnss", position(T0 + k * 200 * MS, 0.6 + k * 2e-6, alt=500.0 + k)))
    solution = solution_at(pipeline, T0 + 600 * MS)
    assert solution.position_source == "gnss"
    assert solution.lat == pytest.approx(0.6 + 6e-6, abs=1e-9)
    assert solution.alt == pytest.approx(503.0, abs=1e-5)
    assert solution.vel_down == pytest.approx(-5.0)


def test_msl_height_needs_the_undulation_of_the_same_message() -> None:
    pipeline = Pipeline(config(), None)
    pipeline.feed("gnss", position(T0, alt=None, alt_msl=453.0))
    assert Reason.NO_ALTITUDE in solution_at(pipeline, T0).reasons
    pipeline.feed("gnss", position(T0 + S, alt=None, alt_msl=453.0, undulation=47.0))
    solution = solution_at(pipeline, T0 + S)
    assert solution.alt == pytest.approx(500.0)
    assert Reason.NO_ALTITUDE not in solution.reasons


def test_a_change_of_source_is_an_event() -> None:
    pipeline = Pipeline(config(), None)
    feed_all(pipeline, ("ins", position(T0)), ("gnss", position(T0 + S)))
    first = [o for o in pipeline.tick(T0) if isinstance(o, Event)]
    second = [o for o in pipeline.tick(T0 + S) if isinstance(o, Event)]
    third = [o for o in pipeline.tick(T0 + 9 * S) if isinstance(o, Event)]
    assert [e.text for e in first] == ["position: from ins"]
    assert [e.text for e in second] == ["position: from gnss instead of ins"]
    assert [(e.level, e.text) for e in third] == [("warning", "position: no source; gnss went away")]


def test_a_source_that_falls_silent_in_a_gap_is_reported_if_it_stays_silent() -> None:
    pipeline = Pipeline(config(), None)
    feed_all(pipeline, ("ins", position(T0)))
    pipeline.tick(T0)
    pipeline.reset_after_gap()
    gap_end = T0 + 9 * S
    outputs = {
        t: [o.text for o in pipeline.tick(gap_end + t) if isinstance(o, Event)] for t in (0, 299_000_000, 300_000_000)
    }
    assert outputs == {0: [], 299_000_000: [], 300_000_000: ["position: no source; ins went away"]}


def test_stamps_of_two_links_out_of_order_change_nothing() -> None:
    a, b = Pipeline(config(), None), Pipeline(config(), None)
    early, late = attitude(T0, 0.1), attitude(T0 + 10 * MS, 0.2)
    feed_all(a, ("ins", early), ("ins", late))
    feed_all(b, ("ins", late), ("ins", early))
    sample = Range(stamp=Stamp(T0 + 20 * MS), slant_range=100.0)
    assert a.feed("laser", sample) == b.feed("laser", sample)


def test_position_is_that_of_p_not_of_the_antenna() -> None:
    table = config().model_dump()["device"]
    devices = [{k: v for k, v in d.items() if v is not None} for d in table]
    devices[0]["lever_arm_b"] = [0.0, 0.0, -2.0]
    pipeline = Pipeline(config(device=devices), None)
    feed_all(pipeline, ("ins", attitude(T0)), ("ins", position(T0)))
    assert solution_at(pipeline, T0).alt == pytest.approx(498.0)


def test_an_antenna_ahead_is_taken_back_along_the_heading() -> None:
    table = config().model_dump()["device"]
    devices = [{k: v for k, v in d.items() if v is not None} for d in table]
    devices[0]["lever_arm_b"] = [10.0, 0.0, 0.0]
    pipeline = Pipeline(config(device=devices), None)
    feed_all(pipeline, ("ins", attitude(T0, heading=math.radians(60))), ("ins", position(T0)))
    solution = solution_at(pipeline, T0)
    assert solution.lat is not None
    assert solution.lon is not None
    assert (solution.lat - 0.6) * 6.37e6 == pytest.approx(-5.0, abs=0.05)
    assert (solution.lon - 0.1) * 6.38e6 * math.cos(0.6) == pytest.approx(-5 * math.sqrt(3), abs=0.05)


def test_heading_is_interpolated_the_short_way_round() -> None:
    pipeline = Pipeline(config(), None)
    feed_all(pipeline, ("ins", attitude(T0, heading=6.2)), ("ins", attitude(T0 + 100 * MS, heading=0.2)))
    found = [solution_at(pipeline, T0 + at * MS).heading or 0.0 for at in (25, 75)]
    turn = 0.2 + 2 * math.pi - 6.2
    assert found == pytest.approx([6.2 + turn / 4, 6.2 + 0.75 * turn - 2 * math.pi], abs=1e-6)


def test_a_measurement_counts_when_it_was_true_and_not_when_it_came() -> None:
    """By its own t_valid_ns where there is one; else by its arrival and the latency."""
    pipeline = Pipeline(config(), None)
    for valid_ns, expected in ((None, T0 - 100 * MS), (T0 - 70 * MS, T0 - 70 * MS)):
        height = RadioHeight(stamp=Stamp(T0, t_valid_ns=valid_ns), height_agl=1.0)
        found = pipeline.feed("radar", height)
        assert [row.t_valid_ns for row in found if isinstance(row, HeightAboveGround)] == [expected]


def test_devices_without_a_role_are_ignored() -> None:
    assert Pipeline(config(nav={}), None).feed("radar", RadioHeight(stamp=Stamp(T0), height_agl=1.0)) == []
