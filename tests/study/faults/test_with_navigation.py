"""Units, frames and signs of the simulated measurements match those of navigation."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from fti.config import Device, Filter
from fti.nav.inertial_aiding import AidedNavigation
from fti.study.faults import START_NS, Cell, SensorFault, draw
from fti.study.faults import flight as flights

SECOND_NS = 1_000_000_000
END_S = 400


def test_a_nominal_tactical_flight_through_the_filter_stays_within_its_sigma(monkeypatch: pytest.MonkeyPatch) -> None:
    """Climbs and turns, from 60 s to 400 s: errors over stated sigma RMS below 3, position within 12 m.

    One flight of slow errors of 100-300 s is one or two independent samples of them: sigma itself is not judged here.
    """
    monkeypatch.setattr(flights, "ONSET_S", (130.0, 150.0))  # turns begin with the end of the alignment
    flight = draw(Cell("tactical", SensorFault.NONE, pattern="turns"), 1)
    motion = flight.truth(np.arange(START_NS, START_NS + END_S * SECOND_NS, SECOND_NS))
    assert np.ptp(motion.vel_n[:, 2]) > 2.0 and np.ptp(motion.rpy[:, 0]) > 0.4
    devices = {name: Device(name=name, link="none", driver="nmea") for name in ("imu", "baro", "ahrs", "gnss_a")}
    navigation = AidedNavigation(Filter(imu="imu", unit="tactical", gnss=("gnss_a",), baro=("baro",)), devices)
    ticks, ratios = itertools.count(START_NS + SECOND_NS, SECOND_NS), list[tuple[float, float, float]]()
    tick_ns = next(ticks)
    for t_ns, device, m in flight:
        if t_ns > tick_ns:
            solution = navigation.solution(tick_ns)
            if tick_ns > START_NS + 60 * SECOND_NS:
                assert (
                    solution.valid
                    and solution.lat is not None
                    and solution.lon is not None
                    and solution.alt is not None
                )
                assert solution.horizontal_sd is not None and solution.vertical_sd is not None and not solution.rejected
                error = np.array(flight.error(tick_ns, solution.lat, solution.lon, solution.alt))
                assert np.linalg.norm(error) < 12.0
                ratios.append(tuple(error / (solution.horizontal_sd, solution.horizontal_sd, solution.vertical_sd)))
            tick_ns = next(ticks)
        if t_ns > START_NS + END_S * SECOND_NS:
            break
        if navigation.accepts(device, type(m)):
            navigation.feed(device, m, t_ns)
    assert len(ratios) > 330
    assert (np.sqrt(np.mean(np.square(ratios), axis=0)) < 3.0).all()
