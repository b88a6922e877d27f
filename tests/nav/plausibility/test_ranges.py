"""Pseudoranges against the stated position: on a real receiver's data, and on a simulated constellation.

``pytest tests/nav/plausibility/test_ranges.py -s`` prints what was measured; with ``--scale full`` of
twenty times as many skies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from fti.drivers import novatel_oem6 as novatel
from fti.messages.measurements import (
    Ephemeris,
    Measurement,
    Position,
    Pseudorange,
    Pseudoranges,
    Stamp,
    TimeScale,
    Velocity,
)
from fti.messages.outputs import Event, SourceValidity
from fti.messages.reasons import Reason
from fti.nav.pipeline import Pipeline
from fti.nav.plausibility.range_solution import MeasuredRange, RangeSolution, solve_ranges
from fti.nav.plausibility.source import SourceTests
from tests.helpers import ROOT
from tests.nav.plausibility.receiver_runs import make_tests
from tests.nav.plausibility.simulated_ranges import TO_ECEF, TOE, Sky, ephemerides, observe
from tests.nav.receiver_flights import config

S = 1_000_000_000
WEEK_NS = 604_800 * S
R = 6_371_000.0
CAPTURE = ROOT / "tests/captures/novatel_oemv_part1.gps"


def ecef(lat: float, lon: float, alt: float) -> np.ndarray:
    return np.array(TO_ECEF.transform(math.degrees(lon), math.degrees(lat), alt))


def level_distance(pos_e: np.ndarray, lat: float, lon: float, alt: float) -> float:
    """Distance without its part along the vertical [m]."""
    d = pos_e - ecef(lat, lon, alt)
    up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
    return float(np.linalg.norm(d - (d @ up) * up))


def solved(m: Pseudoranges, known: list[Ephemeris]) -> RangeSolution | None:
    by_number = {each.number: each for each in known}
    assert m.stamp.t_dev_ns is not None
    rows = [o for o in m.observations if (o.system, o.signal) == ("gps", "L1C") and o.number in by_number]
    measured = [MeasuredRange(by_number[o.number], o.pseudorange or 0.0, o.pseudorange_sd or 0.0) for o in rows]
    return solve_ranges(m.stamp.t_dev_ns % WEEK_NS / S, measured)


# ------------------------------------------------------------------------------------------------ a real receiver


def capture() -> list[Measurement]:
    """A NovAtel OEMV on the ground: BESTPOS, RANGECMP, RAWEPHEM of nine GPS satellites."""
    return novatel.make_decoder(novatel.Options()).feed(CAPTURE.read_bytes(), S)


def test_ranges_of_a_real_receiver_give_its_own_position() -> None:
    """Within 3 m on the level and 5 m in height, in all 17 epochs; the receiver uses GLONASS and smooths."""
    measurements = capture()
    known = [m for m in measurements if isinstance(m, Ephemeris)]
    stated = {m.stamp.t_dev_ns: m for m in measurements if isinstance(m, Position) and m.valid}
    sizes = []
    for m in measurements:
        if isinstance(m, Pseudoranges):
            solution, fix = solved(m, known), stated[m.stamp.t_dev_ns]
            assert solution is not None
            assert fix.lat is not None
            assert fix.lon is not None
            assert fix.alt is not None
            assert (solution.used, [each.left_out for each in solution.explanations]) == (9, [None])
            sizes.append(level_distance(solution.explanations[0].pos_e, fix.lat, fix.lon, fix.alt))
            assert np.linalg.norm(solution.explanations[0].pos_e - ecef(fix.lat, fix.lon, fix.alt)) < 5.0
    assert len(sizes) == 17
    assert max(sizes) < 3.0
    print(f"\nreal receiver: position by ranges {max(sizes):.1f} m from the stated one at most, of 17 epochs")


@pytest.mark.parametrize("number", [3, 13, 19])
def test_a_wrong_range_of_a_real_receiver_is_identified(number: int) -> None:
    """300 m on one of nine; the position without it is the receiver's own within 10 m."""
    measurements = capture()
    epoch = next(m for m in measurements if isinstance(m, Pseudoranges))
    fix = next(m for m in measurements if isinstance(m, Position) and m.valid)
    solution = solved(changed(epoch, number, 300.0), [m for m in measurements if isinstance(m, Ephemeris)])
    assert solution is not None
    assert solution.ratio > 1.0
    assert solution.explanations[0].left_out == number
    assert fix.lat is not None
    assert fix.lon is not None
    assert fix.alt is not None
    assert level_distance(solution.explanations[0].pos_e, fix.lat, fix.lon, fix.alt) < 10.0


def changed(m: Pseudoranges, number: int, metres: float) -> Pseudoranges:
    """One GPS range is longer."""
    return structs.replace(m, observations=tuple(
        structs.replace(o, pseudorange=(o.pseudorange or 0.0) + metres)
        if (o.system, o.number) == ("gps", number)
        else o
        for o in m.observations
    ))  # fmt: skip


# -------------------------------------------------------------------------------------------------- one epoch of a sky


def skies(count: int, seed: int) -> Iterator[tuple[Sky, np.random.Generator]]:
    """Places from 75 deg south to 75 deg north, ionospheres of a night and of a solar maximum."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        lat = math.radians(rng.uniform(-75.0, 75.0))
        is_low = abs(lat) < math.radians(30.0)
        vertical, slope = rng.uniform(1.0, 30.0 if is_low else 15.0), rng.normal(0.0, 5.0 if is_low else 2.0, 2)
        yield Sky(
            lat=lat, lon=rng.uniform(-math.pi, math.pi), alt=rng.uniform(0.0, 12_000.0),
            t=TOE + rng.uniform(-7000.0, 7000.0), iono=(vertical, *slope), clock=rng.uniform(-1e-3, 1e-3),
        ), rng  # fmt: skip


def test_sound_ranges_agree_and_give_the_place(scale: int) -> None:
    """Over the whole earth: no false alarm at a tenth of the limit's room, and within 5.5 sigma of the truth."""
    ratios, errors, sigmas = [], [], []
    for sky, rng in skies(200 * scale, 1):
        solution = solved(observe(sky, rng), ephemerides())
        if solution is None:
            continue
        (position,) = solution.explanations
        ratios.append(solution.ratio)
        errors.append(level_distance(position.pos_e, sky.lat, sky.lon, sky.alt))
        sigmas.append(position.level_sd)
    assert len(ratios) > 180 * scale
    assert max(ratios) < 0.3
    worst = max(e / s for e, s in zip(errors, sigmas, strict=True))
    assert worst < 3.5
    print(f"\nsound skies: {len(ratios)}, chi squared over its limit at most {max(ratios):.3f}, error at most "
          f"{max(errors):.0f} m and {worst:.1f} sigma, sigma {np.median(sigmas):.0f} m in the median")  # fmt: skip


def test_ranges_without_errors_give_the_place_within_metres() -> None:
    """The inertial frame and the turning one agree: what is left is half of the troposphere's model."""
    for sky, rng in skies(20, 2):
        bare = replace(sky, iono=(0.5, 0.0, 0.0), alt=9000.0)
        solution = solved(observe(bare, rng, slow=np.zeros(25)), ephemerides())
        if solution is not None and solution.explanations[0].level_sd < 15.0:
            assert level_distance(solution.explanations[0].pos_e, sky.lat, sky.lon, 9000.0) < 6.0


def test_one_wrong_range_of_many_is_found_and_named() -> None:
    """By size: how often one satellite in a sky of mid-latitudes is seen, and the right one stands first."""
    named = {}
    for metres in (60.0, 120.0, 240.0, 480.0):
        detected = right = count = 0
        for sky, rng in skies(40, 3):
            m = observe(replace(sky, lat=math.copysign(0.8, sky.lat), iono=(5.0, 1.0, 1.0)), rng)
            bad = max(m.observations, key=lambda o: -(o.pseudorange or 0.0)).number  # the highest one
            solution = solved(changed(m, bad, metres), ephemerides())
            if solution is None or solution.used < 7:
                continue
            count += 1
            detected += solution.ratio > 1.0
            right += bool(solution.explanations) and solution.explanations[0].left_out == bad
        named[metres] = (detected / count, right / count)
    print(f"\none wrong range, seen and named first, by size [m]: {named}")
    assert min(named[480.0]) > 0.95
    assert min(named[120.0]) > 0.5
    assert max(named[60.0]) < 0.2


def test_five_ranges_detect_and_do_not_identify() -> None:
    sky = Sky(lat=0.8, lon=0.2, alt=500.0, t=TOE)
    m = observe(sky, np.random.default_rng(4))
    five = structs.replace(m, observations=tuple(sorted(m.observations, key=lambda o: o.pseudorange or 0.0)[:5]))
    range_solution = solved(changed(five, five.observations[0].number, 5000.0), ephemerides())
    assert range_solution is not None
    assert (range_solution.used, range_solution.explanations) == (5, ())
    assert solved(structs.replace(m, observations=five.observations[:4]), ephemerides()) is None


def test_two_wrong_ranges_have_no_explanation() -> None:
    m = observe(Sky(lat=0.8, lon=0.2, alt=500.0, t=TOE), np.random.default_rng(5))
    first, second = m.observations[0].number, m.observations[2].number
    range_solution = solved(changed(changed(m, first, 900.0), second, -1300.0), ephemerides())
    assert range_solution is not None
    assert range_solution.ratio > 1.0
    assert range_solution.explanations == ()


# ----------------------------------------------------------------------------------------------- flights of a receiver

#: Place, and the radius of the meridian there with the height [m].
START, MERIDIAN = (0.8, 0.2, 500.0), 6_368_800.0
#: Seconds of flight and a measurement: what is sent instead.
Change = Callable[[float, Measurement], Measurement | None]


def flight(
    seconds: int, change: Change, *, with_ephemerides: bool = True, speed: float = 80.0, late_s: float = 0.15
) -> list[Measurement]:
    """North, 1 Hz: velocity, stated position (UTC), then ranges (GPS) of the same instant, which arrive later."""
    rng = np.random.default_rng(6)
    slow, drift = rng.standard_normal(25), rng.standard_normal(25)
    out: list[Measurement] = [*ephemerides(S)] if with_ephemerides else []
    for k in range(seconds):
        t_ns = (k + 1) * S
        sky = Sky(START[0] + speed * k / MERIDIAN, START[1], START[2], TOE + k, (8.0, 1.0, 1.0))
        utc_ns = 2200 * WEEK_NS + round(sky.t) * S + 315_964_800 * S - 18 * S
        stamp = Stamp(t_ns, utc_ns, TimeScale.UTC)
        out.append(Velocity(stamp=stamp, north=speed, east=0.0, down=0.0, sd=0.1))
        error = rng.normal(0.0, 0.5, 2) / R
        out.append(Position(
            stamp=stamp, lat=sky.lat + error[0], lon=sky.lon + error[1], alt=START[2], horizontal_sd=1.5,
            vertical_sd=2.5,
        ))  # fmt: skip
        out.append(observe(sky, rng, slow + drift * k / 300.0, t_ns + round(late_s * S)))
    return [found for m in out if (found := change((m.stamp.t_rx_ns - S) / S, m)) is not None]


def run(measurements: list[Measurement], tests: SourceTests | None = None) -> list[tuple[float, str]]:
    """Events of a flight, with their seconds of flight."""
    tests = make_tests() if tests is None else tests
    events: list[tuple[float, Event]] = []
    for m in measurements:
        t_ns, found = m.stamp.t_rx_ns, list[Event]()
        if isinstance(m, Position):
            _, found = tests.feed_position(m, t_ns)
        elif isinstance(m, Velocity):
            _, found = tests.feed_velocity(m, t_ns)
        elif isinstance(m, (Pseudoranges, Ephemeris)):
            tests.feed_ranges(m, t_ns)
        events += [((t_ns - S) / S, event) for event in found]
    return [(t, event.text) for t, event in events]


def moved(metres: float, from_s: float, to_s: float = math.inf) -> Change:
    """The stated position is so far east of where the receiver is, from before its first fix for 0."""

    def change(t: float, m: Measurement) -> Measurement:
        if isinstance(m, Position) and from_s <= t < to_s:
            assert m.lat is not None
            assert m.lon is not None
            return structs.replace(m, lon=m.lon + metres / (R * math.cos(m.lat)))
        return m

    return change


def of_ranges(change: Callable[[float, Pseudoranges], Pseudoranges]) -> Change:
    return lambda t, m: change(t, m) if isinstance(m, Pseudoranges) else m


def numbers_in(m: Pseudoranges) -> list[int]:
    """Nearest first."""
    return [o.number for o in sorted(m.observations, key=lambda o: o.pseudorange or 0.0)]


def test_a_sound_receiver_is_not_refused() -> None:
    assert run(flight(120, lambda t, m: m)) == []


def test_ranges_that_arrive_late_are_compared_with_the_fix_of_their_time() -> None:
    """0.4 s at 250 m/s are 100 m; the receiver's own times say that it is the same instant."""
    assert run(flight(60, lambda t, m: m, speed=250.0, late_s=0.4)) == []


@pytest.mark.parametrize("metres", [0.0, 100.0])
def test_a_real_receiver_is_refused_when_it_states_another_place(metres: float) -> None:
    """17 s of the capture, by its own times; seven ephemerides come after 7 s."""
    tests, texts, t_ns = make_tests(), list[str](), 0
    for m in capture():
        t_ns = t_ns if m.stamp.t_dev_ns is None else m.stamp.t_dev_ns - 945_212_800 * S
        if isinstance(m, (Pseudoranges, Ephemeris)):
            tests.feed_ranges(m, t_ns)
        elif isinstance(m, Position) and m.valid:
            fix = moved(metres, 0.0)(0.0, structs.replace(m, stamp=structs.replace(m.stamp, t_rx_ns=t_ns)))
            assert isinstance(fix, Position)
            texts += [event.text for event in tests.feed_position(fix, t_ns)[1]]
    results = [text for text in texts if "ranges_contradict: 7 pseudoranges give a position 1" in text]
    assert len(results) == len(texts) == (1 if metres else 0)


def test_a_position_that_was_wrong_from_the_start_is_refused() -> None:
    """150 m off before the first fix, and consistent with its velocity: nothing else of one source sees it."""
    wrong = moved(150.0, 0.0)
    assert run(flight(60, wrong, with_ephemerides=False)) == []
    ((t, text),) = run(flight(60, wrong))
    assert 5.0 <= t <= 7.0
    assert text.startswith("position refused: ranges_contradict: ")
    assert "pseudoranges give a position 15" in text  # 150 m and the error of the solution
    assert "valid after 30 s and 30 fixes in which all tests pass" in text


def two_wrong(m: Pseudoranges) -> Pseudoranges:
    numbers = numbers_in(m)
    return changed(changed(m, numbers[0], 900.0), numbers[2], -1300.0)


def test_it_is_valid_again_after_30_s_of_agreement() -> None:
    """Two ranges are wrong from 20 to 40 s."""
    tests = make_tests()
    events = run(flight(90, of_ranges(lambda t, m: two_wrong(m) if 20.0 < t < 40.0 else m)), tests)
    assert [text.partition(":")[0] for _, text in events] == ["position refused", "position valid again"]
    assert 70.0 <= events[1][0] <= 73.0
    assert tests.position.is_valid


def test_one_range_that_the_receiver_does_not_follow_refuses_nothing() -> None:
    """400 m on the nearest satellite; the stated position is right."""
    wrong = of_ranges(lambda t, m: changed(m, numbers_in(m)[0], 400.0) if t > 20.0 else m)
    assert run(flight(60, wrong)) == []


def test_a_receiver_that_follows_a_wrong_range_is_refused() -> None:
    """400 m on the nearest satellite; the stated position goes 150 m east over 30 s, and its velocity goes with it."""
    bad = of_ranges(lambda t, m: changed(m, numbers_in(m)[0], 400.0) if t > 20.0 else m)

    def change(t: float, m: Measurement) -> Measurement | None:
        if isinstance(m, Velocity) and 20.0 < t <= 50.0:
            return structs.replace(m, east=5.0)
        if isinstance(m, Position) and t > 20.0:
            return moved(min(t - 20.0, 30.0) * 5.0, 0.0)(t, m)
        return bad(t, m)

    events = run(flight(70, change))
    assert events[0][1].startswith("position refused: ranges_contradict: ")
    assert "without satellite" in events[0][1]
    assert events[0][0] < 50.0


def test_ranges_that_disagree_without_a_culprit_refuse() -> None:
    ((t, text),) = run(flight(40, of_ranges(lambda t, m: two_wrong(m) if t > 20.0 else m)))
    assert 24.0 <= t <= 27.0
    assert text.startswith("position refused: ranges_disagree: residuals of ")
    assert "which one is wrong is unknown" in text


def test_a_disagreement_of_four_seconds_refuses_nothing() -> None:
    assert run(flight(40, of_ranges(lambda t, m: two_wrong(m) if 20.0 < t < 24.0 else m))) == []


def test_without_ranges_a_finding_stays_until_the_operator_ends_it() -> None:
    wrong = moved(150.0, 0.0)
    tests = make_tests()
    run(flight(90, lambda t, m: None if isinstance(m, Pseudoranges) and t > 15.0 else wrong(t, m)), tests)
    assert not tests.position.is_valid
    (event,) = tests.readmit(91 * S)
    assert event.text == "findings of its pseudoranges are dismissed"
    assert "nothing to readmit" in tests.readmit(92 * S)[0].text


def unusable(m: Measurement) -> Measurement:
    """Weak signals."""
    if not isinstance(m, Pseudoranges):
        return m
    return structs.replace(m, observations=tuple(structs.replace(o, cn0_dbhz=25.0) for o in m.observations))


@pytest.mark.parametrize(
    "change",
    [
        lambda m: structs.replace(m, healthy=False) if isinstance(m, Ephemeris) else m,
        lambda m: structs.replace(m, accuracy=None) if isinstance(m, Ephemeris) else m,
        lambda m: structs.replace(m, toe=TOE - 7300.0) if isinstance(m, Ephemeris) else m,
        lambda m: structs.replace(m, sqrt_a=0.0) if isinstance(m, Ephemeris) else m,
        lambda m: structs.replace(m, system="galileo") if isinstance(m, Ephemeris) else m,
        lambda m: structs.replace(m, stamp=Stamp(m.stamp.t_rx_ns)) if isinstance(m, Pseudoranges) else m,
        unusable,
    ],
    ids=["ill", "no accuracy", "old", "no orbit", "other system", "no time", "weak"],
)
def test_unusable_ranges_give_no_result(change: Callable[[Measurement], Measurement]) -> None:
    """The stated position is 150 m off; with these nobody knows."""
    assert run([change(m) for m in flight(30, moved(150.0, 0.0))]) == []


@pytest.mark.parametrize("value", [math.nan, math.inf, -1e9, 0.0, 1e300])
def test_nonsense_in_the_ranges_breaks_nothing(value: float) -> None:
    def change(t: float, m: Pseudoranges) -> Pseudoranges:
        return structs.replace(m, observations=tuple(structs.replace(o, pseudorange=value) for o in m.observations))

    run(flight(8, of_ranges(change)))


def test_ranges_reach_the_test_through_the_pipeline() -> None:
    pipeline = Pipeline(config(("gnss",), baro=False), None)
    validities = []
    for m in flight(12, moved(150.0, 0.0)):
        out = pipeline.feed("gnss", m) + pipeline.tick(m.stamp.t_rx_ns)
        validities += [each for each in out if isinstance(each, SourceValidity)]
    assert validities[-1].reasons == (Reason.RANGES_CONTRADICT,)
    assert validities[-1].position_valid is False
    assert all(each.valid for each in validities_without_ephemerides())


def validities_without_ephemerides() -> list[SourceValidity]:
    """The same flight of a receiver that gives no ephemerides."""
    pipeline = Pipeline(config(("gnss",), baro=False), None)
    out = [each for m in flight(12, moved(150.0, 0.0), with_ephemerides=False)
           for each in pipeline.feed("gnss", m) + pipeline.tick(m.stamp.t_rx_ns)]  # fmt: skip
    return [each for each in out if isinstance(each, SourceValidity)]


def test_a_signal_of_another_band_is_not_a_range_of_l1() -> None:
    """Second frequencies come beside the first, from the same satellite."""

    def change(t: float, m: Pseudoranges) -> Pseudoranges:
        other: list[Pseudorange] = [structs.replace(o, signal="L2W", pseudorange=1.0) for o in m.observations]
        return structs.replace(m, observations=(*m.observations, *other))

    assert run(flight(20, of_ranges(change))) == []
