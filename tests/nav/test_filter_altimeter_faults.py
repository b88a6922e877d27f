"""A wrong altimeter with healthy satellites: its effect on the height of the live filter.

The truth is that of ``aided_flights``; a flight with the fault and the same flight without it have all random
numbers in common.  Twenty flights, 200 with ``--scale full``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.nav.aided_flights import T0, Fault, FlightResult, draw_flight, fly, no_fault

Array = NDArray[np.float64]

FLIGHTS, FLIGHTS_FULL = 20, 200
MOVED_M, SHARE = 1.5, 0.95
#: The first seconds are those of alignment; the last second of all flights [s].
FIRST_S, LAST_S = 10.0, 235.0
STEP_S = 60.0
SECOND_NS = 1_000_000_000

FAULTS: dict[str, tuple[Fault, float]] = {
    "bias": (lambda t, height: height + 10.0, FIRST_S),
    "step": (lambda t, height: height + (10.0 if t >= STEP_S else 0.0), STEP_S),
    "scale": (lambda t, height: 1.03 * height, FIRST_S),
}


@dataclass(frozen=True)
class FlightPair:
    """One flight with a sound altimeter, with each fault, without an altimeter."""

    sound: FlightResult
    wrong: dict[str, FlightResult]
    alone: FlightResult


@pytest.fixture(scope="module")
def flights(request: pytest.FixtureRequest) -> list[FlightPair]:
    full, found = request.config.getoption("--scale") == "full", []
    for number in range(FLIGHTS_FULL if full else FLIGHTS):
        flight = draw_flight(number)
        wrong = {name: fly(flight, fault) for name, (fault, _) in FAULTS.items()}
        found.append(FlightPair(fly(flight), wrong, fly(flight, aided=False)))
    return found


def rms_between(one: FlightResult, other: FlightResult, from_s: float) -> float:
    """Of the difference of two heights of the same flight, from a time on [m]."""
    t = np.arange(from_s, LAST_S)
    return float(np.sqrt(np.mean((one.at(t) - other.at(t)) ** 2)))


@pytest.mark.parametrize("name", FAULTS)
def test_a_wrong_altimeter_hardly_moves_the_height(flights: list[FlightPair], name: str) -> None:
    """10 m from the start or stepped in, 3 %: before, 9.2 m, 7.4 m and 7.7 m in 95 % of flights."""
    moved = [rms_between(pair.wrong[name], pair.sound, FAULTS[name][1]) for pair in flights]
    print(f"{name}: RMS moved, 95 % of flights: {np.quantile(moved, SHARE):.2f} m")
    assert np.mean(np.array(moved) <= MOVED_M) >= SHARE


@pytest.mark.parametrize("name", ["bias", "scale"])
def test_nor_is_it_moved_at_any_second(flights: list[FlightPair], name: str) -> None:
    t = np.arange(FIRST_S, LAST_S)
    largest = [float(np.abs(f.wrong[name].at(t) - f.sound.at(t)).max()) for f in flights]
    print(f"{name}: greatest moved, 95 % of flights: {np.quantile(largest, SHARE):.2f} m")
    assert np.mean(np.array(largest) <= MOVED_M) >= SHARE


def test_a_sound_altimeter_makes_the_height_no_worse_than_satellites_alone(flights: list[FlightPair]) -> None:
    t = np.arange(FIRST_S, LAST_S)
    aided, alone = (
        float(np.sqrt(np.mean([found.at(t) ** 2 for found in which])))
        for which in ([f.sound for f in flights], [f.alone for f in flights])
    )
    print(f"height: RMS {aided:.2f} m with a sound altimeter, {alone:.2f} m without")
    assert aided <= 1.03 * alone


def test_the_stated_sigma_of_the_height_holds_with_a_wrong_altimeter(flights: list[FlightPair]) -> None:
    t = np.arange(FIRST_S, LAST_S)
    for name in FAULTS:
        ratios = [np.mean((f.wrong[name].at(t) / f.wrong[name].sd_at(t)) ** 2) for f in flights]
        assert np.sqrt(np.mean(ratios)) <= 1.25, name


def test_a_sound_altimeter_is_not_excluded(flights: list[FlightPair]) -> None:
    assert [e.text for pair in flights for e in pair.sound.events] == []


def test_a_step_is_excluded_within_ten_seconds_and_reported(flights: list[FlightPair]) -> None:
    """In 95 % of the flights at least; where noise hides a part of the step it passes the gate now and then."""
    firsts = [pair.wrong["step"].events[0] for pair in flights if pair.wrong["step"].events]
    print(f"step: excluded in {len(firsts)} of {len(flights)} flights")
    assert len(firsts) >= SHARE * len(flights)
    for first in firsts:
        assert first.text.startswith("laser: excluded from the filter: its heights are outside the gate, for ")
        assert first.level == "warning"
        assert STEP_S < (first.t_ns - T0) / SECOND_NS < STEP_S + 10.0


def test_without_satellites_an_altimeter_still_holds_the_height() -> None:
    """Gone from 120 to 180 s: the height of the last five seconds, with the altimeter and inertial alone."""
    held, alone = list[Array](), list[Array]()
    for number in range(6):
        flight, t = draw_flight(number), np.arange(175.0, 180.0)
        for found, aided in ((held, True), (alone, False)):
            found.append(fly(flight, no_fault, aided, lost=lambda t: 120.0 <= t < 180.0).at(t))
    rms = [float(np.sqrt(np.mean(np.square(found)))) for found in (held, alone)]
    print(f"after a minute without satellites: {rms[0]:.2f} m with the altimeter, {rms[1]:.2f} m inertial alone")
    assert rms[0] < 0.7 * rms[1]
    assert rms[0] < 4.0
