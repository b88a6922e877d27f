"""Inputs that must never become a valid output: NaN, a frozen position, a second approach, a clock step."""

import math
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from msgspec.structs import replace

from fti.config import Approach, Config, Device, parse
from fti.messages.measurements import Attitude, Measurement, Position, RadioHeight, Stamp, Velocity
from fti.messages.outputs import (
    ClearanceIntegrity,
    Event,
    GlideSlope,
    HeightAboveGround,
    IntegrityState,
    NavSolution,
    Output,
)
from fti.messages.reasons import Reason
from fti.nav.altimetry.altimeter_channel import AltimeterChannel
from fti.nav.integrity.approach import ApproachPath
from fti.nav.integrity.monitor import ClearanceMonitor, ClearanceSample
from fti.nav.integrity.reference import ApproachReference
from fti.nav.navigation import NavState
from fti.nav.pipeline import Pipeline
from fti.nav.source_interpolation import AttitudeState, PositionState

MS = 1_000_000
S = 1_000_000_000
Inputs = list[tuple[int, str, Measurement | None]]
Outputs = list[Output | Event]
Change = Callable[[int, Measurement], Measurement]
Flight = Callable[..., Iterator[ClearanceSample]]
NOT_NUMBERS = (math.nan, math.inf, -math.inf)


def config() -> Config:
    device = {"link": "l", "driver": "d"}
    altimeter = {"kind": "radar", "range_m": [0.5, 762.0], "beam_deg": 40.0}
    table = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [
            {"name": "ins", "max_age_ms": 500.0, **device},
            {"name": "radar", "max_age_ms": 500.0, "altimeter": altimeter, **device},
        ],
        "nav": {
            "attitude": ["ins"],
            "position": ["ins"],
            "altimeters": ["radar"],
            "approach": {"profile": "p.csv", "alert_v_m": 12.0},
        },
    }
    return parse(table, "", Path("t.toml"))


@pytest.fixture
def fly(reference: ApproachReference, path: ApproachPath, flight: Flight) -> Callable[..., Outputs]:
    """An approach through the whole pipeline; ``change(t_ns, measurement)`` is what goes wrong."""

    def run(change: Change = lambda t, m: m, *, begin: float = 2500.0, end: float = 600.0) -> Outputs:
        pipeline = Pipeline(config(), reference)
        out: Outputs = []
        for x in flight(begin=begin, end=end):
            for m in messages(path, x):
                device = "radar" if isinstance(m, RadioHeight) else "ins"
                out += pipeline.feed(device, change(x.t_ns, m))
            out += [o for k in (1, 21) for o in pipeline.tick(x.t_ns + k * MS)]
        return out

    return run


def messages(path: ApproachPath, x: ClearanceSample) -> list[Measurement]:
    stamp = Stamp(x.t_ns)
    lat, lon = (float(v) for v in path.to_geodetic(x.s, x.y))
    course = math.radians(path.airfield.course_deg)
    north, east, down = 60 * math.cos(course), 60 * math.sin(course), 60 * math.tan(path.glide)
    return [
        Attitude(stamp=stamp, roll=0.0, pitch=0.02, heading=course),
        Position(stamp=stamp, lat=lat, lon=lon, alt=x.alt, horizontal_sd=1.0, vertical_sd=1.0),
        Velocity(stamp=stamp, north=north, east=east, down=down, sd=0.05),
        RadioHeight(stamp=stamp, height_agl=x.agl, sd=0.5),
    ]


def integrity(outputs: Outputs, after_ns: int) -> list[ClearanceIntegrity]:
    return [o for o in outputs if isinstance(o, ClearanceIntegrity) and o.t_ns > after_ns]


def valid_needles(outputs: Outputs, after_ns: int) -> list[GlideSlope]:
    return [o for o in outputs if isinstance(o, GlideSlope) and o.valid and o.t_ns > after_ns]


BROKEN = 12 * S  # s is 1840 m


@pytest.mark.parametrize("bad", NOT_NUMBERS)
@pytest.mark.parametrize(
    ("kind", "field"),
    [
        (RadioHeight, "height_agl"),
        (Attitude, "roll"),
        (Attitude, "pitch"),
        (Position, "lat"),
        (Position, "lon"),
        (Position, "alt"),
    ],
)
def test_what_is_not_a_number_is_never_valid(
    fly: Callable[..., Outputs], kind: type[Measurement], field: str, bad: float
) -> None:
    def change(t: int, m: Measurement) -> Measurement:
        return replace(m, **{field: bad}) if isinstance(m, kind) and t >= BROKEN else m

    outputs = fly(change, end=1500.0)
    settled = BROKEN + 600 * MS
    results = integrity(outputs, settled)
    assert results
    assert {o.state for o in results} == {IntegrityState.UNAVAILABLE}
    assert not valid_needles(outputs, settled)
    if kind is RadioHeight:
        assert not any(isinstance(o, HeightAboveGround) and o.valid for o in outputs if o.t_ns > settled)
    else:
        assert not any(isinstance(o, NavSolution) and o.valid for o in outputs if o.t_ns > settled)


@pytest.mark.parametrize("bad", NOT_NUMBERS)
def test_a_velocity_that_is_no_number_does_not_move_the_position(fly: Callable[..., Outputs], bad: float) -> None:
    def change(t: int, m: Measurement) -> Measurement:
        return replace(m, north=bad, down=bad) if isinstance(m, Velocity) and t >= BROKEN else m

    for o in fly(change, end=1500.0):
        if isinstance(o, NavSolution) and o.lat is not None and o.alt is not None:
            assert math.isfinite(o.lat)
            assert math.isfinite(o.alt)


@pytest.mark.parametrize(("lat", "lon"), [(math.radians(214.7), 0.1), (0.8, 7.0)])
def test_a_place_that_is_not_on_earth_is_no_position(fly: Callable[..., Outputs], lat: float, lon: float) -> None:
    def change(t: int, m: Measurement) -> Measurement:
        return replace(m, lat=lat, lon=lon) if isinstance(m, Position) else m

    outputs = fly(change, end=2400.0)
    assert {o.reasons for o in outputs if isinstance(o, NavSolution)} == {(Reason.NO_POSITION,)}


def test_a_position_that_stands_still_is_refused_and_not_valid_for_ever(fly: Callable[..., Outputs]) -> None:
    """Frozen navigation with fresh times: the tests of its source refuse it, and there is no other one."""
    measurements: dict[type, Measurement] = {}

    def change(t: int, m: Measurement) -> Measurement:
        if not isinstance(m, (Position, Velocity)) or t < BROKEN:
            return m
        return replace(measurements.setdefault(type(m), m), stamp=m.stamp)

    outputs = fly(change)
    assert valid_needles(outputs, BROKEN - S)
    results = integrity(outputs, BROKEN + 2700 * MS)
    assert {(o.state, o.reasons) for o in results} == {(IntegrityState.UNAVAILABLE, (Reason.NO_POSITION,))}
    assert not valid_needles(outputs, BROKEN + 2700 * MS)
    assert max(b.t_ns - a.t_ns for a, b in pairwise(results)) <= 560 * MS


@pytest.mark.parametrize("height", [0.0, 65535 * 0.3048])
def test_an_altimeter_at_the_end_of_its_scale_is_refused(fly: Callable[..., Outputs], height: float) -> None:
    def change(t: int, m: Measurement) -> Measurement:
        return replace(m, height_agl=height) if isinstance(m, RadioHeight) and t >= BROKEN else m

    outputs = fly(change, end=1500.0)
    assert {o.state for o in integrity(outputs, BROKEN + 240 * MS)} == {IntegrityState.UNAVAILABLE}
    assert not valid_needles(outputs, BROKEN + 240 * MS)


def after_level_flight(value: float, *, sd: float | None = 0.1, tilt_sd: float | None = 0.003) -> HeightAboveGround:
    """What a laser over unknown ground gives for one sample after 10 s at 300 m and 50 m/s with a roll of 0.2 rad."""
    altimeter = {"kind": "laser", "range_m": (0.5, 500.0)}
    of = AltimeterChannel(Device.model_validate({"name": "laser", "link": "l", "driver": "d", "altimeter": altimeter}))

    def take(k: int, roll_sd: float | None, m: RadioHeight) -> HeightAboveGround:
        position = PositionState(0.8, 0.2, 500.0, 1.0, 1.0, 50.0, 0.0, 0.0, k)
        attitude = AttitudeState(0.2, 0.0, 0.0, roll_sd, roll_sd)
        return of.feed(of.read(m, m.stamp.t_rx_ns), NavState(k, attitude, position, "ins", "ins", "ins"))

    for k in range(100):
        take(k * S // 10, 0.003, RadioHeight(stamp=Stamp(k * S // 10), height_agl=300.0 + 0.01 * (k % 7), sd=0.1))
    return take(10 * S, tilt_sd, RadioHeight(stamp=Stamp(10 * S), height_agl=value, sd=sd))


@pytest.mark.parametrize("value", [1.1e6, 1e12, 1e301, 1e308, -1e308])
def test_a_range_that_no_altimeter_has_is_no_return(value: float) -> None:
    height = after_level_flight(value)
    assert height.reasons == (Reason.NO_RETURN,)
    assert (height.raw, height.height_agl, height.nearest) == (None, None, None)


@pytest.mark.parametrize("sd", [None, 0.0, -3.0, 1e200, 1e308, *NOT_NUMBERS])
@pytest.mark.parametrize("is_of_tilt", [False, True])
def test_a_valid_height_has_a_finite_sigma_whatever_is_stated(sd: float | None, is_of_tilt: bool) -> None:
    height = after_level_flight(300.0, tilt_sd=sd) if is_of_tilt else after_level_flight(300.0, sd=sd)
    assert height.valid
    for value in (height.sd, height.nearest_sd):
        assert value is not None
        assert math.isfinite(value)
        assert value >= (0.09 if is_of_tilt else 0.0)


def test_a_stuck_altimeter_takes_the_needle_away_within_5_s(fly: Callable[..., Outputs]) -> None:
    heights: list[RadioHeight] = []

    def change(t: int, m: Measurement) -> Measurement:
        if not isinstance(m, RadioHeight) or t < BROKEN:
            return m
        heights.append(m)
        return replace(heights[0], stamp=m.stamp)

    outputs = fly(change)
    assert not valid_needles(outputs, BROKEN + 5 * S)
    assert any(o.state is IntegrityState.ALERT for o in integrity(outputs, BROKEN))


def test_a_jump_of_1_km_needs_a_new_window(fly: Callable[..., Outputs], path: ApproachPath) -> None:
    def change(t: int, m: Measurement) -> Measurement:
        if not isinstance(m, Position) or t < BROKEN or m.lat is None or m.lon is None:
            return m
        s, y = path.to_path(m.lat, m.lon)
        lat, lon = path.to_geodetic(float(s) - 1000.0, y)
        return replace(m, lat=float(lat), lon=float(lon))

    outputs = fly(change, end=1400.0)
    assert not valid_needles(outputs, BROKEN + 250 * MS)


def test_a_clock_that_steps_back_gives_no_valid_output(fly: Callable[..., Outputs]) -> None:
    def change(t: int, m: Measurement) -> Measurement:
        return replace(m, stamp=Stamp(m.stamp.t_rx_ns - 3600 * S)) if t >= BROKEN else m

    outputs = fly(change, end=1500.0)
    valid = [o for o in outputs if isinstance(o, ClearanceIntegrity | GlideSlope) and o.valid]
    assert valid
    assert all(0 < o.t_ns <= BROKEN + 600 * MS for o in valid)


def test_duplicated_frames_change_no_result(reference: ApproachReference, path: ApproachPath, flight: Flight) -> None:
    def states_after(times: int) -> list[IntegrityState]:
        pipeline = Pipeline(config(), reference)
        outputs: Outputs = []
        for x in flight(begin=2500.0, end=1500.0):
            for m in messages(path, x):
                for _ in range(times):
                    outputs += pipeline.feed("radar" if isinstance(m, RadioHeight) else "ins", m)
        return [o.state for o in integrity(outputs, 0)]

    assert states_after(1) == states_after(2)


def test_without_a_heading_the_height_is_tested_all_the_same(fly: Callable[..., Outputs]) -> None:
    """Nothing here needs the heading; what is not known is not made up."""
    outputs = fly(lambda t, m: replace(m, heading=None) if isinstance(m, Attitude) else m, end=1500.0)
    assert valid_needles(outputs, BROKEN)
    assert {o.heading for o in outputs if isinstance(o, NavSolution)} == {None}


def test_a_second_try_does_not_inherit_the_window_of_the_first(reference: ApproachReference, flight: Flight) -> None:
    """Away, beyond the limits of use, and back: s grew, although no sample of the way round was used."""
    monitor = ClearanceMonitor(reference, Approach(profile=""))
    for x in flight(begin=2990.0, end=2000.0):
        monitor.step(x)
    for x in flight(begin=2000.0, end=1900.0, y=lambda s: 400.0, start_ns=30 * S):
        monitor.step(x)
    for x in flight(begin=2900.0, end=1990.0, y=lambda s: 400.0, start_ns=60 * S):
        monitor.step(x)
    again = [o for x in flight(begin=1990.0, end=1700.0, start_ns=90 * S) if (o := monitor.step(x))]
    assert {o.state for o in again} == {IntegrityState.ACQUIRE}


def test_a_second_try_without_an_altimeter_in_between_begins_anew(
    reference: ApproachReference, path: ApproachPath, flight: Flight
) -> None:
    """The same with an altimeter out of range on the go-around: only the position shows that s grew."""
    pipeline = Pipeline(config(), reference)
    legs = [
        (flight(begin=2990.0, end=2000.0), True),
        (flight(begin=2000.0, end=1900.0, start_ns=30 * S), False),
        (flight(begin=2900.0, end=1990.0, start_ns=60 * S), False),
        (flight(begin=1990.0, end=1700.0, start_ns=90 * S), True),
    ]
    outputs: Outputs = []
    for leg, is_received in legs:
        for x in leg:
            for m in messages(path, x):
                is_height = isinstance(m, RadioHeight)
                sent = replace(m, valid=False) if isinstance(m, RadioHeight) and not is_received else m
                outputs += pipeline.feed("radar" if is_height else "ins", sent)
    again = integrity(outputs, 90 * S)
    assert {o.state for o in again} == {IntegrityState.ACQUIRE}
