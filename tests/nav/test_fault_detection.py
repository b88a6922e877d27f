"""Receivers with faults and a tactical inertial unit: they are refused, and the protection levels stay valid.

Truth, unit and receivers are those of ``receiver_flights``; a fault begins after five minutes and is observed for two,
or, with ``--scale full``, for five.  One flight of each fault, ten with ``--scale full``.  Misleading: an error larger
than the protection level.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.messages.outputs import FilterMode
from tests.nav.receiver_flights import (
    SECONDS,
    Fault,
    Fixes,
    FlightResult,
    draw,
    fly,
    frozen,
    offset_after,
    silent,
    swapped,
)

Array = NDArray[np.float64]

BEGIN, END = 300.0, 360.0
#: Flights with one fault end then in quick tests [s].
QUICK_END_S = 420.0
#: Those in which a device is silent until after that, or the filter begins again.
QUICK_RETURN_END_S = 480.0
#: Of the inertial unit: the filter begins again [s].
GAP_S = (400.0, 400.5)
FLIGHTS, FLIGHTS_FULL = 1, 10
#: Alignment, and until all copies exist [s].
SETTLED = 60.0


def constant(*metres: float) -> Callable[[Array], Array]:
    return lambda since: np.tile(np.array(metres), (len(since), 1))


def until(seconds: float, offset: Callable[[Array], Array]) -> Callable[[Array], Array]:
    return lambda since: (since < seconds)[:, None] * offset(since)


def ramp(rate: float, onset: float) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    """North: position, and the velocity that belongs to it, which grows by ``onset`` [m/s^2] to ``rate`` [m/s]."""

    def velocity(since: Array) -> Array:
        return np.minimum(onset * since, rate)[:, None] * [1.0, 0.0, 0.0]

    def offset(since: Array) -> Array:
        on = np.minimum(since, rate / onset)
        return (0.5 * onset * on**2 + rate * (since - on))[:, None] * [1.0, 0.0, 0.0]

    return offset, velocity


def numbers(request: pytest.FixtureRequest) -> range:
    return range(FLIGHTS_FULL if request.config.getoption("--scale") == "full" else FLIGHTS)


@pytest.fixture
def until_s(scale: int) -> float:
    """End of the flights with one fault [s]."""
    return QUICK_END_S if scale == 1 else SECONDS


@pytest.fixture
def return_until_s(scale: int) -> float:
    """End of the flights in which something returns at 400 s."""
    return QUICK_RETURN_END_S if scale == 1 else SECONDS


STANDING: dict[str, tuple[Fault, float]] = {
    "small step": (offset_after(BEGIN, constant(0.0, 20.0, 0.0)), 12.0),
    "step": (offset_after(BEGIN, constant(0.0, 100.0, 0.0)), 8.0),
    "frozen": (frozen(BEGIN, np.inf), 10.0),
    "frozen position": (frozen(BEGIN, np.inf, velocity=False), 10.0),
    "swapped": (swapped(BEGIN, np.inf), 8.0),
    "sharp ramp": (offset_after(BEGIN, *ramp(1.0, 100.0)), 15.0),
    "smooth ramp": (offset_after(BEGIN, *ramp(1.0, 0.1)), 25.0),
    "ramp of the position alone": (offset_after(BEGIN, ramp(1.0, 100.0)[0]), 20.0),
    "fast ramp": (offset_after(BEGIN, *ramp(3.0, 100.0)), 10.0),
}


@pytest.mark.parametrize("name", STANDING)
def test_a_receiver_that_lies_is_refused_and_nobody_is_misled(
    name: str, until_s: float, request: pytest.FixtureRequest
) -> None:
    """Without the tests the filter followed all of them, the step after 5 s, with a sigma of 1.6 m."""
    fault, limit_s = STANDING[name]
    for number in numbers(request):
        flight = fly(draw(number), {"gnss": fault}, until_s=until_s)
        refused = flight.refused_at("gnss")
        print(f"{name} #{number}: refused after {refused[:1] - BEGIN} s\n{flight.texts()}")
        assert refused[0] > BEGIN
        assert refused[0] - BEGIN <= limit_s
        assert refused[-1] == pytest.approx(max(flight.t)), "a lie that lasts stays refused"
        assert flight.misled(SETTLED) == 0.0
        assert flight.mode[-1] is FilterMode.COASTING
        assert any(event.level == "warning" and "gnss: refused" in event.text for _, event in flight.events)


def test_a_ramp_soon_after_the_first_copy_is_within_the_protection_level(until_s: float) -> None:
    """The copy is too young to be certain of it, and is not replaced any more: nothing is refused, and it counts."""
    begin = 23.0
    offset, velocity = ramp(1.0, 100.0)
    flight = fly(draw(0), {"gnss": offset_after(begin, offset, velocity)}, until_s=until_s)
    print(flight.texts())
    assert flight.radial.max() > 30.0
    assert flight.misled(begin) == 0.0


ENDING: dict[str, Fault] = {
    "frozen": frozen(BEGIN, END),
    "swapped": swapped(BEGIN, END),
    "fast ramp": offset_after(BEGIN, until(END - BEGIN, ramp(5.0, 100.0)[0]), until(END - BEGIN, ramp(5.0, 100.0)[1])),
}


@pytest.mark.parametrize("name", ENDING)
def test_a_contradiction_that_ends_by_a_step_is_forgiven_after_30_s(
    name: str, until_s: float, request: pytest.FixtureRequest
) -> None:
    for number in numbers(request):
        flight = fly(draw(number), {"gnss": ENDING[name]}, until_s=until_s)
        refused = flight.refused_at("gnss")
        assert END + 29.0 <= refused[-1] <= END + 34.0, flight.texts()
        assert flight.misled(SETTLED) == 0.0
        assert flight.mode[-1] is FilterMode.AIDED
        assert flight.radial[-1] < 5.0


def test_a_lie_of_the_size_that_the_filter_has_drifted_stays_unconfirmed() -> None:
    """A ramp that ends and stands: the coasting filter agrees with it sooner or later, and does not let it in."""
    offset, velocity = ramp(1.0, 100.0)
    shifted = offset_after(BEGIN, lambda s: offset(np.minimum(s, 20.0)), until(20.0, velocity))
    flight = fly(draw(0), {"gnss": shifted})
    assert flight.refused_at("gnss")[-1] == pytest.approx(max(flight.t))
    assert "unconfirmed" in flight.texts()
    assert flight.misled(SETTLED) == 0.0


def test_a_wrong_height_leaves_the_position_in(until_s: float) -> None:
    """47 m of undulation from a moment on, and back: beside a barometer the height alone is refused."""
    fault = offset_after(BEGIN, until(END - BEGIN, constant(0.0, 0.0, 47.0)))
    flight = fly(draw(0), {"gnss": fault}, until_s=until_s)
    assert "gnss height: refused" in flight.texts()
    assert "gnss height: aids the filter again" in flight.texts()
    assert len(flight.refused_at("gnss")) == 0
    assert flight.misled(SETTLED) == 0.0
    assert max(abs(e[2]) for t, e in zip(flight.t, flight.error, strict=True) if t > SETTLED) < 12.0


def test_without_a_barometer_a_wrong_height_refuses_the_receiver(until_s: float) -> None:
    flight = fly(draw(0), {"gnss": offset_after(BEGIN, constant(0.0, 0.0, 47.0))}, baro=False, until_s=until_s)
    assert flight.refused_at("gnss")[0] - BEGIN <= 8.0
    assert flight.misled(SETTLED) == 0.0


@pytest.mark.parametrize("name", ["step", "frozen", "sharp ramp"])
def test_of_two_receivers_the_one_that_lies_is_refused(name: str, until_s: float) -> None:
    """The other one goes on aiding: no coasting, and an error as before."""
    flight = fly(draw(0, ("gnss", "second")), {"gnss": STANDING[name][0]}, until_s=until_s)
    assert flight.refused_at("gnss")[0] - BEGIN <= STANDING[name][1] + 5.0, (
        "which of the two, the inertial unit must say"
    )
    assert len(flight.refused_at("second")) == 0
    assert flight.misled(SETTLED) == 0.0
    assert flight.mode[-1] is FilterMode.AIDED
    assert flight.radial[np.array(flight.t) > SETTLED].max() < 8.0
    assert np.median(np.array(flight.hpl)[np.array(flight.t) > 400.0]) < 40.0, "as with one receiver alone"


@pytest.mark.parametrize("rate", [1.0, 3.0])
def test_two_receivers_that_lie_alike_are_both_refused(rate: float, until_s: float) -> None:
    """One spoofer: the other one confirms nothing.  Refusing one of them let the filter follow the other."""
    fault = offset_after(BEGIN, *ramp(rate, 100.0))
    flight = fly(draw(0, ("gnss", "second")), {"gnss": fault, "second": fault}, until_s=until_s)
    for name in ("gnss", "second"):
        assert flight.refused_at(name)[0] - BEGIN <= 20.0
        assert flight.refused_at(name)[-1] == pytest.approx(max(flight.t))
    assert flight.misled(SETTLED) == 0.0


@pytest.mark.parametrize("lying", ["gnss", "second"])
def test_of_two_receivers_that_part_slowly_the_sound_one_is_not_refused(lying: str) -> None:
    """0.3 m/s, which the inertial unit does not see: a draw, and levels that cover both."""
    flight = fly(draw(0, ("gnss", "second")), {lying: offset_after(BEGIN, *ramp(0.3, 100.0))})
    sound = "second" if lying == "gnss" else "gnss"
    assert "contradiction: " in flight.texts()
    assert len(flight.refused_at(sound)) == 0, flight.texts()
    assert flight.misled(SETTLED) == 0.0


def silent_after_an_outlier(at_s: float) -> Fault:
    """One fix 500 m off, then none."""

    def fault(fixes: Fixes) -> Fixes:
        last = np.arange(len(fixes.t)) == np.searchsorted(fixes.t, at_s)
        moved = fixes.moved(last[:, None] * np.array([0.0, 500.0, 0.0]), np.zeros((len(fixes.t), 3)))
        return silent(float(fixes.t[last][0]) + 0.01, np.inf)(moved)

    return fault


def test_a_receiver_that_falls_silent_after_a_wrong_fix_does_not_hold_the_copies(until_s: float) -> None:
    """The gate refused it for ever; no copy was replaced, and HPL was 8 km beside a sound receiver."""
    flight = fly(draw(0, ("gnss", "second")), {"second": silent_after_an_outlier(200.0)}, until_s=until_s)
    assert max(flight.hpl[-60:]) < 30.0
    assert not flight.events, flight.texts()


@pytest.mark.parametrize("from_s", [0.0, 200.0])
def test_a_receiver_that_is_silent_while_another_one_lies_is_not_refused(from_s: float, return_until_s: float) -> None:
    """It was refused with it, unconfirmed for ever, and its old copy left the fault unresolved for 14 s."""
    faults = {"gnss": STANDING["sharp ramp"][0], "second": silent(from_s, 400.0)}
    flight = fly(draw(0, ("gnss", "second")), faults, until_s=return_until_s)
    assert flight.refused_at("gnss")[0] - BEGIN <= STANDING["sharp ramp"][1], flight.texts()
    assert len(flight.refused_at("second")) == 0
    assert flight.misled(SETTLED) == 0.0
    assert flight.mode[-1] is FilterMode.AIDED
    assert flight.radial[-1] < 8.0


def test_a_filter_that_begins_again_does_not_begin_with_a_receiver_that_contradicted_it() -> None:
    """A step of 100 m at 300 s, a gap of the inertial unit at 400 s: no position rather than a wrong one."""
    flight = fly(draw(0), {"gnss": STANDING["step"][0]}, gap_s=GAP_S)
    assert max(flight.t) == pytest.approx(399.0, abs=1.1)
    assert flight.misled(SETTLED) == 0.0


def test_a_filter_that_begins_again_does_not_begin_with_a_height_that_contradicted_it() -> None:
    """47 m of height at 300 s, a gap of the inertial unit at 400 s: the altitude was 49 m off, its level 25 m."""
    fault = offset_after(BEGIN, constant(0.0, 0.0, 47.0))
    flight = fly(draw(0), {"gnss": fault}, gap_s=GAP_S)
    assert "gnss height: refused" in flight.texts()
    assert max(flight.t) == pytest.approx(399.0, abs=1.1)
    assert flight.misled(SETTLED) == 0.0


def test_a_filter_that_begins_again_with_another_height_still_refuses_the_one_that_contradicted(
    return_until_s: float,
) -> None:
    fault = offset_after(BEGIN, constant(0.0, 0.0, 47.0))
    result = fly(draw(0, ("gnss", "second")), {"gnss": fault}, gap_s=GAP_S, until_s=return_until_s)
    assert max(result.t) == pytest.approx(return_until_s - 1.0, abs=1.1)
    assert "gnss height: still refused after a restart of the filter" in result.texts()
    assert result.misled(SETTLED) == 0.0


def test_a_filter_that_begins_again_with_another_receiver_still_refuses_the_one_that_lied(
    return_until_s: float,
) -> None:
    fault = STANDING["step"][0]
    result = fly(draw(0, ("gnss", "second")), {"gnss": fault}, gap_s=GAP_S, until_s=return_until_s)
    assert result.refused_at("gnss")[-1] == pytest.approx(max(result.t))
    assert max(result.t) == pytest.approx(return_until_s - 1.0, abs=1.1)
    assert "gnss: still refused after a restart of the filter" in result.texts()
    assert result.misled(SETTLED) == 0.0


def nominal(numbers: range, receivers: tuple[str, ...]) -> list[FlightResult]:
    return [fly(draw(100 + number, receivers)) for number in numbers]


def test_sound_receivers_are_not_refused_and_the_levels_are_not_bought_by_size(request: pytest.FixtureRequest) -> None:
    """HPL at most 12 sigma of the filter in the median, and no error beyond it."""
    flights = nominal(numbers(request), ("gnss",))
    times = [np.median((np.array(f.hpl) / np.array(f.sd))[np.array(f.t) > SETTLED]) for f in flights]
    print(f"HPL over sigma, median of {len(flights)} flights: {np.median(times):.1f}; allowed 12")
    assert np.median(times) <= 12.0
    assert all(not f.events for f in flights), [f.texts() for f in flights]
    assert all(f.misled() == 0.0 for f in flights)


def test_two_sound_receivers_are_not_refused(request: pytest.FixtureRequest) -> None:
    flights = nominal(numbers(request), ("gnss", "second"))
    assert all(not f.events for f in flights), [f.texts() for f in flights]
    assert all(f.misled() == 0.0 for f in flights)
