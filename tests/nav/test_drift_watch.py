"""Satellites and drifts over the ground watch each other, over waves of ground that share no model with the product."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from fti.messages.measurements import Measurement, Position, RangeScan, Stamp, Velocity
from fti.messages.outputs import Event, FilterSolution
from fti.messages.reasons import Reason
from fti.nav.pipeline import Pipeline
from fti.ranging.scan_points import make_scan, point_arrays
from tests.nav.test_ground_drift import (
    RANGE_SD,
    Imager,
    Outputs,
    config,
    directions,
    known_sensor,
    north_error,
    ranges,
    waves,
)
from tests.nav.test_inertial_aiding import MS, RADIUS, T0, S, measurements

BEGIN_S = 90.0


def spoofed(m: Measurement, t: float, rate: float) -> Measurement:
    """A position and velocity of satellites that move north by a rate [m/s] from BEGIN_S on."""
    if isinstance(m, Position) and m.lat is not None:
        return replace(m, lat=m.lat + rate * max(t - BEGIN_S, 0.0) / RADIUS)
    if isinstance(m, Velocity) and m.north is not None and t > BEGIN_S:
        return replace(m, north=m.north + rate)
    return m


def fly(sensor: Any, *, satellites: Callable[[float], bool], end_s: float, rate: float = 0.0) -> Outputs:
    out = Outputs()
    with known_sensor():
        pipeline = Pipeline(config(), None)
        for k in range(round(end_s * 100)):
            t = 0.01 * k
            for device, m in measurements(k, gnss=satellites(t)):
                if device != "laser":
                    out += pipeline.feed(device, spoofed(m, t, rate))
            for scan in sensor.scans(k):
                out += pipeline.feed("imager", scan)
            if k % 2 == 0:
                out += pipeline.tick(T0 + k * 10 * MS)
    return out


def solutions(out: Outputs, from_s: float) -> list[FilterSolution]:
    return [o for o in out if isinstance(o, FilterSolution) and o.valid and o.t_ns >= T0 + from_s * S]


def texts(out: Outputs, word: str) -> list[tuple[float, str]]:
    return [((o.t_ns - T0) / S, o.text) for o in out if isinstance(o, Event) and word in o.text]


@dataclasses.dataclass(frozen=True)
class MovingGround:
    """An imager over ground that moves north faster and faster [m/s^2] from a time on [s]."""

    acceleration: float
    from_s: float

    def scans(self, k: int) -> list[RangeScan]:
        if k % 50:
            return []
        t, rays = 0.01 * k, directions()
        moved = 0.5 * self.acceleration * max(t - self.from_s, 0.0) ** 2
        measured = ranges(t, rays, lambda north, east: waves(north - moved, east))
        measured += RANGE_SD * np.random.default_rng(k).standard_normal(len(rays))
        return [make_scan(Stamp(T0 + k * 10 * MS), measured, point_arrays(rays, np.zeros(len(rays))))]


def always(_: float) -> bool:
    return True


@pytest.fixture(scope="module")
def ramp() -> Outputs:
    """Spoofing at 0.12 m/s."""
    return fly(Imager(), satellites=always, end_s=150.0, rate=0.12)


def test_drifts_show_a_slow_ramp_of_the_satellites(ramp: Outputs) -> None:
    (when, text), *_ = texts(ramp, "contradiction")
    assert BEGIN_S < when < BEGIN_S + 50.0
    assert "satellites against drifts" in text
    assert Reason.CONTRADICTION in solutions(ramp, when + 1.0)[0].reasons


def test_without_drifts_the_ramp_is_not_found() -> None:
    alone = fly(Imager(lasts=lambda _: False), satellites=always, end_s=150.0, rate=0.12)
    assert not texts(alone, "contradiction") and not texts(alone, "refused")


def test_the_level_contains_the_true_position_while_they_contradict_each_other(ramp: Outputs) -> None:
    (when, _), *_ = texts(ramp, "contradiction")
    later = solutions(ramp, when + 1.0)
    assert len(later) > 50
    assert max(abs(north_error(each)) for each in later) > 3.0  # the filter follows the satellites
    assert all(each.hpl is not None and abs(north_error(each)) < each.hpl for each in later)


def test_ground_that_moves_without_satellites_is_excluded_and_contained() -> None:
    out = fly(MovingGround(0.02, 110.0), satellites=lambda t: t < 100.0, end_s=150.0)
    (when, text), *_ = texts(out, "scan.drift: excluded")
    assert 110.0 < when < 135.0
    assert "velocity north" in text
    assert all(each.hpl is not None and abs(north_error(each)) < each.hpl for each in solutions(out, 100.0))
    assert abs(north_error(solutions(out, 149.0)[-1])) < 5.0  # it continues without the drifts: 20 m with them


@pytest.fixture(scope="module")
def absence() -> Outputs:
    """No satellites for 80 s, and then 20 s with them."""
    return fly(Imager(), satellites=lambda t: t < 70.0 or t > 150.0, end_s=170.0)


def test_a_long_absence_of_satellites_is_bounded_by_the_drifts(absence: Outputs) -> None:
    alone = fly(Imager(lasts=lambda _: False), satellites=lambda t: t < 70.0, end_s=150.0)
    aided, coasting = solutions(absence, 149.0)[0], solutions(alone, 149.0)[0]
    assert aided.hpl is not None and coasting.hpl is not None
    assert aided.hpl < 0.3 * coasting.hpl
    assert all(each.hpl is not None and abs(north_error(each)) < each.hpl for each in solutions(absence, 70.0))


def test_returning_satellites_are_compared_with_the_filter_on_drifts(absence: Outputs) -> None:
    """The copies from before the absence have coasted for 80 s; their level does not count."""
    during, after = solutions(absence, 149.0)[0], solutions(absence, 160.0)[0]
    assert during.hpl is not None and after.hpl is not None
    assert after.hpl < 1.2 * during.hpl
    assert not texts(absence, "contradiction")
