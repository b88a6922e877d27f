"""Copies of the filter without a source: they follow it exactly, and d has the sigma of P_i - P_0.

The truth is that of ``receiver_flights``.  What a copy must be comes from the filter itself, flown without the source.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fti.geodesy.wgs84 import radii
from fti.nav.filter import kernels
from fti.nav.filter.aiding import GnssPosition, GnssVelocity
from fti.nav.filter.error_states import GNSS_DRIFTS, FilterModel, own_drifts, receiver_drifts
from fti.nav.filter.estimate import InitialState
from fti.nav.filter.navigator import InertialNavigator
from fti.nav.filter.segment import cut
from fti.nav.inertial.ins_error_model import IMU_ERROR_MODELS
from fti.nav.separation.copies import FilterCopy, largest_sd, separate
from fti.nav.separation.copy_ring import CopyRing, RingSettings
from tests.nav.receiver_flights import ALT, SECOND_NS, T0, Fixes, Flight, draw

MODEL = FilterModel(IMU_ERROR_MODELS["tactical"], extras=GNSS_DRIFTS)
NAMES = frozenset({"gnss.position", "gnss.height", "gnss.velocity"})


def ns(t: float) -> int:
    return T0 + round(t * SECOND_NS)


def started(flight: Flight) -> InertialNavigator:
    state = flight.truth.state(flight.t[:1])
    north, east, down = state.vel_n[0].tolist()
    start = InitialState(
        float(state.lat[0]), float(state.lon[0]), float(state.alt[0]), (north, east, down), float(state.roll[0]),
        float(state.pitch[0]), float(state.heading[0]), (2.0,) * 3, (0.2,) * 3, (0.005, 0.005, 0.01),
    )  # fmt: skip
    navigator = InertialNavigator(MODEL)
    navigator.begin(ns(0.0) - 1, start, flight.imu[0, :3], flight.imu[0, 3:])
    return navigator


def aids(fixes: Fixes, k: int) -> tuple[GnssPosition, GnssVelocity]:
    north, east, down = fixes.vel[k].tolist()
    place = float(fixes.lat[k]), float(fixes.lon[k]), float(fixes.alt[k])
    return GnssPosition(*place, 1.8, 2.7), GnssVelocity(north, east, down, 0.3)


def fly(navigator: InertialNavigator, flight: Flight, until: float, lost_from: float = np.inf) -> None:
    """Every third fix, half a second late: the filter does again what came before."""
    fixes, taken = flight.receivers["gnss"], 0
    for k, t in enumerate(flight.t[flight.t < until].tolist()):
        navigator.feed_inertial(ns(t), flight.imu[k, :3].tolist(), flight.imu[k, 3:].tolist())
        while fixes.t[taken] < t - 0.5:
            at = float(fixes.t[taken])
            if at < lost_from and taken % 3 == 0:
                for aiding in aids(fixes, taken):
                    navigator.feed_aiding(ns(at), aiding)
            taken += 1


def test_one_transition_for_all_steps_is_that_of_many() -> None:
    """A turn at 0.5 rad/s with 2 g for 0.2 s, in one transition and in twenty: sigmas to a part in 1e4."""
    rng = np.random.default_rng(1)
    start = InitialState(0.8, 0.2, ALT, (60.0, 10.0, 0.0), 0.5, 0.02, 1.0, (1.0,) * 3, (0.1,) * 3, (1e-3,) * 3)
    here = start.estimate(0, np.zeros(6), MODEL)
    imu = np.array([0.0, 0.0, -19.6, 0.0, 0.2, 0.5]) + rng.normal(0.0, 0.05, (21, 6))
    many, one = (here.y.copy(), here.P.copy()), (here.y.copy(), here.P.copy())
    table, drifts = MODEL.unit.table, MODEL.drifts
    for k in range(20):
        kernels.step(*many, imu[k], imu[k + 1], np.zeros(6), table, drifts, 0.01)
    kernels.coast(*one, imu[:-1], imu[1:], np.zeros((20, 6)), table, drifts, np.full(20, 0.01))
    np.testing.assert_allclose(one[0], many[0], rtol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(one[1])), np.sqrt(np.diag(many[1])), rtol=1e-4)


def test_a_heading_that_is_far_off_is_in_the_sigma_along_and_across_the_force() -> None:
    """A turn of 20 s at 5 m/s^2 with 35 deg of heading sigma: what drawn headings make of the force beyond first order,
    (1 - cos psi) along it and (psi - sin psi) across it, beside the linear effect of the heading.
    """
    sd, force, seconds = math.radians(35.0), 5.0, 20
    start = InitialState(0.8, 0.2, ALT, (60.0, 0.0, 0.0), 0.0, 0.0, 0.0, (1e-3,) * 3, (1e-3,) * 3, (1e-4, 1e-4, sd))
    here = start.estimate(0, np.zeros(6), MODEL)
    y, P, imu = here.y.copy(), here.P.copy(), np.array([force, 0.0, -9.8, 0.0, 0.0, 0.0])
    for _ in range(10 * seconds):
        kernels.step(y, P, imu, imu, np.zeros(6), MODEL.unit.table, MODEL.drifts, 0.1)
    north_e, east_e, down_e = here.mat_en.T
    along = math.sqrt(float(north_e @ P[3:6, 3:6] @ north_e))
    # the part of the velocity across the force that the heading does not explain
    cross = P[3:6, 6:9].T @ east_e @ down_e
    across = math.sqrt(float(east_e @ P[3:6, 3:6] @ east_e) - cross**2 / float(down_e @ P[6:9, 6:9] @ down_e))
    drawn = np.random.default_rng(3).normal(0.0, sd, 100_000)
    beyond = [1.0 - np.cos(drawn), drawn - np.sin(drawn)]
    true_along, true_across = (force * seconds * math.sqrt(float(np.mean(each**2))) for each in beyond)
    assert true_along < along < 1.3 * true_along
    assert true_across < across < 1.3 * true_across


def test_a_copy_that_goes_without_nothing_is_the_filter() -> None:
    """Through segments of late fixes: the same position to a micrometre, the same sigma to a part in 1e3."""
    flight = draw(0)
    navigator = started(flight)
    copy: FilterCopy | None = None
    fixes, taken = flight.receivers["gnss"], 0
    for k, t in enumerate(flight.t[flight.t < 40.0].tolist()):
        navigator.feed_inertial(ns(t), flight.imu[k, :3].tolist(), flight.imu[k, 3:].tolist())
        while fixes.t[taken] < t - 0.5:
            for aiding in aids(fixes, taken):
                navigator.feed_aiding(ns(float(fixes.t[taken])), aiding)
            taken += 1
        for segment in navigator.drain_segments():
            if copy is None:
                copy = FilterCopy.begin(segment.moments[0], frozenset())
            copy.advance(cut(segment))
            assert copy.estimate.t_ns == segment.end.estimate.t_ns
            np.testing.assert_allclose(copy.estimate.y[:3], segment.end.estimate.y[:3], atol=1e-6)
            mine, its = (np.sqrt(np.diag(e.P)) for e in (copy.estimate, segment.end.estimate))
            np.testing.assert_allclose(mine, its, rtol=1e-3)
    assert copy is not None
    assert copy.estimate.t_ns > ns(38.0)


def test_a_copy_without_satellites_is_the_filter_that_lost_them() -> None:
    """From 30 s on: beside a filter that is flown without fixes from then on, to a centimetre after 20 s."""
    flight = draw(1)
    with_all, without = started(flight), started(flight)
    fly(without, flight, until=51.2, lost_from=30.0)
    fly(with_all, flight, until=29.0)
    with_all.drain_segments()
    copy: FilterCopy | None = None
    fixes, taken = flight.receivers["gnss"], int(np.searchsorted(flight.receivers["gnss"].t, 28.5))
    for k in range(round(29.0 / 0.04), round(52.0 / 0.04)):
        t = float(flight.t[k])
        with_all.feed_inertial(ns(t), flight.imu[k, :3].tolist(), flight.imu[k, 3:].tolist())
        while fixes.t[taken] < t - 0.5:
            if taken % 3 == 0:
                for aiding in aids(fixes, taken):
                    with_all.feed_aiding(ns(float(fixes.t[taken])), aiding)
            taken += 1
        for segment in with_all.drain_segments():
            if copy is None and segment.end.estimate.t_ns >= ns(29.9):
                copy = FilterCopy.begin(segment.end, NAMES)
            elif copy is not None:
                copy.advance(cut(segment))
    assert copy is not None
    alone = without.at(copy.estimate.t_ns)
    assert alone is not None
    np.testing.assert_allclose(copy.estimate.y[:3], alone.y[:3], atol=0.01)
    np.testing.assert_allclose(np.sqrt(np.diag(copy.estimate.P)[:6]), np.sqrt(np.diag(alone.P)[:6]), rtol=0.01)


def test_a_separation_is_in_north_east_down() -> None:
    """A copy 3 m north, 4 m east and 5 m below the filter, at 46 deg of latitude."""
    start = InitialState(0.8, 0.2, ALT, (60.0, 10.0, 0.0), 0.0, 0.0, 0.0, (1.0, 2.0, 3.0), (0.1,) * 3, (1e-3,) * 3)
    here = start.estimate(0, np.zeros(6), MODEL)
    meridian, normal = (float(r) for r in radii(0.8))
    lat, lon = 0.8 + 3.0 / (meridian + ALT), 0.2 + 4.0 / ((normal + ALT) * np.cos(0.8))
    wider = (2.0, 3.0, 4.0)
    copy = InitialState(lat, lon, ALT - 5.0, (60.0, 10.0, 0.0), 0.0, 0.0, 0.0, wider, (0.2,) * 3, (1e-3,) * 3)
    separation = separate(here, copy.estimate(0, np.zeros(6), MODEL))
    np.testing.assert_allclose(separation.d[:3], [-3.0, -4.0, -5.0], atol=1e-3)
    np.testing.assert_allclose(separation.d_sd[:3], np.sqrt([3.0, 5.0, 7.0]), rtol=1e-5)
    np.testing.assert_allclose(separation.ratios[:3], np.array([3.0, 4.0, 5.0]) / np.sqrt([3.0, 5.0, 7.0]), rtol=1e-3)
    assert separation.radial_sd == pytest.approx(3.0, rel=1e-5)
    assert separation.level_ratios[0] == pytest.approx(np.hypot(3.0 / np.sqrt(3.0), 4.0 / np.sqrt(5.0)), rel=1e-3)


@pytest.mark.parametrize(("correlation", "expected"), [(0.6, np.sqrt(2.0 / 1.6) * 3.0), (-0.6, np.sqrt(2.0) * 3.0)])
def test_a_separation_counts_in_the_direction_in_which_it_is_least_likely(correlation: float, expected: float) -> None:
    """3 sigma north and east.  Along a correlation that is what d is like; across it no more than without one."""
    start = InitialState(0.0, 0.0, ALT, (60.0, 0.0, 0.0), 0.0, 0.0, 0.0, (1.0,) * 3, (0.1,) * 3, (1e-3,) * 3)
    here = start.estimate(0, np.zeros(6), MODEL)
    meridian, normal = (float(r) for r in radii(0.0))
    moved = replace(start, lat=-6.0 / (meridian + ALT), lon=-6.0 / (normal + ALT)).estimate(0, np.zeros(6), MODEL)
    P = here.P.copy()  # at the equator north is e_z, east e_y
    P[1:3, 1:3] += 4.0 * np.array([[1.0, correlation], [correlation, 1.0]])
    separation = separate(here, replace(moved, P=P))
    np.testing.assert_allclose(separation.ratios[:2], 3.0, rtol=1e-3)
    assert separation.level_ratios[0] == pytest.approx(expected, rel=1e-3)


def test_the_largest_sigma_is_that_of_the_worst_direction() -> None:
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    assert largest_sd(turn @ np.diag([4.0, 25.0]) @ turn.T) == pytest.approx(5.0)


def test_a_ring_keeps_copies_of_up_to_four_steps() -> None:
    """Begun every 7 s: the oldest is between 21 and 28 s old, and none is replaced while renewal is not asked for."""
    flight = draw(2)
    navigator, copy_ring = started(flight), CopyRing(NAMES, NAMES, RingSettings(4, 7 * SECOND_NS))
    ages = []
    for k, t in enumerate(flight.t[flight.t < 80.0].tolist()):
        navigator.feed_inertial(ns(t), flight.imu[k, :3].tolist(), flight.imu[k, 3:].tolist())
        for segment in navigator.drain_segments():
            copy_ring.advance(cut(segment))
            if t < 60.0:
                copy_ring.renew(segment.end)
            if copy_ring.is_full and copy_ring.oldest is not None:
                ages.append((segment.end.estimate.t_ns - copy_ring.oldest.began_ns) / SECOND_NS)
    assert min(ages) == pytest.approx(21.0, abs=0.3)
    assert max(ages[: len(ages) // 2]) == pytest.approx(28.0, abs=0.3)
    assert ages[-1] > 40.0


def test_errors_of_several_receivers_are_four_fifths_common() -> None:
    alone, both = receiver_drifts(("a",)), receiver_drifts(("a", "b"))
    assert alone == GNSS_DRIFTS
    for own, (name, drift) in zip(own_drifts("a"), GNSS_DRIFTS.items(), strict=True):
        assert both[name].sd ** 2 + both[own].sd ** 2 == pytest.approx(drift.sd**2)
        assert both[name].sd ** 2 == pytest.approx(0.8 * drift.sd**2)
