"""The satellites of the emulator and what a receiver makes of them: orbits, ranges, clock, a fix from its ranges."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from fti import drivers
from fti.config import Device
from fti.constants import SPEED_OF_LIGHT
from fti.devices import BoundDevice
from fti.drivers import ublox_ubx
from fti.drivers.ublox_ubx.raw import frequency_id
from fti.geodesy.formulas import EARTH_RATE
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.hil.environment import Environment
from fti.hil.sensors import SimulatedSensor
from fti.hil.sensors.constellation import GLONASS_CHANNELS, SYSTEMS, Constellation, dilution
from fti.hil.sensors.gnss import RawReceiver
from fti.hil.sensors.gnss_reception import sky_start_s
from fti.messages.measurements import (
    Measurement,
    Position,
    Pseudoranges,
    ReceiverClock,
    Satellites,
    TimeScale,
    Velocity,
)
from tests.hil.worlds import world

START_NS = 1_700_000_000_000_000_000
GPS_EPOCH_NS, LEAP_NS = 315_964_800 * 10**9, 18 * 10**9
SIDEREAL_DAY_S = 86_164.1
Array = NDArray[np.float64]


@cache
def environment() -> Environment:
    return world(duration_s=30.0)


def receiver(seed: int = 1) -> SimulatedSensor:
    device = Device.model_validate({"name": "gnss", "link": "line", "driver": "ublox_ubx", "rate_hz": 2})
    return SimulatedSensor(
        BoundDevice(device, drivers.load("ublox_ubx"), ublox_ubx.Options()), RawReceiver, environment(), seed
    )


def measured(sensor: SimulatedSensor) -> list[Measurement]:
    return [m for k in range(len(sensor.t)) for m in sensor.measure(k, START_NS)]


def test_orbits_have_their_period_and_inclination() -> None:
    sky = Constellation()
    first = [sky.keys.index((w.system, 1)) for w in SYSTEMS]
    start, moving = sky.state(0.0)
    np.testing.assert_allclose(sky.state(SIDEREAL_DAY_S / 2)[0][first[0]], start[first[0]], atol=2e4)  # GPS: half a day
    for index, walker in zip(first, SYSTEMS, strict=True):
        normal = np.cross(start[index], moving[index])
        assert math.acos(normal[2] / np.linalg.norm(normal)) == pytest.approx(walker.inclination)
    after, before = sky.state(0.5)[0], sky.state(-0.5)[0]
    np.testing.assert_allclose(after - before, moving, atol=1e-3)


def test_every_place_sees_enough_satellites_of_each_system() -> None:
    sky = Constellation()
    for lat in np.deg2rad([-80.0, -30.0, 0.0, 50.0]):
        here, mat = ecef_from_geodetic(lat, 0.3, 100.0), mat_en(lat, 0.3)
        views = sky.satellites_in_view(3000.0, here, np.zeros(3), mat, np.deg2rad(10.0))
        assert 12 <= len(views.which) <= 40
        assert {sky.keys[i][0] for i in views.which} == {"gps", "glonass", "galileo"}
        assert dilution(views.azimuth, views.elevation)[2] < 2.5


def test_the_rate_is_how_the_range_changes() -> None:
    sky, mat = Constellation(), mat_en(0.8, 0.2)
    here, moving = ecef_from_geodetic(0.8, 0.2, 1000.0), mat @ np.array([60.0, -30.0, 2.0])
    before, now, after = (
        sky.satellites_in_view(5000.0 + dt, here + moving * dt, moving, mat, 0.2) for dt in (-0.5, 0.0, 0.5)
    )
    np.testing.assert_allclose(after.distance - before.distance, now.rate, atol=0.02)


def test_dilution_of_a_symmetric_sky() -> None:
    """Three satellites around the horizon and one at the zenith: H = 2/sqrt(3), V = 2/sqrt(3), closed form."""
    azimuth, elevation = np.deg2rad([0.0, 120.0, 240.0, 0.0]), np.deg2rad([0.0, 0.0, 0.0, 90.0])
    hdop, vdop, pdop = dilution(azimuth, elevation)
    assert (hdop, vdop, pdop) == pytest.approx((2 / math.sqrt(3), 2 / math.sqrt(3), math.sqrt(8 / 3)))
    with pytest.raises(ValueError, match="do not fix"):
        dilution(azimuth[:3], elevation[:3])


def sky_seconds(t_dev_ns: int) -> float:
    """Time of the sky at a GPS time: it has one of its own at the start of the flight."""
    return sky_start_s(1) + (t_dev_ns - (START_NS - GPS_EPOCH_NS + LEAP_NS)) / 1e9


def solve(observations: Pseudoranges, start: Array) -> tuple[Array, float]:
    """Position and clock of the epoch from its pseudoranges of GPS, by least squares."""
    sky, solution = Constellation(), np.append(start, 0.0)
    used = [o for o in observations.observations if o.system == "gps"]
    places = [sky.keys.index((o.system, o.number)) for o in used]
    local_s = sky_seconds(observations.stamp.t_dev_ns or 0)
    for _ in range(6):
        t = local_s - solution[3] / SPEED_OF_LIGHT
        rows, misclosures = [], []
        for o, place in zip(used, places, strict=True):
            flight_s = ((o.pseudorange or 0.0) - solution[3]) / SPEED_OF_LIGHT
            x, y, z = sky.state(t - flight_s)[0][place]
            turn = EARTH_RATE * t
            at = np.array([x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn), z])
            line = at - solution[:3]
            rows.append(np.append(-line / np.linalg.norm(line), 1.0))
            misclosures.append((o.pseudorange or 0.0) - np.linalg.norm(line) - solution[3])
        solution += np.linalg.lstsq(np.array(rows), np.array(misclosures), rcond=None)[0]
    return solution[:3], solution[3] / SPEED_OF_LIGHT


def test_the_pseudoranges_give_the_position_and_the_clock_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the atmosphere, which the height would take most of, there is code noise of less than a metre."""
    monkeypatch.setattr(RawReceiver, "TROPOSPHERE", 0.0)
    monkeypatch.setattr(RawReceiver, "IONOSPHERE", 0.0)
    sensor = receiver()
    measurements = measured(sensor)
    raw = next(m for m in measurements if isinstance(m, Pseudoranges))
    clock = next(m for m in measurements if isinstance(m, ReceiverClock))
    truth = environment().state(np.array([(raw.stamp.t_rx_ns - START_NS) / 1e9]))
    here = ecef_from_geodetic(truth.lat, truth.lon, truth.alt)[0]
    place, offset = solve(raw, here + 1000.0)
    north, east, down = mat_en(float(truth.lat[0]), float(truth.lon[0])).T @ (place - here)
    assert math.hypot(north, east) < 4.0
    assert abs(down) < 8.0
    assert offset == pytest.approx(clock.offset, abs=2e-8)


def test_doppler_and_phase_follow_the_pseudorange() -> None:
    first, second = [m for m in measured(receiver()) if isinstance(m, Pseudoranges)][:2]
    dt = ((second.stamp.t_dev_ns or 0) - (first.stamp.t_dev_ns or 0)) / 1e9
    later = {(o.system, o.number): o for o in second.observations}
    for o in first.observations:
        other = later.get((o.system, o.number))
        if other is None or o.system == "glonass":
            continue
        wavelength = SPEED_OF_LIGHT / 1575.42e6
        by_doppler = -((o.doppler or 0.0) + (other.doppler or 0.0)) / 2 * wavelength * dt
        assert (other.pseudorange or 0.0) - (o.pseudorange or 0.0) == pytest.approx(by_doppler, abs=15.0)
        assert ((other.carrier_phase or 0.0) - (o.carrier_phase or 0.0)) * wavelength == pytest.approx(
            by_doppler, abs=0.5
        )


def test_what_goes_over_the_line_is_what_was_measured() -> None:
    sensor = receiver()
    decoder = ublox_ubx.make_decoder(ublox_ubx.Options())
    measurements = measured(sensor)
    stream = b"".join(data for m in measurements for data in sensor.encoder.encode(m))
    results = decoder.feed(stream, 1)
    assert decoder.counters.messages == {"NAV-PVT": 60, "NAV-SAT": 30, "NAV-CLOCK": 30, "RXM-RAWX": 30}
    assert not decoder.counters.skipped

    def both(kind: type[Measurement]) -> list[tuple[Measurement, Measurement]]:
        lists = ([m for m in ms if isinstance(m, kind)] for ms in (measurements, results))
        return list(zip(*lists, strict=True))

    for ours, back in both(Position):
        assert isinstance(ours, Position)
        assert isinstance(back, Position)
        assert back.lat == pytest.approx(ours.lat, abs=math.radians(0.51e-7))
        assert back.alt == pytest.approx(ours.alt, abs=0.00051)
        assert back.stamp.t_dev_ns == ours.stamp.t_dev_ns
    for ours, back in both(Pseudoranges):
        assert back.stamp.t_dev_ns == pytest.approx(ours.stamp.t_dev_ns, abs=1)
        assert back.stamp.time_scale is TimeScale.GPS
    assert len(both(Velocity)) == 60


def test_each_glonass_slot_has_its_channel_on_the_line() -> None:
    """Frequency division: a receiver that said one channel for all would contradict the other one of the aircraft."""
    measurements = next(m for m in measured(receiver()) if isinstance(m, Pseudoranges))
    channels = {o.number: frequency_id(o) - 7 for o in measurements.observations if o.system == "glonass"}
    assert len(channels) >= 3
    assert channels == {slot: GLONASS_CHANNELS[slot - 1] for slot in channels}
    assert GLONASS_CHANNELS[:4] == GLONASS_CHANNELS[4:8]  # antipodal


@pytest.mark.parametrize(("nth", "clocks"), [(1, 30), (2, 30), (6, 10)])
def test_rates_are_counted_in_solutions(nth: int, clocks: int) -> None:
    """Two solutions a second for half a minute; the sky and the clock are there once a second."""
    sensor = receiver()
    for name, rate in (("NAV-PVT", 3), ("NAV-CLOCK", nth), ("NAV-SAT", 0), ("RXM-RAWX", 0)):
        sensor.encoder.respond(ublox_ubx.command("message", {"name": name, "rate": str(rate)}))
    decoder = ublox_ubx.make_decoder(ublox_ubx.Options())
    decoder.feed(b"".join(data for m in measured(sensor) for data in sensor.encoder.encode(m)), 1)
    assert decoder.counters.messages == {"NAV-PVT": 20, "NAV-CLOCK": clocks}


def test_a_second_has_one_sky_and_one_clock_which_stays_within_half_a_millisecond() -> None:
    measurements = measured(receiver(seed=3))
    clocks = [m for m in measurements if isinstance(m, ReceiverClock)]
    assert len(clocks) == len([m for m in measurements if isinstance(m, Satellites) and m.satellites]) == 30
    assert all(abs(c.offset or 0.0) <= 0.5e-3 for c in clocks)
    assert (clocks[-1].offset or 0.0) - (clocks[0].offset or 0.0) == pytest.approx(
        29 * (clocks[0].drift or 0.0), rel=0.2
    )


def test_gpsd_reads_the_emulated_receiver() -> None:
    if not shutil.which("gpsdecode"):
        pytest.skip("gpsdecode (Debian: gpsd-clients) is not installed; it is the independent decoder")
    sensor = receiver()
    measurements = measured(sensor)
    stream = b"".join(data for m in measurements for data in sensor.encoder.encode(m))
    done = subprocess.run(["gpsdecode"], input=stream, capture_output=True, check=True, timeout=120)
    reports = [json.loads(line) for line in done.stdout.splitlines()]
    places = {(r["lat"], r["lon"], r["altHAE"]) for r in reports if r["class"] == "TPV" and "lat" in r}
    ours = [m for m in measurements if isinstance(m, Position)]
    for position in ours[1:-1]:
        lat, lon, alt = math.degrees(position.lat or 0.0), math.degrees(position.lon or 0.0), position.alt or 0.0
        assert any(abs(p[0] - lat) < 6e-8 and abs(p[1] - lon) < 6e-8 and abs(p[2] - alt) < 6e-4 for p in places)
    skies = [m for m in measurements if isinstance(m, Satellites) and m.satellites]
    views = [r for r in reports if r["class"] == "SKY" and "satellites" in r]
    assert [len(r["satellites"]) for r in views] == [len(m.satellites) for m in skies]
