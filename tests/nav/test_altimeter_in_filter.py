"""Heights of an altimeter that aids the filter: while the filter excludes it, and while it holds the altitude alone.

Level flight at 100 m over known level ground; a tactical inertial unit with noise, satellites five times a second,
radar altimeters eight times a second.  Errors are measured against the height that is flown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fti.config import Config, parse
from fti.geodesy.formulas import EARTH_RATE
from fti.messages.measurements import Attitude, ImuSample, Measurement, Position, RadioHeight, Stamp, Velocity
from fti.messages.outputs import Event, FilterSolution, HeightAboveGround, Output
from fti.messages.reasons import Reason
from fti.nav.pipeline import Pipeline
from fti.nav.terrain_reference import Ground
from fti.terrain.terrain import Terrain

S, STEP_NS = 1_000_000_000, 40_000_000
T0 = 1_000 * S
LAT, LON, HEIGHT, SPEED, RADIUS = math.radians(48.0), math.radians(11.5), 100.0, 40.0, 6_370_000.0
GRAVITY = 9.8089  # normal gravity at LAT and HEIGHT [m/s^2]
#: What an altimeter says too much [m], at a time [s].
Wrong = Callable[[float], float]
NEVER = (math.inf, math.inf)


def config(radars: tuple[str, ...], max_deviation_m: float) -> Config:
    """A unit, a receiver, and radar altimeters that all aid the filter."""
    device = {"link": "l", "driver": "d"}
    radar = {
        "altimeter": {"kind": "radar", "range_m": [0.5, 760.0], "sd_m": 0.4, "max_deviation_m": max_deviation_m},
        **device,
    }
    table: dict[str, Any] = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [{"name": "imu", **device}, {"name": "gnss", **device}, *({"name": n, **radar} for n in radars)],
        "nav": {
            "attitude": [],
            "position": ["gnss"],
            "altimeters": list(radars),
            "filter": {"imu": "imu", "unit": "tactical", "gnss": ["gnss"], "altimeters": list(radars)},
        },
    }
    return parse(table, "", Path("t.toml"))


@pytest.fixture(scope="module")
def ground() -> Ground:
    """Level ground at 0 m."""
    terrain = Terrain.from_array(np.zeros((800, 800)), 25.0, lat0=LAT, lon0=LON, east0=-10_000.0, north0=-10_000.0)
    return Ground(terrain, 1.0, "level")


@dataclass(eq=False)
class FlightResult:
    """Outputs with their time [s]."""

    ground: Ground
    heights: list[tuple[float, HeightAboveGround]] = field(default_factory=list)
    filtered: list[tuple[float, FilterSolution]] = field(default_factory=list)
    events: list[tuple[float, Event]] = field(default_factory=list)

    def of(self, radar: str, begin: float, end: float) -> list[HeightAboveGround]:
        """Heights of an altimeter within times [s]."""
        return [height for t, height in self.heights if height.sensor == radar and begin <= t < end]

    def altitude_error(self, begin: float, end: float) -> float:
        """Largest error of the filter's altitude [m]."""
        return max(
            abs(solution.alt - self.truth(t)) for t, solution in self.filtered if solution.alt and begin <= t < end
        )

    def worst(self, radar: str, begin: float, end: float) -> float:
        """Largest error of the valid heights of an altimeter, in their sigmas."""
        valid = [height for height in self.of(radar, begin, end) if height.valid]
        return max((abs((h.height_agl or 0.0) - HEIGHT) / h.sd for h in valid if h.sd), default=0.0)

    def texts(self, begin: float) -> list[tuple[str, str]]:
        """Level and text of the events of navigation about the altitude."""
        return [(e.level, e.text) for t, e in self.events if t >= begin and e.text.startswith("altitude: ")]

    def truth(self, t: float) -> float:
        """Altitude that is flown [m]: the terrain is a plane of the frame, the ellipsoid falls off beside it."""
        return float(self.ground.terrain.frame.to_geodetic(np.array([[0.0, SPEED * t - 4000.0, HEIGHT]]))[2][0])


def fly(
    ground: Ground, wrong: dict[str, Wrong], seconds: float, lost_s: tuple[float, float] = NEVER, gate_m: float = 10.0
) -> FlightResult:
    """A flight.  lost_s : without satellites from then until then [s]; gate_m : of the deviation of radars"""
    pipeline, found = Pipeline(config(tuple(wrong), gate_m), None), FlightResult(ground)
    pipeline.set_terrain(ground)
    for device, m in _measured(ground, wrong, seconds, lost_s):
        t = (m.stamp.t_rx_ns - T0) / S
        _collect(found, t, pipeline.feed(device, m))
        if isinstance(m, ImuSample):
            _collect(found, t, pipeline.tick(m.stamp.t_rx_ns))
    return found


def _measured(
    ground: Ground, wrong: dict[str, Wrong], seconds: float, lost_s: tuple[float, float]
) -> Iterator[tuple[str, Measurement]]:
    rng = np.random.default_rng(2)
    for k in range(round(seconds * S / STEP_NS)):
        t, stamp = k * STEP_NS / S, Stamp(T0 + k * STEP_NS)
        accel, turn = rng.normal(0.0, 5e-3), rng.normal(0.0, 1e-4, 2)
        if k % 5 == 0 and not lost_s[0] <= t < lost_s[1]:
            point = np.array([[0.0, SPEED * t - 4000.0, HEIGHT + rng.normal(0.0, 0.5)]])
            lat, lon, alt = (float(v[0]) for v in ground.terrain.frame.to_geodetic(point))
            yield "gnss", Position(stamp=stamp, lat=lat, lon=lon, alt=alt, horizontal_sd=1.5, vertical_sd=2.5)
            yield "gnss", Velocity(stamp=stamp, north=SPEED, east=0.0, down=0.0, sd=0.1)
        if t < 30.0:
            yield "imu", Attitude(stamp=stamp, roll=0.0, pitch=0.0, heading=0.0)
        rates = EARTH_RATE * math.cos(LAT) + turn[0], -SPEED / RADIUS + turn[1], -EARTH_RATE * math.sin(LAT)
        force = accel, 2.0 * EARTH_RATE * math.sin(LAT) * SPEED, -GRAVITY
        yield "imu", ImuSample(stamp=stamp, accel_b=force, gyro_b=rates)
        if k % 3 == 0:
            for radar, fault in wrong.items():
                yield radar, RadioHeight(stamp=stamp, height_agl=HEIGHT + rng.normal(0.0, 0.3) + fault(t))


def _collect(flight: FlightResult, t: float, out: list[Output | Event]) -> None:
    for o in out:
        if isinstance(o, HeightAboveGround):
            flight.heights.append((t, o))
        elif isinstance(o, FilterSolution) and o.valid:
            flight.filtered.append((t, o))
        elif isinstance(o, Event) and "clock" not in o.source:
            flight.events.append((t, o))


def test_an_altimeter_that_the_filter_excludes_is_not_valid_until_it_agrees_again(ground: Ground) -> None:
    """30 m too much at first, within a gate of 50 m; from 40 s on 1 m/s less: no step that its changes show."""
    biased = {"radar": lambda t: min(30.0, max(0.0, 70.0 - t))}
    flight = fly(ground, biased, 120.0, gate_m=50.0)
    excluded = [t for t, height in flight.heights if Reason.EXCLUDED in height.reasons]
    assert excluded[0] < 8.0
    assert not any(height.valid for height in flight.of("radar", 8.0, 60.0))
    assert flight.altitude_error(20.0, 120.0) < 2.0
    assert excluded[-1] < 115.0
    assert all(height.valid for height in flight.of("radar", 115.0, 120.0))
    solution = flight.of("radar", 8.0, 30.0)
    assert all(height.height_agl and height.height_agl > 125.0 and height.sd for height in solution), (
        "its value is stated"
    )


def test_a_sound_altimeter_beside_satellites_is_never_refused(ground: Ground) -> None:
    flight = fly(ground, {"radar": lambda t: 0.0}, 60.0)
    assert {height.reasons for height in flight.of("radar", 1.0, 60.0)} == {()}


def sound(t: float) -> float:
    """An altimeter without an error."""
    return 0.0


def drifting(rate: float) -> Wrong:
    """An altimeter that drifts from 45 s on [m/s]."""
    return lambda t: rate * max(0.0, t - 45.0)


LOST = (40.0, math.inf)
HELD = ("warning", "altitude: held by radar alone; a slow drift of its heights is not detected")


@pytest.mark.parametrize("rate", [0.5, -1.0])
def test_a_height_that_is_compared_with_itself_has_a_reason(ground: Ground, rate: float) -> None:
    """Up to 1 m/s the altitude follows and nothing is refused: an event and each height say what is not checked."""
    flight = fly(ground, {"radar": drifting(rate)}, 100.0, LOST)
    assert flight.texts(0.0) == [HELD]
    assert flight.altitude_error(90.0, 100.0) > 10.0, "it follows"
    heights = flight.of("radar", 46.0, 100.0)
    compared = [height for height in heights if height.predicted is not None]
    assert len(compared) > 0.9 * len(heights)
    assert all(Reason.NOT_INDEPENDENT in height.unchecked for height in compared)


def test_a_sound_altimeter_that_holds_the_altitude_stays_valid(ground: Ground) -> None:
    flight = fly(ground, {"radar": sound}, 100.0, LOST)
    assert {height.reasons for height in flight.of("radar", 1.0, 100.0)} == {()}
    assert flight.worst("radar", 1.0, 100.0) < 3.0
    assert flight.altitude_error(5.0, 100.0) < 2.5
    assert flight.texts(0.0) == [HELD]


def test_a_loss_of_satellites_of_a_second_changes_nothing(ground: Ground) -> None:
    flight = fly(ground, {"radar": sound}, 60.0, (40.0, 41.0))
    assert flight.texts(0.0) == []
    assert not any(Reason.NOT_INDEPENDENT in height.unchecked for height in flight.of("radar", 5.0, 60.0))


def test_when_satellites_come_back_the_comparison_is_independent_again(ground: Ground) -> None:
    again = fly(ground, {"radar": sound}, 80.0, (40.0, 60.0))
    assert again.texts(0.0) == [HELD, ("info", "altitude: not held by altimeters alone any more")]
    assert not any(height.unchecked for height in again.of("radar", 62.0, 80.0))


def test_a_jump_of_the_altimeter_that_holds_the_altitude_is_refused(ground: Ground) -> None:
    flight = fly(ground, {"radar": lambda t: 30.0 if t >= 90.0 else 0.0}, 94.0, LOST)
    assert all(Reason.DEVIATION in height.reasons for height in flight.of("radar", 90.0, 94.0))


def test_of_two_altimeters_that_hold_the_altitude_the_one_that_drifts_is_refused(ground: Ground) -> None:
    """1 m/s is 10 m apart after 10 s: both are compared with the sigmas of the instruments and of the filter."""
    flight = fly(ground, {"radar": drifting(1.0), "radar2": sound}, 80.0, LOST)
    both = "altitude: held by radar and radar2 alone; a slow drift of all of them is not detected"
    assert flight.texts(0.0) == [("warning", both), ("warning", HELD[1].replace("radar", "radar2"))]
    assert any(Reason.ALTIMETERS_DISAGREE in height.reasons for height in flight.of("radar", 45.0, 60.0))
    assert not any(height.valid for height in flight.of("radar", 60.0, 80.0))
    assert all(height.valid for height in flight.of("radar2", 60.0, 80.0))
    assert flight.altitude_error(60.0, 80.0) < 5.0
