"""What a source may do wrong and what the tests of one source find, with the time to the refusal."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from fti.messages.measurements import Measurement, Position, Stamp, TimeScale, Velocity
from tests.nav.healthy_receivers import Receiver, measure
from tests.nav.plausibility.receiver_runs import (
    ARINC,
    T0,
    UBX1,
    UBX10,
    Change,
    Result,
    make_tests,
    run,
    simulate,
    straight,
)

#: Fault begins [s].
BEGIN = 100.0
METRE = 1.0 / 6_367_000.0


def frozen(begin: float, end: float = math.inf) -> Change:
    """Position and velocity are those of the begin, with fresh time."""
    measurements: dict[type, Measurement] = {}

    def change(t: float, m: Measurement) -> Measurement:
        if not begin <= t < end:
            return m
        return replace(measurements.setdefault(type(m), m), stamp=m.stamp)

    return change


def moved_north(
    metres_at: dict[float, float] | None = None, rate: float = 0.0, end: float = math.inf
) -> Callable[[float, Measurement], Measurement]:
    """Position moved by metres from each time on, or by a rate [m/s] from BEGIN on."""

    def change(t: float, m: Measurement) -> Measurement:
        if not isinstance(m, Position) or m.lat is None:
            return m
        metres = [value for since, value in (metres_at or {}).items() if t >= since][-1:] or [0.0]
        ramp = rate * max(min(t, end) - BEGIN, 0.0)
        return replace(m, lat=m.lat + (metres[0] + ramp) * METRE)

    return change


@pytest.mark.parametrize(("receiver", "within_s"), [(UBX1, 3.5), (UBX10, 2.0), (ARINC, 3.5)])
def test_a_frozen_receiver_is_refused_as_repeated(receiver: Receiver, within_s: float) -> None:
    result = simulate(frozen(BEGIN), receiver=receiver, truth=straight(180))
    assert result.test == "repeated"
    assert result.refused_s is not None
    assert BEGIN <= result.refused_s <= BEGIN + within_s
    assert not any(valid for t, valid, _ in result.valid if t > BEGIN + within_s)


def test_a_receiver_that_was_frozen_comes_back_after_30_s_without_the_operator() -> None:
    result = simulate(frozen(BEGIN, 120.0))
    assert not result.is_valid_at(149.0)
    assert result.is_valid_at(153.0)


def test_what_passes_before_a_gap_does_not_count_behind_it() -> None:
    frozen_for_20_s = frozen(BEGIN, 120.0)

    def change(t: float, m: Measurement) -> Measurement | None:
        return None if 140.0 <= t < 160.0 else frozen_for_20_s(t, m)

    result = simulate(change, truth=straight(240))
    assert not result.is_valid_at(188.0)
    assert result.is_valid_at(193.0)


def test_a_receiver_that_is_frozen_on_the_ground_does_no_harm() -> None:
    assert simulate(frozen(BEGIN), truth=straight(180, 0.0)).events == []


@pytest.mark.parametrize("metres", [30.0, 100.0, -5_800_000.0])
def test_a_step_is_refused_with_its_first_fix(metres: float) -> None:
    result = simulate(moved_north({BEGIN: metres}), receiver=UBX10, truth=straight(180))
    assert result.test == "jump"
    assert result.refused_s == pytest.approx(BEGIN, abs=0.15)
    assert not any(valid for t, valid, _ in result.valid if t > BEGIN + 0.15)


def test_of_a_receiver_of_1_hz_the_first_wrong_fix_is_not_admitted() -> None:
    result = simulate(moved_north({BEGIN: 100.0}), truth=straight(180))
    assert [valid for t, valid, _ in result.valid if t >= BEGIN] == [False] * 80


def test_swapped_coordinates_are_a_step() -> None:
    def change(t: float, m: Measurement) -> Measurement:
        return replace(m, lat=m.lon, lon=m.lat) if isinstance(m, Position) and t >= BEGIN else m

    result = simulate(change)
    assert result.refused_s == pytest.approx(BEGIN, abs=0.1)
    assert not result.is_valid_at(239.0)


def test_a_step_stays_unconfirmed_until_the_operator_readmits_it() -> None:
    alone = simulate(moved_north({BEGIN: 100.0}))
    assert not alone.is_valid_at(239.0)
    device_time_s = [event.text for _, event in alone.events]
    assert any("fti readmit" in text for text in device_time_s)
    readmitted = simulate(moved_north({BEGIN: 100.0}), readmit_s=180.0)
    assert not readmitted.is_valid_at(179.0)
    assert readmitted.is_valid_at(183.0)  # the tests have passed for more than 30 s by then


def test_a_step_while_the_receiver_settles_refuses_for_30_s_and_does_not_stand() -> None:
    result = simulate(moved_north({0.0: 600.0, 5.0: 0.0}), truth=straight(120))
    assert result.refused_s == pytest.approx(5.0, abs=0.1)
    assert not result.is_valid_at(34.0)
    assert result.is_valid_at(38.0)
    late = simulate(moved_north({0.0: 600.0, 15.0: 0.0}), truth=straight(120))
    assert not late.is_valid_at(119.0)


def test_a_step_back_readmits_after_30_s_and_another_step_does_not() -> None:
    back = simulate(moved_north({BEGIN: 100.0, 130.0: 0.0}), truth=straight(240))
    assert not back.is_valid_at(155.0)
    assert back.is_valid_at(165.0)
    other = simulate(moved_north({BEGIN: 100.0, 130.0: 50.0}), truth=straight(240))
    assert not other.is_valid_at(239.0)


@pytest.mark.parametrize(("rate", "within_s"), [(0.5, 60.0), (1.0, 40.0), (3.0, 25.0)])
def test_a_ramp_beside_the_velocity_is_refused_as_drift_and_stays_out(rate: float, within_s: float) -> None:
    for receiver in (UBX1, UBX10):
        result = simulate(moved_north(rate=rate, end=180.0), receiver=receiver, seed=3, truth=straight(300))
        assert result.test == "drift"
        assert result.refused_s is not None
        assert BEGIN < result.refused_s <= BEGIN + within_s
        assert not result.is_valid_at(299.0)


def test_a_ramp_of_position_and_velocity_is_consistent_with_itself_and_passes() -> None:
    """What another source or the filter must find."""

    def change(t: float, m: Measurement) -> Measurement:
        if isinstance(m, Velocity) and m.north is not None and t >= BEGIN:
            return replace(m, north=m.north + 1.0)
        return moved_north(rate=1.0)(t, m)

    assert simulate(change, receiver=UBX10, truth=straight(200)).refused_s is None


def test_a_sigma_that_is_stated_ten_times_too_small_is_scatter_or_a_jump() -> None:
    rng = np.random.default_rng(8)

    def change(t: float, m: Measurement) -> Measurement:
        if not isinstance(m, Position) or m.lat is None or t < BEGIN:
            return m
        return replace(m, lat=m.lat + rng.normal(0.0, 4.0) * METRE, horizontal_sd=0.7)

    result = simulate(change, receiver=UBX1, truth=straight(240))
    assert result.test in {"scatter", "jump"}
    assert result.refused_s is not None
    assert result.refused_s < BEGIN + 70.0


def test_speed_beyond_the_aircraft_is_impossible() -> None:
    def change(t: float, m: Measurement) -> Measurement:
        return replace(m, north=900.0) if isinstance(m, Velocity) and t >= BEGIN else m

    result = simulate(change)
    assert result.test == "impossible"
    assert result.refused_s == pytest.approx(BEGIN, abs=1.1)


def test_speed_beyond_the_aircraft_from_the_first_fix_on_is_impossible() -> None:
    assert simulate(lambda t, m: m, receiver=UBX10, truth=straight(60, 450.0)).test == "impossible"
    assert simulate(lambda t, m: m, receiver=UBX10, truth=straight(60, 390.0)).refused_s is None
    fast = simulate(lambda t, m: m, receiver=UBX10, truth=straight(60, 450.0), limits={"speed_mps": 600.0})
    assert fast.refused_s is None


def undulation(value: float) -> Change:
    """Heights above the sea with a stated undulation; at the place of the flights EGM96 has 45.6 m."""

    def change(t: float, m: Measurement) -> Measurement:
        if not isinstance(m, Position) or m.alt is None:
            return m
        return replace(m, alt=None, alt_msl=m.alt - 45.6, undulation=value)

    return change


def test_an_undulation_of_zero_refuses_the_altitude_and_not_the_place() -> None:
    result = simulate(undulation(0.0), seconds=60)
    assert result.test == "undulation"
    assert result.refused_s == pytest.approx(2.0, abs=0.1)
    assert result.is_valid_at(50.0)
    assert not result.valid[-1][2]
    assert simulate(undulation(45.6), seconds=60).refused_s is None
    assert simulate(undulation(45.6 + 4.0), seconds=60).refused_s is None
    assert simulate(undulation(45.6 - 8.0), seconds=60).test == "undulation"


def device_time(faults: dict[str, float]) -> Callable[[float, Measurement], Measurement]:
    """Messages with a time of the device; ``step``: ahead by seconds from BEGIN on, ``still``, ``back``."""

    def change(t: float, m: Measurement) -> Measurement:
        device_time_s = t + 5000.0
        if t >= BEGIN:
            device_time_s += faults.get("step", 0.0)
            device_time_s = BEGIN + 5000.0 if "still" in faults else device_time_s
            device_time_s = 5000.0 + 2.0 * BEGIN - t if "back" in faults else device_time_s
        late = 0.03 * abs(math.sin(17.0 * t))
        stamp = Stamp(
            m.stamp.t_rx_ns + round(late * 1e9), round(device_time_s * 1e9), TimeScale.BOOT, m.stamp.t_valid_ns
        )
        return replace(m, stamp=stamp)

    return change


@pytest.mark.parametrize(
    ("fault", "within_s"), [({"step": 1.0}, 6.0), ({"step": -1.0}, 6.0), ({"still": 1.0}, 3.5), ({"back": 1.0}, 6.0)]
)
def test_a_wrong_device_time_is_refused_and_comes_back_when_it_is_steady(
    fault: dict[str, float], within_s: float
) -> None:
    result = simulate(device_time(fault), truth=straight(240))
    assert result.test == "device_time"
    assert result.refused_s is not None
    assert BEGIN <= result.refused_s <= BEGIN + within_s
    assert result.is_valid_at(200.0) == ("step" in fault)


def test_the_event_names_test_onset_comparison_and_what_readmits() -> None:
    result = simulate(moved_north({BEGIN: 100.0}), truth=straight(180))
    ((_, event),) = [(t, e) for t, e in result.events if e.level == "warning"]
    assert event.source == "gnss"
    assert event.text.startswith("position refused: jump: north: +")
    for part in ("limit", "since 00:18:20.0 UTC", "valid after", "step back", "fti readmit"):
        assert part in event.text


def test_no_two_events_of_one_refusal() -> None:
    result: Result = simulate(moved_north(rate=3.0), receiver=UBX10, truth=straight(240))
    assert len(result.events) == 1


@pytest.mark.parametrize("lat_deg", [89.5, -90.0])
def test_a_step_to_a_pole_is_a_step(lat_deg: float) -> None:
    """Beyond 89 deg nothing was judged: coordinates that were swapped at 89.5 deg of longitude were valid."""

    def change(t: float, m: Measurement) -> Measurement:
        return replace(m, lat=math.radians(lat_deg)) if isinstance(m, Position) and t >= BEGIN else m

    result = simulate(change)
    assert result.refused_s == pytest.approx(BEGIN, abs=1.0)
    assert not any(valid for t, valid, _ in result.valid if t > BEGIN + 1.0)


def beside_the_pole(seconds: int, speed: float = 300.0, distance: float = 20_000.0) -> list[tuple[int, Measurement]]:
    """A straight flight on the plane that touches the Earth at the north pole, once a second."""
    radius = 6_399_594.0
    rows: list[tuple[int, Measurement]] = []
    for k in range(seconds):
        x, y = speed * (k - seconds / 2.0), distance
        far, t_ns = math.hypot(x, y), T0 + k * 1_000_000_000
        lat, lon = math.pi / 2.0 - far / radius, math.atan2(y, x)
        north, east = -speed * x / far, -speed * y / far
        rows.append((t_ns, Velocity(stamp=Stamp(t_ns), north=north, east=east, down=0.0, sd=0.1)))
        rows.append((t_ns, Position(stamp=Stamp(t_ns), lat=lat, lon=lon, alt=9000.0, horizontal_sd=2.0)))
    return rows


def test_a_flight_past_a_pole_is_sound() -> None:
    """From 88.7 deg on one side to 88.7 deg on the other one: the longitude turns by 165 deg."""
    result = run(beside_the_pole(1000), lambda t, m: m, make_tests())
    assert not result.events, result.events
    assert all(valid for _, valid, _ in result.valid)


@pytest.mark.parametrize(("kind", "field"), [(Position, "horizontal_sd"), (Position, "vertical_sd"), (Velocity, "sd")])
def test_a_sigma_whose_square_is_no_number_refuses_nothing(kind: type[Measurement], field: str) -> None:
    """It raised an OverflowError with each fix."""
    sigma: dict[str, Any] = {field: 1e200}
    result = simulate(lambda t, m: replace(m, **sigma) if isinstance(m, kind) and t >= BEGIN else m)
    assert result.refused_s is None
    assert result.is_valid_at(239.0)


@pytest.mark.parametrize("late_s", [0.0, 0.04])
def test_a_second_fix_of_an_epoch_that_is_elsewhere_is_refused(late_s: float) -> None:
    """Fixes of less than 80 ms after another one were not judged: each second one could be anywhere."""
    tests, wrong = make_tests(), []
    for t_ns, m in straight_measurements(60):
        if isinstance(m, Velocity):
            tests.feed_velocity(m, t_ns)
        elif isinstance(m, Position) and m.lat is not None:
            tests.feed_position(m, t_ns)
            second_ns = t_ns + round(late_s * 1e9)
            offset = 100.0 * METRE if t_ns - T0 >= 30_000_000_000 else 0.0
            admitted, _ = tests.feed_position(replace(m, lat=m.lat + offset), second_ns)
            wrong += [admitted[0].valid] if offset else []
    assert len(wrong) > 200
    assert not any(wrong)


def test_an_epoch_of_two_sound_fixes_is_sound() -> None:
    tests = make_tests()
    for t_ns, m in straight_measurements(120):
        if isinstance(m, Velocity):
            tests.feed_velocity(m, t_ns)
        elif isinstance(m, Position) and m.lat is not None:
            for moved in (0.0, 3.0):  # of two solutions, 3 m apart
                admitted, events = tests.feed_position(replace(m, lat=m.lat + moved * METRE), t_ns)
                assert admitted[0].valid
                assert not events


@pytest.mark.parametrize("metres", [0.0, 100.0])
def test_heights_of_two_kinds_in_turns_are_tested_each_for_itself(metres: float) -> None:
    """MAVLink: GPS_RAW_INT and GLOBAL_POSITION_INT.  Each fix began anew, and a step was valid."""
    fixes = 0

    def change(t: float, m: Measurement) -> Measurement:
        nonlocal fixes
        if not isinstance(m, Position) or m.alt is None:
            return m
        fixes += 1
        alt = m.alt + (metres if t >= BEGIN else 0.0)
        return replace(m, alt=alt) if fixes % 2 else replace(m, alt=None, alt_msl=alt - 46.0)

    result = simulate(change)
    assert result.refused_s == (pytest.approx(BEGIN, abs=2.0) if metres else None)
    assert {valid for t, _, valid in result.valid if t > BEGIN + 2.0} == {metres == 0.0}


def straight_measurements(seconds: int) -> list[tuple[int, Measurement]]:
    return list(measure(np.random.default_rng(1), straight(seconds), UBX10, T0))
