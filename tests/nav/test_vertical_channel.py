"""The live vertical channel: closed forms, late measurements, outages, and inputs that must not become a height."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from fti.geodesy.formulas import down_row
from fti.geodesy.gravity import normal_gravity
from fti.messages.reasons import Reason
from fti.nav.vertical.inertial_height import HorizontalMotion, InertialHeight, vertical_acceleration
from fti.nav.vertical.vertical_channel import HeightAiding, VerticalChannel, VerticalSettings, VerticalState

S = 1_000_000_000
LAT = math.radians(48.0)
HERE = HorizontalMotion(LAT, 0.0, 0.0)
ALT, GROUND = 700.0, 450.0
RATE_HZ = 20


def force(
    up: float, roll: float = 0.0, pitch: float = 0.0, alt: float = ALT, place: HorizontalMotion = HERE
) -> tuple[float, float, float]:
    """Specific force for an upward acceleration."""
    none = vertical_acceleration((0.0, 0.0, 0.0), 0.0, 0.0, place, alt)
    x, y, z = (-(up - none) * r for r in down_row(roll, pitch))
    return x, y, z


class Flight:
    """Level flight at ALT, fed step by step."""

    def __init__(self, settings: VerticalSettings | None = None, begin_ns: int = S) -> None:
        self.channel = VerticalChannel(settings)
        self.t_ns = begin_ns
        self.bias = 0.0

    def go(
        self, seconds: float, *, satellites: bool = True, altimeter: float | None = 0.0, late_s: float = 0.0
    ) -> VerticalState:
        for k in range(round(seconds * RATE_HZ)):
            self.t_ns += S // RATE_HZ
            self.channel.feed_imu(self.t_ns, force(self.bias), 0.0, 0.0, HERE)
            then = self.t_ns - round(late_s * S)
            if satellites and k % 10 == 0:
                self.channel.feed_satellites(then, ALT, 3.0, 0.0, 0.1)
            if altimeter is not None and k % 5 == 0:
                self.channel.feed_height(then, ALT - GROUND + altimeter, 0.5, GROUND, 1.0)
        return self.channel.at(self.t_ns)

    def over(self, seconds: float, wrong: float, ground_sd: float) -> VerticalState:
        """Above ground that is wrong by so much, without satellites."""
        for _ in range(round(seconds * RATE_HZ / 4)):
            self.go(4 / RATE_HZ, satellites=False, altimeter=None)
            self.channel.feed_height(self.t_ns, ALT - GROUND, 0.5, GROUND + wrong, ground_sd)
        return self.channel.at(self.t_ns)


def test_who_stands_still_feels_gravity() -> None:
    for lat in (0.0, LAT, math.pi / 2, -math.pi / 2):
        place = HorizontalMotion(lat, 0.0, 0.0)
        still = vertical_acceleration((0.0, 0.0, -float(normal_gravity(lat, ALT))), 0.0, 0.0, place, ALT)
        assert still == pytest.approx(0.0, abs=1e-12)


def test_who_flies_east_is_lighter() -> None:
    """Eoetvoes: 2 omega v cos(lat) + v^2 / R."""
    g = float(normal_gravity(LAT, ALT))
    east = vertical_acceleration((0.0, 0.0, -g), 0.0, 0.0, HorizontalMotion(LAT, 0.0, 60.0), ALT)
    assert east == pytest.approx(2 * 7.292115e-5 * 60 * math.cos(LAT) + 60**2 / 6.39e6, abs=5e-6)


def test_a_bank_is_no_climb() -> None:
    roll, pitch = math.radians(40.0), math.radians(10.0)
    assert vertical_acceleration(force(0.3, roll, pitch), roll, pitch, HERE, ALT) == pytest.approx(0.3, abs=1e-12)


def test_height_is_the_integral() -> None:
    channel = InertialHeight(0, 100.0, 2.0)
    for k in range(1, 101):
        channel.advance(k * S // 100, 3.0 * k / 100)  # grows by 3 m/s^3
    assert channel.climb == pytest.approx(2.0 + 1.5, abs=2e-4)
    assert channel.alt == pytest.approx(100.0 + 2.0 + 0.5, abs=3e-4)
    assert channel.at(S // 2)[0] == pytest.approx(100.0 + 1.0 + 0.5 / 8, abs=3e-4)


def test_level_flight_stays_level() -> None:
    state = Flight().go(60.0)
    assert state.valid and state.aiding is HeightAiding.SATELLITES
    assert state.alt == pytest.approx(ALT, abs=1e-3)
    assert state.climb == pytest.approx(0.0, abs=1e-4)
    assert state.alt_sd is not None and state.alt_sd < 3.0


def test_a_jump_of_what_is_felt_that_nobody_flew_is_in_the_sigma() -> None:
    flight = Flight()
    flight.go(60.0)
    flight.channel.feed_imu(flight.t_ns + S // RATE_HZ, force(100.0), 0.0, 0.0, HERE)
    flight.t_ns += S // RATE_HZ
    for _ in range(20):
        state = flight.go(0.5, satellites=False)
        assert state.alt is not None and state.alt_sd is not None
        assert abs(state.alt - ALT) < 3.0 * state.alt_sd
        assert state.valid


def test_the_altimeter_holds_what_the_channel_alone_loses() -> None:
    flights = {name: Flight() for name in ("held", "alone")}
    for flight in flights.values():
        flight.go(60.0)
        flight.bias = 3e-3  # within what the model believes
    held = flights["held"].go(300.0, satellites=False)
    alone = flights["alone"].go(300.0, satellites=False, altimeter=None)
    assert held.valid and held.aiding is HeightAiding.ALTIMETER
    assert held.alt == pytest.approx(ALT, abs=0.5)
    assert alone.alt is not None and alone.alt_sd is not None and held.alt_sd is not None
    assert alone.alt - ALT > 50.0
    assert abs(alone.alt - ALT) < 3.0 * alone.alt_sd
    assert (alone.valid, alone.reasons, alone.aiding) == (False, (Reason.COASTING,), HeightAiding.NONE)


def test_a_refused_height_of_the_altimeter_is_reported() -> None:
    flight = Flight()
    flight.go(10.0)
    assert not flight.channel.altimeter_refused
    flight.go(1.0, altimeter=30.0)
    assert flight.channel.altimeter_refused
    flight.go(1.0)
    assert not flight.channel.altimeter_refused


def test_a_late_measurement_counts_when_it_was_true() -> None:
    """Climbing at 5 m/s, everything 0.3 s late: taken as of now it would be 1.5 m off."""
    channel, alt, t_ns = VerticalChannel(), ALT, S
    for k in range(60 * RATE_HZ):
        t_ns += S // RATE_HZ
        alt += 5.0 / RATE_HZ
        channel.feed_imu(t_ns, force(0.0, alt=alt), 0.0, 0.0, HERE)
        if k % 5 == 0:
            channel.feed_satellites(t_ns - 3 * S // 10, alt - 1.5, 3.0, 5.0, 0.1)
            channel.feed_height(t_ns - 3 * S // 10, alt - 1.5 - GROUND, 0.5, GROUND, 1.0)
    found = channel.at(t_ns)
    assert found.alt == pytest.approx(alt, abs=0.02)
    assert channel.at(t_ns + S // 10).alt == pytest.approx(alt + 0.5, abs=0.02)


def test_a_late_measurement_counts_for_a_climb_that_is_wrong() -> None:
    """The channel begins level and climbs at 5 m/s: its error 0.3 s ago was 1.5 m less."""
    channel, alt, t_ns = VerticalChannel(), ALT, S
    for k in range(60 * RATE_HZ):
        t_ns += S // RATE_HZ
        alt += 5.0 / RATE_HZ
        channel.feed_imu(t_ns, force(0.0, alt=alt), 0.0, 0.0, HERE)
        if k % 5 == 0:
            channel.feed_height(t_ns - 3 * S // 10, alt - 1.5 - GROUND, 0.5, GROUND, 1.0)
    assert channel.at(t_ns).alt == pytest.approx(alt, abs=0.1)
    assert channel.at(t_ns).climb == pytest.approx(5.0, abs=0.01)


def test_what_is_taken_out_of_the_channel_is_taken_out_of_its_past() -> None:
    channel = InertialHeight(0, 100.0, 0.0)
    for k in range(1, 11):
        channel.advance(k * S // 10, 0.0)
    channel.shift(30.0, 2.0)
    assert channel.at(S) == pytest.approx((70.0, -2.0))
    assert channel.at(S // 2) == pytest.approx((71.0, -2.0))  # half a second before, the error was 1 m less


def test_taking_a_large_error_out_of_the_channel_changes_no_output(monkeypatch: pytest.MonkeyPatch) -> None:
    def state_after() -> VerticalState:
        flight = Flight()
        flight.go(30.0)
        flight.bias = 0.02
        return flight.go(240.0, satellites=False)

    folded = state_after()
    monkeypatch.setattr("fti.nav.vertical.vertical_channel.FOLD_M", math.inf)
    unfolded = state_after()
    assert folded.alt == pytest.approx(unfolded.alt, abs=0.05)
    assert folded.alt_sd == pytest.approx(unfolded.alt_sd, abs=1e-6)


def test_wild_returns_are_refused() -> None:
    flight = Flight()
    calm = flight.go(60.0)
    for _ in range(40):
        flight.channel.feed_height(flight.t_ns, 5.0, 0.5, GROUND, 1.0)
        last = flight.go(0.1, satellites=False)
    assert last.valid and calm.alt is not None
    assert last.alt == pytest.approx(ALT, abs=0.05)


def test_an_altimeter_that_contradicts_satellites_is_refused_for_as_long_as_there_are_any() -> None:
    flight = Flight()
    flight.go(60.0)
    assert flight.go(60.0, altimeter=80.0).alt == pytest.approx(ALT, abs=1.0)


def test_after_satellites_the_refused_altimeter_is_accepted_in_the_end_and_reported_as_uncertain() -> None:
    flight = Flight()
    flight.go(60.0)
    states = [flight.go(0.1, satellites=False, altimeter=80.0) for _ in range(150)]
    opened = [state.reasons for state in states if not state.valid]
    assert opened and set(opened) == {(Reason.REJECTED,)}
    assert states[-1].valid
    assert states[-1].alt == pytest.approx(ALT + 80.0, abs=6.0)


def test_without_satellites_it_begins_with_the_altimeter() -> None:
    flight = Flight()
    state = flight.go(120.0, satellites=False)
    assert state.valid and state.aiding is HeightAiding.ALTIMETER
    assert state.alt == pytest.approx(ALT, abs=0.5)
    assert state.alt_sd is not None
    assert state.alt_sd > 1.0  # the altimeter's slow error stays: nothing else says the height


def test_a_ground_that_is_wrong_for_long_is_not_averaged_away() -> None:
    """A ground error of 15 m from a drift over a slope, sigma 20 m: as white noise it had become 3 m."""
    flight = Flight()
    state = flight.over(100.0, 15.0, 20.0)
    assert state.alt is not None and state.alt_sd is not None
    assert abs(state.alt - ALT) > 10.0  # nothing else says the height
    assert 5.0 < state.alt_sd < 25.0


def test_over_doubtful_ground_the_height_of_before_is_kept() -> None:
    flight = Flight()
    flight.go(60.0)
    for wrong, ground_sd in ((30.0, 20.0), (0.0, 1.0), (-30.0, 20.0), (0.0, 0.0)):
        state = flight.over(5.0, wrong, ground_sd)
        assert state.valid and state.alt is not None and state.alt_sd is not None
        assert not flight.channel.altimeter_refused
        assert abs(state.alt - ALT) < min(3.0 * state.alt_sd, 5.0)


def test_a_changing_ground_sigma_does_not_accumulate() -> None:
    """A slope, a flat, a slope, five times a second, and nothing but the altimeter."""
    flight = Flight()
    flight.over(1.0, 0.0, 20.0)
    for _ in range(100):
        flight.over(1 / 5, 0.0, 1.0)
        state = flight.over(1 / 5, 0.0, 20.0)
    assert state.alt_sd is not None and state.alt_sd < 20.0


def test_a_wild_first_return_is_no_beginning() -> None:
    flight = Flight()
    flight.go(1 / RATE_HZ, satellites=False, altimeter=None)
    flight.channel.feed_height(flight.t_ns, 5.0, 0.5, GROUND, 1.0)
    states = [flight.go(0.1) for _ in range(100)]
    assert states[-1].valid
    assert all(state.alt == pytest.approx(ALT, abs=1.0) for state in states if state.valid)


def test_what_is_missing_is_named() -> None:
    channel = VerticalChannel()
    assert channel.at(S).reasons == (Reason.NO_IMU,)
    channel.feed_imu(S, force(0.0), 0.0, 0.0, HERE)
    assert channel.at(S).reasons == (Reason.ALIGNING,)
    channel.feed_satellites(S, ALT, 3.0, None, None)
    assert channel.at(S).alt == ALT
    assert channel.at(S).reasons == (Reason.ALIGNING,)  # one height is none
    assert channel.at(3 * S).reasons == (Reason.STALE,)


def test_after_a_gap_it_begins_anew() -> None:
    flight = Flight()
    flight.go(30.0)
    flight.t_ns += 2 * S
    assert flight.go(1 / RATE_HZ, satellites=False, altimeter=None).reasons == (Reason.ALIGNING,)
    assert flight.go(5.0).valid


def test_time_that_goes_back_a_little_is_passed_over_and_a_lot_begins_anew() -> None:
    flight = Flight()
    before = flight.go(30.0)
    flight.channel.feed_imu(flight.t_ns - S // 10, force(50.0), 0.0, 0.0, HERE)
    flight.channel.feed_imu(flight.t_ns, force(50.0), 0.0, 0.0, HERE)
    assert flight.channel.at(flight.t_ns) == before
    flight.t_ns -= 20 * S
    assert flight.go(1 / RATE_HZ, satellites=False, altimeter=None).reasons == (Reason.ALIGNING,)
    assert flight.go(5.0).valid


def test_measurements_twice_and_too_late_count_once_and_not_at_all() -> None:
    flight = Flight()
    before = flight.go(30.0)
    for _ in range(20):
        flight.channel.feed_height(flight.t_ns - S // 4, ALT - GROUND, 0.5, GROUND, 1.0)  # was taken already
        flight.channel.feed_height(flight.t_ns - 5 * S, ALT, 0.5, GROUND, 1.0)
        flight.channel.feed_satellites(flight.t_ns + 5 * S, ALT + 50.0, 3.0, None, None)
    assert flight.channel.at(flight.t_ns) == before


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf, 1e300])
def test_what_is_no_number_changes_nothing(wrong: float) -> None:
    flight = Flight()
    before = flight.go(30.0)
    channel, later = flight.channel, flight.t_ns + S // 100
    channel.feed_imu(later, (wrong, 0.0, -9.8), 0.0, 0.0, HERE)
    channel.feed_imu(later, force(0.0), 0.0, 0.0, replace(HERE, east=wrong))
    if not math.isfinite(wrong):  # an angle may be any number
        channel.feed_imu(later, force(0.0), wrong, 0.0, HERE)
        channel.feed_imu(later, force(0.0), 0.0, 0.0, replace(HERE, lat=wrong))
    channel.feed_satellites(later, wrong, 3.0, wrong, wrong)
    channel.feed_height(later, wrong, 0.5, GROUND, 1.0)
    channel.feed_height(later, 100.0, 0.5, wrong, 1.0)
    channel.feed_height(later, 250.0, 0.5, GROUND, wrong)
    assert channel.at(flight.t_ns) == before


def test_attitude_through_ninety_degrees_and_the_poles() -> None:
    for lat in (math.pi / 2, -math.pi / 2, 0.0):
        channel, t_ns, place = VerticalChannel(), S, HorizontalMotion(lat, 30.0, 30.0)
        for k in range(20 * RATE_HZ):
            t_ns += S // RATE_HZ
            roll, pitch = 2.0 * math.pi * k / 500, math.pi / 2 * math.sin(k / 100)
            channel.feed_imu(t_ns, force(0.0, roll, pitch, place=place), roll, pitch, place)
            if k % 10 == 0:
                channel.feed_satellites(t_ns, ALT, 3.0, 0.0, 0.1)
        assert channel.at(t_ns).alt == pytest.approx(ALT, abs=0.01)


NUMBER = st.floats(width=64) | st.floats(-1000.0, 1000.0)
SIGMA = st.none() | NUMBER
STEP_NS = st.integers(-3 * S, 3 * S) | st.integers(0, S // 5)


@given(st.lists(st.tuples(st.integers(0, 2), STEP_NS, NUMBER, NUMBER, SIGMA), min_size=1, max_size=30))
def test_nothing_that_comes_breaks_it(inputs: list[tuple[int, int, float, float, float | None]]) -> None:
    flight = Flight()
    flight.go(1.0)
    channel, t_ns = flight.channel, flight.t_ns
    for what, step_ns, a, b, sd in inputs:
        t_ns += step_ns
        if what == 0:
            channel.feed_imu(t_ns, (a, b, -9.81), a, b, HorizontalMotion(a, b, a))
        elif what == 1:
            channel.feed_satellites(t_ns, a, sd, b, sd)
        else:
            channel.feed_height(t_ns, a, sd, b, 1.0 if sd is None else sd)
        found = channel.at(t_ns)
        numbers = (found.alt, found.alt_sd, found.climb, found.climb_sd)
        assert all(number is not None and math.isfinite(number) for number in numbers) or not found.valid
        assert found.valid == (not found.reasons)
