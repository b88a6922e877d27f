"""Live radio navigation: choice of the height, refusals, and inputs that must not become a position."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef
from fti.messages.reasons import Reason
from fti.nav.radio.altitude_accuracy import AltitudeSource, fix_covariance
from fti.nav.radio.radio_navigator import GeodeticPoint, RadioNavigator, RadioState

S = 1_000_000_000
T = 100 * S
HERE = GeodeticPoint(0.84, 0.2, 1500.0)
GROUND = 600.0
STATIONS = {
    "a": GeodeticPoint(0.843, 0.204, 650.0),
    "b": GeodeticPoint(0.834, 0.206, 900.0),
    "c": GeodeticPoint(0.845, 0.19, 1300.0),
    "d": GeodeticPoint(0.838, 0.191, 620.0),
}
AZIMUTH = np.radians([10.0, 80.0, 150.0, 220.0, 300.0])
ELEVATION = np.radians([70.0, 20.0, 40.0, 15.0, 35.0])


def distance(name: str, here: GeodeticPoint = HERE) -> float:
    return float(np.linalg.norm(ecef_from_geodetic(*STATIONS[name]) - ecef_from_geodetic(*here)))


def feed(
    radio: RadioNavigator, t_ns: int = T, *, fix: bool = True, stations: str = "abcd", height: float | None = 900.0
) -> RadioState:
    if fix:
        radio.feed_satellites(t_ns, AZIMUTH, ELEVATION)
        radio.feed_fix(t_ns, HERE, 3.0, 5.0)
    for name in stations:
        radio.feed_dme(t_ns, name, distance(name))
    if height is not None:
        radio.feed_height(t_ns, height, None, GROUND, 2.0)
    return radio.at(t_ns)


def off(state: RadioState) -> float:
    assert state.lat is not None and state.lon is not None and state.alt is not None
    values = ecef_from_geodetic(state.lat, state.lon, state.alt)
    return float(np.linalg.norm(values - ecef_from_geodetic(*HERE)))


def test_with_satellites_the_ranges_have_the_better_height() -> None:
    state = feed(RadioNavigator(STATIONS))
    cov_n = fix_covariance(AZIMUTH, ELEVATION, 3.0)
    assert cov_n is not None and state.ranges_sd is not None
    assert state.valid and state.source is AltitudeSource.RANGES
    assert state.ranges_sd == pytest.approx(math.sqrt(cov_n[2, 2]), rel=0.01)
    assert state.altimeter_sd == pytest.approx(math.hypot(18.0 / math.sqrt(3.0), 2.0), rel=1e-6)
    assert state.vertical_sd == pytest.approx(state.ranges_sd, rel=1e-6)
    assert off(state) < 1e-2
    assert state.used == ("satellites", "a", "b", "c", "d")


def test_low_above_known_ground_the_altimeter_is_better_than_satellites() -> None:
    radio = RadioNavigator(STATIONS)
    radio.feed_height(T, 20.0, None, HERE.alt - 20.0, 1.0)
    state = feed(radio, height=None)
    assert state.source is AltitudeSource.ALTIMETER
    assert state.vertical_sd is not None and state.altimeter_sd is not None and state.ranges_sd is not None
    assert state.vertical_sd < state.altimeter_sd < state.ranges_sd
    assert "altimeter" in state.used


def test_without_satellites_stations_give_the_place_and_the_altimeter_the_height() -> None:
    radio = RadioNavigator(STATIONS)
    assert feed(radio, fix=False).ranges_sd is None  # amid the stations they say nothing of the height
    state = feed(radio, T + S, fix=False)
    assert state.valid and state.source is AltitudeSource.ALTIMETER
    assert state.ranges_sd is not None and state.ranges_sd > 500.0
    assert state.vertical_sd == pytest.approx(state.altimeter_sd, rel=0.01)
    assert state.horizontal_sd is not None and 100.0 < state.horizontal_sd < 400.0
    assert off(state) < 1.0


def test_two_stations_go_on_from_a_position_and_do_not_begin_with_none() -> None:
    radio = RadioNavigator(STATIONS)
    first = feed(radio, fix=False, stations="ab")
    assert (first.valid, first.reasons) == (False, (Reason.NO_SATELLITES, Reason.GEOMETRY))
    feed(radio, T + S)
    later = feed(radio, T + 5 * S, fix=False, stations="ab")
    assert later.valid
    assert off(later) < 1.0


def test_two_stations_crossed_between_are_no_position_on_the_wrong_side() -> None:
    """60 m/s across the line through both: what is on the other side of it fits as well."""
    between = 0.5 * (ecef_from_geodetic(*STATIONS["a"]) + ecef_from_geodetic(*STATIONS["b"]))
    lat, lon, _ = map(float, geodetic_from_ecef(between))
    radius = 6.38e6
    line = np.array([STATIONS["b"].lat - STATIONS["a"].lat, (STATIONS["b"].lon - STATIONS["a"].lon) * math.cos(lat)])
    across = np.array([-line[1], line[0]]) / np.linalg.norm(line)
    radio = RadioNavigator(STATIONS)
    solved = 0
    for k in range(-300, 300, 2):
        way = 60.0 * k * across / radius
        here = GeodeticPoint(lat + way[0] + 1e-4, lon + way[1] / math.cos(lat), 1500.0)
        if k == -300:
            radio.feed_fix(T + k * S, here, 3.0, 5.0)
            radio.feed_velocity(T + k * S, 60.0 * across[0], 60.0 * across[1], 0.0)
        for name in "ab":
            radio.feed_dme(T + k * S, name, distance(name, here))
        radio.feed_height(T + k * S, 900.0, 1.0, GROUND, 2.0)
        state = radio.at(T + k * S)
        if state.valid and state.lat is not None and state.lon is not None and state.horizontal_sd is not None:
            solved += 1
            off_m = math.hypot(state.lat - here.lat, (state.lon - here.lon) * math.cos(lat)) * radius
            assert off_m < 3.0 * state.horizontal_sd, k
    assert solved > 50


def test_an_old_last_position_does_not_determine_the_side() -> None:
    radio = RadioNavigator(STATIONS)
    feed(radio)
    assert feed(radio, T + 20 * S, fix=False, stations="ab").valid
    assert feed(radio, T + 200 * S, fix=False, stations="ab").reasons == (Reason.NO_SATELLITES, Reason.GEOMETRY)


def test_what_is_old_and_moved_is_less_certain() -> None:
    """A fix of a second ago is not accurate to 3 m with an unknown velocity or after a possible turn."""

    def level_sd(velocity_age_s: float | None) -> float:
        radio = RadioNavigator({})
        radio.feed_fix(T, HERE, 3.0, 5.0)
        if velocity_age_s is not None:
            radio.feed_velocity(T + S - round(velocity_age_s * S), 60.0, 0.0, 0.0)
        value = radio.at(T + S).horizontal_sd
        assert value is not None
        return value

    assert level_sd(0.0) == pytest.approx(3.0, abs=0.01)
    assert level_sd(8.0) == pytest.approx(math.hypot(3.0, 16.2), rel=1e-3)
    assert level_sd(None) == pytest.approx(math.hypot(3.0, 60.0), rel=1e-3)


def test_what_moves_is_moved_on() -> None:
    """100 m/s: ranges of 2 s ago are those of a place 200 m behind."""
    radio = RadioNavigator(STATIONS)
    down = mat_en(HERE.lat, HERE.lon)
    radio.feed_velocity(T, 100.0, 0.0, 0.0)
    for k, name in enumerate("abcd"):
        age_s = 0.5 * (k + 1)
        then_e = ecef_from_geodetic(*HERE) - down[:, 0] * 100.0 * age_s
        radio.feed_dme(T - round(age_s * S), name, float(np.linalg.norm(ecef_from_geodetic(*STATIONS[name]) - then_e)))
    radio.feed_height(T, 900.0, None, GROUND, 2.0)
    assert off(radio.at(T)) < 3.0


def test_a_wrong_range_is_refused_by_name() -> None:
    radio = RadioNavigator(STATIONS)
    radio.feed_dme(T + 1, "c", distance("c") + 5000.0)
    state = feed(radio)
    assert (state.valid, state.refused) == (True, ("c",))
    assert off(state) < 1e-2


def test_a_wrong_fix_is_refused_when_four_stations_and_the_altimeter_say_so() -> None:
    radio = RadioNavigator(STATIONS)
    radio.feed_satellites(T, AZIMUTH, ELEVATION)
    radio.feed_fix(T + 1, GeodeticPoint(HERE.lat + 0.002, HERE.lon, HERE.alt), 3.0, 5.0)
    state = feed(radio, fix=False)
    assert state.refused[-1:] == ("satellites",) or not state.valid
    for k in range(20):  # and does not drag the next ones along
        state = feed(radio, T + (3 + k) * S, fix=False)
    assert state.valid
    assert off(state) < 1.0


def test_an_ambiguous_solution_is_not_valid() -> None:
    radio = RadioNavigator(STATIONS)
    feed(radio)
    radio.feed_dme(T + 5 * S + 1, "a", distance("a") + 9000.0)
    state = feed(radio, T + 5 * S, fix=False, stations="bc")
    assert (state.valid, state.reasons) == (False, (Reason.REJECTED,))


def test_ranges_that_agree_on_another_place_are_refused_for_ten_seconds() -> None:
    """Two wrong ranges of three: nothing is left over, and the place is kilometres off."""
    radio = RadioNavigator(STATIONS)
    assert feed(radio, fix=False, stations="abc").valid
    elsewhere = GeodeticPoint(HERE.lat + 5e3 / 6.37e6, HERE.lon + 3e3 / 6.37e6, HERE.alt)
    found = []
    for second in range(1, 13):
        for name in "abc":
            radio.feed_dme(T + second * S, name, distance(name, elsewhere))
        radio.feed_height(T + second * S, 900.0, None, GROUND, 2.0)
        found.append(radio.at(T + second * S))
    assert [state.valid for state in found] == [False] * 10 + [True] * 2
    assert {state.reasons for state in found[:10]} == {(Reason.REJECTED,)}


def test_what_is_missing_is_named() -> None:
    radio = RadioNavigator(STATIONS)
    assert radio.at(T).reasons == (Reason.NO_SATELLITES, Reason.NO_DME)
    feed(radio)
    assert radio.at(T + 60 * S).reasons == (Reason.NO_SATELLITES, Reason.NO_DME)
    alone = feed(RadioNavigator({}), stations="")
    assert alone.valid and alone.used == ("satellites",)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf, 1e300, -1e4])
def test_what_is_no_measurement_changes_nothing(wrong: float) -> None:
    radio = RadioNavigator(STATIONS)
    before = feed(radio)
    radio.feed_dme(T + 1, "a", wrong)
    radio.feed_dme(T + 1, "nowhere", 5000.0)
    radio.feed_dme(T + 1, "a", None)
    radio.feed_fix(T + 1, GeodeticPoint(wrong, 0.2, 1500.0), 3.0, 5.0)
    if wrong != -1e4:  # which is no range, and a height and a speed that can be
        radio.feed_velocity(T + 1, wrong, 0.0, 0.0)
        radio.feed_height(T + 1, wrong, None, GROUND, 2.0)
        radio.feed_height(T + 1, 900.0, wrong, GROUND, 2.0)
        radio.feed_height(T + 1, 900.0, 3.0, GROUND, wrong)
    assert radio.at(T) == before


def test_late_and_twice_changes_nothing() -> None:
    radio = RadioNavigator(STATIONS)
    before = feed(radio)
    radio.feed_dme(T, "a", distance("a") + 700.0)
    radio.feed_dme(T - S, "b", distance("b") + 700.0)
    radio.feed_fix(T - S, GeodeticPoint(0.85, 0.2, 1500.0), 3.0, 5.0)
    radio.feed_height(T - S, 100.0, None, GROUND, 2.0)
    assert radio.at(T) == before


def test_satellites_in_one_plane_do_not_weigh() -> None:
    assert fix_covariance(np.zeros(5), np.radians([10.0, 30.0, 50.0, 70.0, 80.0]), 3.0) is None
    assert fix_covariance(AZIMUTH[:3], ELEVATION[:3], 3.0) is None
    radio = RadioNavigator(STATIONS)
    radio.feed_satellites(T, AZIMUTH[:3], ELEVATION[:3])
    radio.feed_fix(T, HERE, 3.0, 5.0)  # what it states counts
    state = radio.at(T)
    assert state.vertical_sd == pytest.approx(5.0, rel=1e-6)
    radio.feed_satellites(T, np.append(AZIMUTH, math.nan), np.append(ELEVATION, 0.3))
    radio.feed_fix(T + 1, HERE, None, None)
    assert radio.at(T).valid


def test_a_larger_stated_sigma_of_the_receiver_is_used() -> None:
    """A good sky does not exclude jamming, reflections or dead reckoning: 3 m had been used for 30 m."""
    radio = RadioNavigator({})
    radio.feed_satellites(T, AZIMUTH, ELEVATION)
    radio.feed_fix(T, HERE, 30.0, 50.0)
    state = radio.at(T)
    assert (state.horizontal_sd, state.vertical_sd) == pytest.approx((30.0, 50.0), rel=1e-6)
    cov_n = fix_covariance(AZIMUTH, ELEVATION, 3.0)
    assert cov_n is not None
    radio.feed_fix(T + 1, HERE, math.nan, 0.1)  # no sigma, and one that its satellites do not allow
    assert radio.at(T + 1).vertical_sd == pytest.approx(math.sqrt(cov_n[2, 2]), rel=1e-3)


def test_poles_and_the_date_line() -> None:
    for lat, lon in ((math.pi / 2, 0.0), (-math.pi / 2, 0.0), (0.4, math.pi), (0.4, -math.pi + 1e-9)):
        here = GeodeticPoint(lat, lon, 1500.0)
        here_e, turn = ecef_from_geodetic(*here), mat_en(lat, lon)
        radio = RadioNavigator({})
        radio._stations_e = {
            str(k): here_e + turn @ line
            for k, line in enumerate(np.array([[3e4, 0, 900], [-2e4, 3e4, 500], [0, -4e4, 1000], [1e4, 1e4, 800]]))
        }
        for name, point in radio._stations_e.items():
            radio.feed_dme(T, name, float(np.linalg.norm(point - here_e)))
        radio.feed_height(T, 900.0, None, GROUND, 2.0)
        state = radio.at(T)
        assert state.valid and state.lat is not None and state.lon is not None and state.alt is not None
        assert np.linalg.norm(ecef_from_geodetic(state.lat, state.lon, state.alt) - here_e) < 1.0


def test_old_satellite_directions_are_not_used_for_a_fix() -> None:
    """In a bank, or behind a mountain, others are used: the sigmas that the fix states count."""
    radio = RadioNavigator(STATIONS)
    radio.feed_satellites(T, AZIMUTH, ELEVATION)
    found = []
    for age_s in (0, 9, 11, 3600):
        radio.feed_fix(T + age_s * S, HERE, 0.3, 0.5)
        found.append(radio.at(T + age_s * S).vertical_sd)
    assert found[0] == found[1] != pytest.approx(0.5, rel=0.1)
    assert found[2:] == pytest.approx([0.5, 0.5], rel=1e-6)
    radio.feed_fix(T + 3601 * S, HERE, None, None)  # without any it is none
    assert not radio.at(T + 3605 * S).valid


NUMBER = st.floats(width=64) | st.floats(-1000.0, 1000.0)
SIGMA = st.none() | NUMBER
STEP_NS = st.integers(-3 * S, 3 * S) | st.integers(0, S // 5)


@given(st.lists(st.tuples(st.integers(0, 4), STEP_NS, NUMBER, NUMBER, SIGMA), min_size=1, max_size=15))
def test_nothing_that_comes_breaks_it(inputs: list[tuple[int, int, float, float, float | None]]) -> None:
    radio, t_ns = RadioNavigator(STATIONS), T
    feed(radio)
    for what, step_ns, a, b, sd in inputs:
        t_ns += step_ns
        if what == 0:
            radio.feed_satellites(t_ns, np.array([a, b, 1.0, 2.0, 3.0]), np.array([b, a, 0.3, 0.6, 0.9]))
        elif what == 1:
            radio.feed_fix(t_ns, GeodeticPoint(a, b, a), sd, sd)
        elif what == 2:
            radio.feed_velocity(t_ns, a, b, a)
        elif what == 3:
            radio.feed_dme(t_ns, "abcd"[int(abs(b)) % 4] if math.isfinite(b) else "?", a)
        else:
            radio.feed_height(t_ns, a, sd, b, 1.0 if sd is None else sd)
        found = radio.at(t_ns)
        numbers = (found.lat, found.lon, found.alt, found.horizontal_sd, found.vertical_sd)
        assert all(number is not None and math.isfinite(number) for number in numbers) or not found.valid
        assert found.valid == (not found.reasons)
