"""Models of sensors: rates, phases, times, and errors of the size that they state."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import TypeVar

import numpy as np
import pytest
from numpy.typing import NDArray

from fti import drivers
from fti.config import Altimeter, Device
from fti.devices import BoundDevice
from fti.geodesy.formulas import SEMI_MAJOR
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.hil.environment import Environment
from fti.hil.sensors import MODELS, SimulatedSensor
from fti.hil.sensors.base import position_at, sample_times, velocity_at
from fti.hil.sensors.errors import gauss_markov_noise
from fti.hil.sensors.inertial import specific_force_b
from fti.hil.tables.fault_types import OffTrack
from fti.messages.measurements import (
    Airspeed,
    Attitude,
    ImpactPressure,
    ImuSample,
    Measurement,
    Position,
    PressureAltitude,
    RadioHeight,
    Range,
    StaticPressure,
    TimeScale,
    Velocity,
)
from fti.nav.sensor_mounting import Mountings
from tests.hil.worlds import world

START_NS = 1_700_000_000_000_000_000
Array = NDArray[np.float64]
M = TypeVar("M")
RADAR = Altimeter(kind="radar", range_m=(0.5, 762.0))
LASER = Altimeter(kind="laser", range_m=(0.2, 500.0))


@cache
def environment() -> Environment:
    return world(duration_s=60.0)


def sensor(
    driver: str, name: str = "device", seed: int = 1, there: Environment | None = None, **keys: object
) -> SimulatedSensor:
    device = Device.model_validate({"name": name, "link": "line", "driver": driver, **keys})
    module = drivers.load(driver)
    return SimulatedSensor(BoundDevice(device, module, module.Options()), MODELS[driver], there or environment(), seed)


def all_of(result: SimulatedSensor, kind: type[M]) -> list[M]:
    samples = [m for k in range(len(result.t)) for m in result.measure(k, START_NS)]
    return [m for m in samples if isinstance(m, kind)]


# --------------------------------------------------------------------------------------------------------- times


def test_every_driver_has_a_model() -> None:
    assert set(MODELS) == set(drivers.names())


@pytest.mark.parametrize("driver", sorted(MODELS))
def test_rate_is_the_configured_one_and_the_default_the_models(driver: str) -> None:
    result = sensor(driver, rate_hz=7)
    assert len(result.t) == pytest.approx(60 * 7, abs=1)
    np.testing.assert_allclose(np.diff(result.t), 1 / 7, rtol=2e-4)
    assert len(sensor(driver).t) == pytest.approx(60 * MODELS[driver].rate_hz, abs=1)


def test_a_fast_clock_samples_more_often() -> None:
    slow_clock, fast_clock = (sample_times(10.0, 1000.0, 0.05, ppm) for ppm in (-100.0, 100.0))
    assert slow_clock[0] == pytest.approx(0.05, abs=1e-5)
    assert slow_clock[9000] - fast_clock[9000] == pytest.approx(900.0 * 200e-6, rel=1e-3)


def test_phases_and_drifts_differ_between_devices_and_seeds_and_repeat() -> None:
    sensors = [sensor("nmea0183", name, seed) for name in ("a", "b") for seed in (1, 2)]
    assert len({round(s.t[0], 6) for s in sensors}) == 4
    assert len({round(s.drift_ppm, 6) for s in sensors}) == 4
    np.testing.assert_array_equal(sensors[0].t, sensor("nmea0183", "a", 1).t)


def test_a_message_leaves_after_its_latency_and_in_order() -> None:
    result = sensor("freeflight_ra4500", latency_ms=30.0)
    late = result.due - result.t
    assert late.min() >= 0.030
    assert np.median(late) == pytest.approx(0.030, abs=0.001)
    assert (np.diff(result.due) > 0).all()


def test_stamps_are_the_sample_times_in_the_scale_of_the_device() -> None:
    ins, radar, autopilot = sensor("imar_ixcom"), sensor("freeflight_ra4500"), sensor("mavlink")
    stamp = ins.measure(10, START_NS)[0].stamp
    assert stamp.t_dev_ns == stamp.t_rx_ns == START_NS + round(ins.t[10] * 1e9)
    assert stamp.time_scale is TimeScale.UTC
    assert radar.measure(10, START_NS)[0].stamp.t_dev_ns is None
    first, last = (autopilot.measure(k, START_NS)[0].stamp for k in (0, len(autopilot.t) - 1))
    assert first.time_scale is TimeScale.BOOT
    assert first.t_dev_ns is not None
    assert last.t_dev_ns is not None
    elapsed = (last.t_dev_ns - first.t_dev_ns) / (last.t_rx_ns - first.t_rx_ns)
    assert elapsed == pytest.approx(1.0 + 1e-6 * autopilot.drift_ppm, abs=1e-9)


# -------------------------------------------------------------------------------------------------------- errors


def test_slow_errors_have_the_size_and_memory_asked_for() -> None:
    t = np.arange(0.0, 20000.0, 0.5)
    error = gauss_markov_noise(t, 2.0, 10.0, np.random.default_rng(1))
    assert error.std() == pytest.approx(2.0, rel=0.1)
    correlation = np.corrcoef(error[:-20], error[20:])[0, 1]
    assert correlation == pytest.approx(math.exp(-1.0), abs=0.08)


def spread(driver: str, error_of: str) -> float:
    """Root mean square of one error over 12 devices."""
    errors = [ERRORS[error_of](sensor(driver, f"d{i}", rate_hz=5)) for i in range(12)]
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def north_error(result: SimulatedSensor) -> Array:
    found = all_of(result, Position)
    return (np.array([p.lat for p in found]) - environment().state(times(found)).lat) * SEMI_MAJOR


def height_error(result: SimulatedSensor) -> Array:
    found = all_of(result, Position)
    return np.array([p.alt for p in found]) - environment().state(times(found)).alt


def roll_error(result: SimulatedSensor) -> Array:
    found = all_of(result, Attitude)
    return np.array([a.roll for a in found]) - environment().state(times(found)).roll


def times(measurements: Sequence[Measurement]) -> Array:
    return np.array([(m.stamp.t_rx_ns - START_NS) * 1e-9 for m in measurements])


ERRORS = {"north": north_error, "height": height_error, "roll": roll_error}


@pytest.mark.parametrize("driver", ["imar_ixcom", "nmea0183", "mavlink"])
def test_position_errors_are_as_large_as_stated(driver: str) -> None:
    stated = all_of(sensor(driver), Position)[0]
    assert stated.horizontal_sd is not None
    assert stated.vertical_sd is not None
    assert spread(driver, "north") == pytest.approx(stated.horizontal_sd, rel=0.5)
    assert spread(driver, "height") == pytest.approx(stated.vertical_sd, rel=0.5)


def test_the_inertial_system_is_better_than_the_heading_reference() -> None:
    assert spread("imar_ixcom", "height") < 2.0
    assert spread("imar_ixcom", "roll") < np.deg2rad(0.06) < np.deg2rad(0.15) < spread("arinc429", "roll")


def test_both_heights_differ_by_the_undulation() -> None:
    for driver in ("imar_ixcom", "nmea0183", "mavlink"):
        position = all_of(sensor(driver), Position)[5]
        assert position.alt is not None
        assert position.alt_msl is not None
        assert position.alt - position.alt_msl == pytest.approx(47.0)
        assert position.undulation == 47.0


def test_a_lever_arm_moves_the_position_with_the_heading() -> None:
    """Heading 250 and an arm of 10 m forward: 3.4 m south, 9.4 m west."""
    state = environment().state(np.array([10.0]))
    lat, lon, alt = position_at(state, (10.0, 0.0, 0.0))
    north = (lat - state.lat)[0] * SEMI_MAJOR
    east = (lon - state.lon)[0] * SEMI_MAJOR * math.cos(state.lat[0])
    assert (north, east) == pytest.approx((-3.4, -9.4), abs=0.4)
    assert (alt - state.alt)[0] == pytest.approx(10.0 * math.sin(state.pitch[0]), abs=0.01)


@pytest.mark.parametrize("arm", [(5.0, 2.0, -1.5), (-12.0, 0.0, 3.0)])
def test_a_lever_arm_has_the_velocity_of_its_place(arm: tuple[float, float, float]) -> None:
    """Against the way of the place in 20 ms, in a side step: 0.2 m/s and more beside that of P."""
    t = np.linspace(8.0, 20.0, 50)
    there = [ecef_from_geodetic(*position_at(stepping().state(t + correlation), arm)) for correlation in (0.01, -0.01)]
    state = stepping().state(t)
    moved_n = np.einsum("nji,nj->ni", mat_en(state.lat, state.lon), (there[0] - there[1]) / 0.02)
    values = velocity_at(state, arm)
    assert np.abs(values - state.vel_n).max() > 0.15
    np.testing.assert_allclose(values, moved_n, atol=1e-3)


@cache
def stepping() -> Environment:
    return world(duration_s=60.0, fault=(OffTrack(kind="off_track", right_m=150.0, from_s=20.0, to_s=50.0),))


@pytest.mark.parametrize("driver", ["imar_ixcom", "nmea0183"])
def test_the_measured_velocity_is_that_of_the_device(driver: str) -> None:
    """With an arm and without one the errors are the same ones: the difference is the arm's."""
    arm = (5.0, 2.0, -1.5)
    moved, still = (sensor(driver, there=stepping(), rate_hz=5, lever_arm_b=a) for a in (arm, (0.0, 0.0, 0.0)))
    found, plain = (np.array([(v.north, v.east) for v in all_of(made, Velocity)]) for made in (moved, still))
    state = stepping().state(moved.t)
    np.testing.assert_allclose(found - plain, (velocity_at(state, arm) - state.vel_n)[:, :2], atol=2e-3)


def test_velocity_says_the_same_in_components_and_as_track() -> None:
    velocity = all_of(sensor("nmea0183"), Velocity)[3]
    assert velocity.north is not None
    assert velocity.ground_speed is not None
    assert velocity.track is not None
    assert velocity.ground_speed * math.cos(velocity.track) == pytest.approx(velocity.north)


# ---------------------------------------------------------------------------------------------- altimeters, others


def test_radar_noise_is_white_and_of_its_size() -> None:
    result = sensor("freeflight_ra4500", altimeter=RADAR.model_dump())
    heights = np.array([m.height_agl for m in all_of(result, RadioHeight)])
    state = environment().state(result.t)
    noise = np.diff(heights - (state.alt - environment().ground(state)), n=2) / math.sqrt(6.0)  # trends go
    assert noise.std() == pytest.approx(0.3, rel=0.2)


def test_altimeters_say_when_they_see_nothing() -> None:
    """Both reach 100 m here; the flight begins at about 250 m and ends below 100 m."""
    radar = all_of(sensor("freeflight_ra4500", altimeter={"kind": "radar", "range_m": (0.5, 100.0)}), RadioHeight)
    laser = all_of(sensor("mavlink", altimeter={"kind": "laser", "range_m": (0.2, 100.0)}), Range)
    assert (radar[0].valid, radar[0].height_agl) == (False, None)
    assert (laser[0].valid, laser[0].slant_range) == (False, None)
    assert radar[-1].valid
    assert laser[-1].valid


def test_only_altimeters_measure_ranges() -> None:
    assert not all_of(sensor("mavlink"), Range)
    assert not all_of(sensor("arinc429"), RadioHeight)
    assert all_of(sensor("arinc429", altimeter=RADAR.model_dump()), RadioHeight)


def test_air_data_fits_together() -> None:
    result = sensor("canaerospace")
    pressure, impact = all_of(result, StaticPressure)[9], all_of(result, ImpactPressure)[9]
    speed, altitudes = all_of(result, Airspeed)[9], all_of(result, PressureAltitude)[18:20]
    state = environment().state(result.t[9:10])
    assert altitudes[0].alt_press == pytest.approx(state.alt[0] - 47.0, abs=5.0)
    assert altitudes[0].alt_press == pytest.approx(altitudes[1].alt_press)  # QNH is the standard here
    assert impact.q_c == pytest.approx(0.5 * pressure.p_static / (287.05 * 284.0) * state.tas[0] ** 2, rel=0.03)
    assert speed.cas is not None
    assert 0.9 * state.tas[0] < speed.cas < state.tas[0]


@pytest.mark.parametrize("driver", ["imar_ixcom", "mavlink"])
def test_a_case_that_lies_on_its_side_feels_so_and_the_daemon_turns_it_back(driver: str) -> None:
    side = (90.0, 0.0, 20.0)
    aligned, turned = (all_of(sensor(driver, rpy_bs_deg=rpy), ImuSample)[:50] for rpy in ((0.0, 0.0, 0.0), side))
    back = Mountings([Device(name="device", link="line", driver=driver, rpy_bs_deg=side)])
    for straight, lying in zip(aligned, turned, strict=True):
        measurement = back.turn("device", lying)
        assert isinstance(measurement, ImuSample) and lying.accel_b and straight.accel_b
        assert abs(lying.accel_b[1]) > 9.0  # gravity is on its right or left
        assert measurement.accel_b == pytest.approx(straight.accel_b, abs=1e-12)
        assert measurement.gyro_b == pytest.approx(straight.gyro_b, abs=1e-14)


def test_inertial_samples_feel_gravity_in_every_model_that_has_them() -> None:
    for driver, three_sd in (("imar_ixcom", 0.004), ("mavlink", 0.54)):  # MEMS: 15 mg and 1 % of 1 g
        accel = np.array([m.accel_b for m in all_of(sensor(driver), ImuSample)])
        felt = np.linalg.norm(specific_force_b(environment().state(sensor(driver).t)), axis=1)
        assert np.linalg.norm(accel, axis=1).mean() == pytest.approx(felt.mean(), abs=three_sd)
        assert accel[:, 2].mean() < -9.5
