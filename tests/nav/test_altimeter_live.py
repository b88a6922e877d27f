"""One altimeter through the pipeline: its error against the truth of the flight, while its height is called valid."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from fti.config import parse
from fti.messages.measurements import Attitude, Position, Range, Stamp, Velocity
from fti.messages.outputs import Event, HeightAboveGround, Output
from fti.nav.pipeline import Pipeline
from fti.nav.terrain_reference import Ground
from fti.terrain.terrain import Terrain

S = 1_000_000_000
T0 = 1000 * S
LAT0, LON0, CELL_M, CELLS = math.radians(48.0), math.radians(11.5), 10.0, 400
Profile = Callable[[float], float]


def level(value: float) -> Profile:
    return lambda t: value


LEVEL_200_M, NO_ROLL = level(200.0), level(0.0)


def hills(north: float) -> float:
    """Along the track [m]."""
    return 20.0 * math.sin(north / 120.0)


@dataclass(frozen=True, kw_only=True)
class Flight:
    """Northwards from 1700 m south of the origin.

    measured(t, north) : the range that the laser states [m];  up, roll : altitude [m] and roll [rad] of the time [s]
    attitude_until_s   : then the attitude is missing
    """

    seconds: float
    measured: Callable[[float, float], float]
    up: Profile = LEVEL_200_M
    roll: Profile = NO_ROLL
    speed: float = 50.0
    hz: int = 20
    attitude_until_s: float = math.inf
    attitude_hz: int = 20
    laser: dict[str, object] = field(default_factory=dict)

    def pipeline(self) -> Pipeline:
        device = {"link": "l", "driver": "d"}
        laser = {"kind": "laser", "range_m": [0.5, 500.0], "sd_m": 0.1, **self.laser}
        table = {
            "session": {"name": "t"},
            "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
            "device": [{"name": "ins", **device}, {"name": "laser", "altimeter": laser, **device}],
            "nav": {"attitude": ["ins"], "position": ["ins"], "altimeters": ["laser"]},
        }
        return Pipeline(parse(table, "", Path("t.toml")), None)

    def fly(
        self, ground: Callable[[float], float] | None = None
    ) -> Iterator[tuple[float, float, list[Output | Event]]]:
        """Time [s], north [m] and outputs.  ground : known height by north [m]; None: nobody knows it"""
        pipeline, frame = self.pipeline(), terrain(lambda north: 0.0).frame
        if ground is not None:
            pipeline.set_terrain(Ground(terrain(ground), 1.0, "test"))
        for k in range(round(self.seconds * self.hz)):
            t, t_ns = k / self.hz, T0 + k * S // self.hz
            north = -1700.0 + self.speed * t
            lat, lon, alt = (float(x[0]) for x in frame.to_geodetic(np.array([[0.0, north, self.up(t)]])))
            stamp, down = Stamp(t_ns), (self.up(t) - self.up(t + 0.01)) / 0.01
            out: list[Output | Event] = []
            if t <= self.attitude_until_s and k % (self.hz // self.attitude_hz) == 0:
                attitude = Attitude(
                    stamp=stamp, roll=self.roll(t), pitch=0.0, heading=0.0, roll_sd=0.003, pitch_sd=0.003
                )
                out += pipeline.feed("ins", attitude)
            out += pipeline.feed(
                "ins", Position(stamp=stamp, lat=lat, lon=lon, alt=alt, horizontal_sd=1.0, vertical_sd=2.0)
            )
            out += pipeline.feed("ins", Velocity(stamp=stamp, north=self.speed, east=0.0, down=down, sd=0.1))
            out += pipeline.feed("laser", Range(stamp=stamp, slant_range=self.measured(t, north)))
            yield t, north, [*out, *pipeline.tick(t_ns)]


def terrain(height: Callable[[float], float]) -> Terrain:
    """Of the track's north alone."""
    half = CELLS * CELL_M / 2
    rows = np.array([height(k * CELL_M - half) for k in range(CELLS)])
    heights = np.repeat(rows[:, None], CELLS, axis=1)
    return Terrain.from_array(heights, CELL_M, lat0=LAT0, lon0=LON0, east0=-half, north0=-half)


def heights(out: list[Output | Event]) -> Iterator[HeightAboveGround]:
    return (o for o in out if isinstance(o, HeightAboveGround) and o.sensor == "laser")


def rounded_noise(seed: int, sd: float = 0.1) -> Callable[[float], float]:
    """A laser that states centimetres."""
    rng = np.random.default_rng(seed)
    return lambda value: round(value + rng.normal(0.0, sd), 2)


def test_an_offset_that_remains_inside_the_gate_is_in_the_sigma() -> None:
    """2 m/s to 9 m from 20 s on: refused from 25 s, proved in 10 s over hills; healthy again from 60 s on."""
    noise = rounded_noise(3)
    wrong: Profile = lambda t: min(2.0 * max(0.0, t - 20.0), 9.0) if t < 55.0 else 0.0  # noqa: E731
    flight = Flight(
        seconds=68.0,
        measured=lambda t, north: noise(200.0 - hills(north) + wrong(t)),
        laser={"max_deviation_m": 20.0},
    )
    found = [(t, 200.0 - hills(north), h) for t, north, out in flight.fly(hills) for h in heights(out)]
    assert any(h.reasons for t, _, h in found if t < 30.0)
    assert all(h.valid for t, _, h in found if t >= 40.0)
    for t, true, h in found:
        assert h.height_agl is not None
        assert h.sd is not None
        assert h.nearest_sd is not None
        if t >= 26.0 and h.valid:
            assert abs(h.height_agl - true) <= 3.0 * h.sd
            assert abs((h.nearest or 0.0) - true) <= 3.0 * h.nearest_sd
        if t < 20.0 or t > 66.0:  # the window of scatter is 10 s long
            assert h.sd < 0.5


def test_after_60_s_without_known_ground_the_end_of_a_mismatch_has_its_cause() -> None:
    noise = rounded_noise(4)
    wrong: Profile = lambda t: min(2.0 * max(0.0, t - 10.0), 30.0)  # noqa: E731
    edge = -1700.0 + 50.0 * 30.0
    flight = Flight(
        seconds=95.0,
        hz=10,
        attitude_hz=10,
        measured=lambda t, north: noise(200.0 + wrong(t) - (hills(north) if north < edge else 0.0)),
        laser={"max_deviation_m": 50.0},
    )
    rows = list(flight.fly(lambda north: hills(north) if north < edge else math.nan))
    texts = [o.text for t, _, out in rows for o in out if isinstance(o, Event) and o.source == "laser"]
    assert len(texts) == 2
    assert texts[1].endswith("s the known ground has been missing for 60 s")
    valid = [(t, h) for t, _, out in rows if t > 20.0 for h in heights(out) if h.valid]
    assert valid[0][0] == pytest.approx(90.0, abs=1.0)
    for _, h in valid:
        assert h.height_agl is not None
        assert h.sd is not None
        assert abs(h.height_agl - 200.0) <= 3.0 * h.sd


def test_a_laser_stuck_in_level_flight_over_unknown_hills_has_a_sigma_that_covers_its_error() -> None:
    noise, held = rounded_noise(1), [0.0]

    def measured(t: float, north: float) -> float:
        held[0] = noise(200.0 - hills(north)) if t < 25.0 else held[0]
        return held[0]

    flight = Flight(seconds=75.0, hz=10, attitude_hz=10, measured=measured)
    for t, north, out in flight.fly():
        for h in heights(out):
            assert h.valid
            assert h.height_agl is not None
            assert h.sd is not None
            if not 25.0 <= t < 27.3:
                assert abs(h.height_agl - 200.0 + hills(north)) <= 3.0 * h.sd
            if 5.5 < t < 25.0:
                assert h.sd < 5.0, "of a sound one as before"


def test_a_laser_that_hovers_beside_a_slope_has_a_sigma_that_covers_its_error() -> None:
    """It looks 8 deg towards a slope of 0.3 that rises: 4 m short of the 100 m straight below."""
    noise, tilt = rounded_noise(2), math.radians(8.0)
    slant_range = 100.0 / (math.cos(tilt) + 0.3 * math.sin(tilt))
    flight = Flight(
        seconds=30.0, hz=10, attitude_hz=10, speed=0.1, roll=level(tilt), measured=lambda t, north: noise(slant_range)
    )
    for _, _, out in flight.fly():
        for h in heights(out):
            assert h.height_agl is not None
            assert h.sd is not None
            assert abs(h.height_agl - 100.0) <= 3.0 * h.sd


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize("bank_deg", [0.0, 5.0, 10.0])
def test_a_roll_while_the_attitude_is_missing_is_in_the_sigma(bank_deg: float, known: bool) -> None:
    """30 deg/s from 10 s on, and no attitude after it: the laser is 46 m too long after 1 s, and 5 m after 0.35 s."""
    noise = rounded_noise(3)
    roll: Profile = lambda t: math.radians(bank_deg + 30.0 * min(max(0.0, t - 10.0), 1.0))  # noqa: E731
    flight = Flight(
        seconds=12.0,
        roll=roll,
        attitude_until_s=10.0,
        measured=lambda t, north: noise(200.0 / math.cos(roll(t))),
    )
    found = [(t, h) for t, _, out in flight.fly((lambda north: 0.0) if known else None) for h in heights(out)]
    assert not any(h.valid for t, h in found if t > 11.1)
    for _, h in found:
        if h.valid:
            assert h.height_agl is not None
            assert h.sd is not None
            assert abs(h.height_agl - 200.0) <= 3.0 * h.sd + 0.3, "the noise of the laser besides"


@pytest.mark.parametrize("attitude_hz", [20, 10])
def test_an_attitude_that_comes_in_time_leaves_the_sigma_as_it_is(attitude_hz: int) -> None:
    """A bank of 20 deg, 0.1 m and 0.17 deg of tilt; at 10 Hz half of the samples have an attitude that is 50 ms old."""
    noise = rounded_noise(5)
    roll = math.radians(20.0)
    flight = Flight(
        seconds=6.0, roll=level(roll), attitude_hz=attitude_hz, measured=lambda t, north: noise(200.0 / math.cos(roll))
    )
    for _, _, out in flight.fly():
        for h in heights(out):
            assert h.valid
            assert h.nearest_sd is not None
            expected = math.hypot(0.1 * math.cos(roll), 200.0 * math.tan(roll) * 0.003)
            fresh = h.nearest_sd == pytest.approx(expected, rel=0.05)
            assert fresh or attitude_hz == 10
