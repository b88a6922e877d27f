"""The filter and the vertical channel in the pipeline: they replace silent devices, and report it."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs
from msgspec.structs import replace

from fti.config import Config, parse
from fti.geodesy.formulas import EARTH_RATE
from fti.geodesy.local import LocalFrame
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.messages.measurements import Attitude, DmeRange, ImuSample, Measurement, Position, Range, Stamp, Velocity
from fti.messages.outputs import (
    Compensation,
    Event,
    FilterMode,
    FilterSolution,
    HeightAboveGround,
    NavSolution,
    Output,
    PositionFix,
    VerticalSolution,
)
from fti.messages.reasons import Reason
from fti.nav.filter.aiding import TerrainAltitude
from fti.nav.filter.error_states import DEM_DRIFT
from fti.nav.inertial_aiding import AidedNavigation
from fti.nav.navigation import NavState
from fti.nav.pipeline import Pipeline
from fti.nav.source_interpolation import PositionState
from fti.nav.terrain_reference import Ground
from fti.terrain.terrain import Terrain

MS, S = 1_000_000, 1_000_000_000
T0 = 1_000 * S
LAT, ALT, SPEED, RADIUS = 0.8, 500.0, 60.0, 6_366_000.0
GRAVITY = 9.80721  # normal gravity at LAT and ALT [m/s^2]
GROUND_UP = 300.0


def config(**nav: Any) -> Config:
    device = {"link": "l", "driver": "d"}
    table: dict[str, Any] = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [
            {"name": "imu", "max_age_ms": 300.0, **device},
            {"name": "gnss", "max_age_ms": 500.0, **device},
            {"name": "laser", "altimeter": {"kind": "laser", "range_m": [1.0, 700.0], "sd_m": 0.1}, **device},
        ],
        "nav": {
            "attitude": ["imu"],
            "position": ["gnss"],
            "altimeters": ["laser"],
            "filter": {"imu": "imu", "gnss": ["gnss"], "altimeters": ["laser"]},
            **nav,
        },
    }
    return parse(table, "", Path("t.toml"))


def latitude(t: float) -> float:
    """Latitude after t seconds of level flight to the north."""
    return LAT + SPEED * t / RADIUS


def measurements(k: int, *, gnss: bool, alt: bool = True) -> list[tuple[str, Measurement]]:
    """What arrives in step k of 10 ms."""
    t = 0.01 * k
    stamp = Stamp(T0 + k * 10 * MS)
    turn = (EARTH_RATE * math.cos(LAT), -SPEED / RADIUS, -EARTH_RATE * math.sin(LAT))
    lift = GRAVITY - SPEED**2 / RADIUS
    force = (0.0, 2.0 * EARTH_RATE * math.sin(LAT) * SPEED, -lift)
    rows: list[tuple[str, Measurement]] = [
        ("imu", ImuSample(stamp=stamp, accel_b=force, gyro_b=turn)),
        ("imu", Attitude(stamp=stamp, roll=0.0, pitch=0.0, heading=0.0)),
    ]
    if gnss and k % 20 == 0:
        height = ALT if alt else None
        rows += [
            ("gnss", Position(stamp=stamp, lat=latitude(t), lon=0.2, alt=height, horizontal_sd=1.0, vertical_sd=1.5)),
            ("gnss", Velocity(stamp=stamp, north=SPEED, east=0.0, down=0.0 if alt else None, sd=0.05)),
        ]
    if k % 5 == 0:
        rows.append(("laser", Range(stamp=stamp, slant_range=ALT - GROUND_UP)))
    return rows


def level() -> Ground:
    """Ground GROUND_UP above the ellipsoid, as far as is flown."""
    frame = LocalFrame(LAT, 0.2, 0.0)
    posts = 200.0 * (np.arange(61) - 30.0)
    bulge = (posts[:, None] ** 2 + posts[None, :] ** 2) / (2.0 * RADIUS)
    terrain = Terrain.from_array(GROUND_UP - bulge, 200.0, lat0=LAT, lon0=0.2, east0=-6000.0, north0=-6000.0)
    assert terrain.frame == frame
    return Ground(terrain, 1.0, "level")


def fly(pipeline: Pipeline, first: int, last: int, **how: bool) -> list[Output | Event]:
    out: list[Output | Event] = []
    for k in range(first, last):
        for device, m in measurements(k, **how):
            out += pipeline.feed(device, m)
        if k % 2 == 0:
            out += pipeline.tick(T0 + k * 10 * MS)
    return out


@pytest.fixture(scope="module")
def flight() -> tuple[list[Output | Event], list[Output | Event]]:
    """Eight seconds with GNSS and six without."""
    pipeline = Pipeline(config(), None)
    pipeline.set_terrain(level())
    return fly(pipeline, 0, 800, gnss=True), fly(pipeline, 800, 1400, gnss=False)


Flight = tuple[list[Output | Event], list[Output | Event]]


def test_with_gnss_the_devices_are_used_and_the_filter_is_aided(flight: Flight) -> None:
    with_gnss, _ = flight
    solutions = [o for o in with_gnss if isinstance(o, NavSolution)]
    filtered = [o for o in with_gnss if isinstance(o, FilterSolution)]
    assert {o.position_source for o in solutions[10:]} == {"gnss"}
    assert filtered[-1].mode is FilterMode.AIDED
    assert filtered[-1].valid


def test_without_gnss_the_filter_takes_over_and_reports_it(flight: Flight) -> None:
    _, without = flight
    last = [o for o in without if isinstance(o, NavSolution)][-1]
    assert (last.position_source, last.altitude_source, last.valid) == ("filter", "filter", True)
    assert last.lat is not None
    assert abs(last.lat - latitude(13.98)) * RADIUS < 5.0
    assert last.alt == pytest.approx(ALT, abs=3.0)
    texts = [o.text for o in without if isinstance(o, Event)]
    text = "altitude: held by laser alone; a slow drift of its heights is not detected"
    assert texts == ["position: from filter instead of gnss", text]
    mode = [o for o in without if isinstance(o, FilterSolution)][-1]
    assert (mode.mode, mode.reasons) == (FilterMode.COASTING, (Reason.COASTING,))


def test_the_altimeter_over_known_ground_keeps_the_height(flight: Flight) -> None:
    with_gnss, without = flight
    vertical = [o for o in without if isinstance(o, VerticalSolution)][-1]
    assert vertical.valid
    assert vertical.altimeter == "laser"
    assert vertical.alt == pytest.approx(ALT, abs=3.0)
    filtered = [o for o in without if isinstance(o, FilterSolution)][-1]
    assert filtered.vertical_sd is not None
    before = [o for o in with_gnss if isinstance(o, FilterSolution)][-1]
    assert before.vertical_sd is not None
    assert filtered.vertical_sd < before.vertical_sd + 0.1, "what satellites had found of the altimeter still holds"


def states(k: int, level_sd: float, high_sd: float) -> list[tuple[str, Measurement]]:
    """As ``measurements``, with other sigmas of the positions."""
    return [
        (device, structs.replace(m, horizontal_sd=level_sd, vertical_sd=high_sd) if isinstance(m, Position) else m)
        for device, m in measurements(k, gnss=True)
    ]


def test_fixes_that_err_together_are_not_averaged_away() -> None:
    """A receiver that states 6 m and 8 m, five times a second for ten seconds: as good as one fix, not as fifty."""
    pipeline, out = Pipeline(config(filter={"imu": "imu", "gnss": ["gnss"]}), None), list[Output | Event]()
    for k in range(1000):
        for device, m in states(k, 6.0, 8.0):
            pipeline.feed(device, m)
        if k % 2 == 0:
            out += pipeline.tick(T0 + k * 10 * MS)
    last = [o for o in out if isinstance(o, FilterSolution)][-1]
    assert last.horizontal_sd == pytest.approx(6.0, rel=0.1)
    assert last.vertical_sd == pytest.approx(8.0, rel=0.1)


def test_an_elevation_model_is_as_wrong_the_next_second() -> None:
    """Ground of 8 m without accurate satellite heights: ten altitudes above it do not determine the height to 3 m."""
    pipeline, out = Pipeline(config(), None), list[Output | Event]()
    pipeline.set_terrain(dataclasses.replace(level(), sd=8.0))
    for k in range(1000):
        for device, m in states(k, 1.0, 500.0):
            pipeline.feed(device, m)
        if k % 2 == 0:
            out += pipeline.tick(T0 + k * 10 * MS)
    last = [o for o in out if isinstance(o, FilterSolution)][-1]
    assert last.vertical_sd is not None
    assert 10.0 < last.vertical_sd < 16.0  # 10 m of bias, 3 % of 200 m, and 600 m of errors of 8 m that last 300 m


def test_an_old_climb_is_not_used() -> None:
    """A receiver with a last climb of 0.8 m/s that then sends heights only: the flight is level."""
    pipeline, out = Pipeline(config(filter={"imu": "imu", "gnss": ["gnss"]}), None), list[Output | Event]()
    for k in range(1000):
        for device, m in measurements(k, gnss=True):
            if isinstance(m, Velocity) and k > 300:
                continue
            pipeline.feed(device, structs.replace(m, down=-0.8) if isinstance(m, Velocity) and k == 300 else m)
        if k % 2 == 0:
            out += pipeline.tick(T0 + k * 10 * MS)
    last = [o for o in out if isinstance(o, VerticalSolution)][-1]
    assert last.vel_down == pytest.approx(0.0, abs=0.2)


def test_the_output_of_the_filter_includes_all_measurements() -> None:
    """Its solution is cached for the same time, until the next measurement."""
    settings = config().nav.filter
    assert settings is not None
    aided, changed = AidedNavigation(settings, {device.name: device for device in config().device}), 0
    for k in range(400):
        t_ns = T0 + k * 10 * MS
        for device, m in measurements(k, gnss=True):
            before = aided.solution(t_ns)
            aided.feed(device, m, t_ns)
            assert replace(aided.solution(t_ns), hpl=None, vpl=None) == aided._navigator.output(t_ns)
            assert aided.solution(t_ns) is aided.solution(t_ns)
            changed += before != aided.solution(t_ns)
    assert changed > 20


def test_a_filter_without_gnss_waits_and_reports_the_reason() -> None:
    out = fly(Pipeline(config(), None), 0, 30, gnss=False)
    last = [o for o in out if isinstance(o, FilterSolution)][-1]
    assert (last.mode, last.valid) == (FilterMode.WAITING, False)
    assert Reason.NO_GNSS in last.reasons
    assert [o for o in out if isinstance(o, VerticalSolution)][-1].reasons == (Reason.NO_IMU,)


def test_a_height_that_nobody_gives_any_more_comes_from_the_vertical_channel() -> None:
    pipeline = Pipeline(config(filter={"imu": "imu", "altimeters": ["laser"]}), None)
    pipeline.set_terrain(level())
    out = fly(pipeline, 0, 500, gnss=True, alt=False)  # it begins with a height a second, and is confirmed by two
    last = [o for o in out if isinstance(o, NavSolution)][-1]
    assert (last.position_source, last.altitude_source) == ("gnss", "vertical")
    assert last.alt == pytest.approx(ALT, abs=3.0)
    assert "altitude: from the vertical channel" in [o.text for o in out if isinstance(o, Event)]


def test_a_climb_is_less_certain_than_the_mean_of_three_axes() -> None:
    """Satellites everywhere above 5 degrees: sin E is uniform, and the receiver's clock is unknown."""
    low = math.sin(math.radians(5.0))
    level, up = (1.0 - (1.0 + low + low**2) / 3.0) / 2.0, (1.0 - low) ** 2 / 12.0  # information on each axis
    factor = math.sqrt((1.0 / up) / ((2.0 / level + 1.0 / up) / 3.0))
    out = fly(Pipeline(config(), None), 0, 60, gnss=True)
    last = [o for o in out if isinstance(o, VerticalSolution)][-1]
    assert last.vel_down_sd == pytest.approx(0.05 * factor, rel=0.05)


def test_without_a_filter_in_the_configuration_there_is_none() -> None:
    out = fly(Pipeline(config(filter=None), None), 0, 100, gnss=True)
    assert not [o for o in out if isinstance(o, FilterSolution | VerticalSolution)]
    assert [o for o in out if isinstance(o, NavSolution)][-1].valid


STATIONS = {"AAA": (0.79, 0.19), "BBB": (0.80, 0.22), "CCC": (0.815, 0.195)}


def radio_config() -> Config:
    station = {name: {"lat_deg": math.degrees(lat), "lon_deg": math.degrees(lon), "alt_m": 400.0}
               for name, (lat, lon) in STATIONS.items()}  # fmt: skip
    return config(filter=None, radio={"receiver": "gnss", "station": station, "altimeter": "laser"})


def ranges(k: int) -> list[tuple[str, Measurement]]:
    here = ecef_from_geodetic(latitude(0.01 * k), 0.2, ALT)
    return [
        ("dme", DmeRange(stamp=Stamp(T0 + k * 10 * MS), station=name, slant_range=math.dist(here, there)))
        for name, place in STATIONS.items()
        for there in [ecef_from_geodetic(*place, 400.0)]
    ]


def test_dme_and_an_altimeter_over_known_ground_give_a_position_when_satellites_are_gone() -> None:
    pipeline = Pipeline(radio_config(), None)
    pipeline.set_terrain(level())
    out = fly(pipeline, 0, 100, gnss=True)
    assert {o.altitude_source for o in out if isinstance(o, PositionFix) and o.valid} == {"altimeter"}
    for k in range(100, 600):
        for device, m in [*measurements(k, gnss=False), *(ranges(k) if k % 50 == 0 else [])]:
            out += pipeline.feed(device, m)
        if k % 2 == 0:
            out += pipeline.tick(T0 + k * 10 * MS)
    fix = [o for o in out if isinstance(o, PositionFix)][-1]
    assert (fix.valid, fix.reasons) == (True, ())
    assert fix.lat is not None
    assert abs(fix.lat - latitude(5.98)) * RADIUS < 50.0
    assert fix.horizontal_sd is not None
    assert 50.0 < fix.horizontal_sd < 500.0
    last = [o for o in out if isinstance(o, NavSolution)][-1]
    assert last.position_source == "radio"
    texts = [o.text for o in out if isinstance(o, Event)]
    assert "position: from radio instead of gnss" in texts
    assert "altitude: held by laser alone; a slow drift of its heights is not detected" in texts


def test_hostile_measurements_raise_nothing_and_all_outputs_are_finite() -> None:
    pipeline = Pipeline(config(), None)
    pipeline.set_terrain(level())
    fly(pipeline, 0, 200, gnss=True)
    nan, huge = math.nan, 1e300
    out: list[Output | Event] = []
    for k, value in enumerate((nan, math.inf, -math.inf, huge, -huge)):
        for step in (-50_000, 0, 0, 3):  # from long ago, twice, a little later
            stamp = Stamp(T0 + (2000 + 20 * k + step) * MS)
            hostile: list[tuple[str, Measurement]] = [
                ("imu", ImuSample(stamp=stamp, accel_b=(value, 0.0, 0.0), gyro_b=(0.0, value, 0.0))),
                ("imu", Attitude(stamp=stamp, roll=value, pitch=math.pi / 2, heading=value)),
                ("gnss", Position(stamp=stamp, lat=value, lon=value, alt=value, horizontal_sd=value)),
                ("gnss", Position(stamp=stamp, lat=math.pi / 2, lon=math.pi, alt=0.0, vertical_sd=0.0)),
                ("gnss", Velocity(stamp=stamp, north=value, east=value, down=value, sd=value)),
                ("laser", Range(stamp=stamp, slant_range=value, sd=value)),
            ]
            for device, m in hostile:
                out += pipeline.feed(device, m)
            out += pipeline.tick(stamp.t_rx_ns)
    for o in out:
        for name in ("lat", "alt", "vertical_sd", "vel_down", "height_agl", "sd", "nearest", "predicted"):
            number = getattr(o, name, None)
            assert number is None or math.isfinite(number), (name, o)


@pytest.mark.parametrize(("place_sd", "ground_sd"), [(100.0, 20.0), (0.1, 1.0)])
def test_on_a_slope_the_ground_is_as_uncertain_as_the_place(
    monkeypatch: pytest.MonkeyPatch, place_sd: float, ground_sd: float
) -> None:
    """Coasting, a sigma of 100 m over a slope of 0.2: the altitude of an altimeter is not accurate to 2 m."""
    posts = 100.0 + 0.2 * np.arange(0.0, 4001.0, 20.0)[:, None] + np.zeros((1, 201))
    terrain = Terrain.from_array(posts, 20.0, lat0=LAT, lon0=0.2, east0=-2000.0, north0=-2000.0)
    settings = config().nav.filter
    assert settings is not None
    aided = AidedNavigation(settings, {device.name: device for device in config().device})
    aided.set_terrain(Ground(terrain, 1.0, "slope"))
    aidings: list[TerrainAltitude] = []
    monkeypatch.setattr(aided._navigator, "feed_aiding", lambda t_ns, aiding: aidings.append(aiding))
    position = PositionState(LAT, 0.2, 700.0, place_sd, 1.0, 60.0, 0.0, 0.0, T0)
    height = HeightAboveGround(
        t_ns=T0,
        t_valid_ns=T0,
        sensor="laser",
        raw=200.0,
        height_agl=200.0,
        sd=9.0,
        valid=True,
        reasons=(),
        compensation=Compensation.ATTITUDE,
        nearest=200.0,
        nearest_sd=0.5,
    )
    aided.feed_height(height, NavState(T0, None, position, None, "filter"))
    assert aidings[0].alt == pytest.approx(700.0, abs=0.1)
    assert aidings[0].dem_factor * DEM_DRIFT.sd == pytest.approx(max(ground_sd, DEM_DRIFT.sd), rel=0.01)
