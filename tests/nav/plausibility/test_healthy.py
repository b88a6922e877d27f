"""Sound receivers that no test may refuse, whatever is flown; longer with --scale full."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec.structs import replace

from fti.messages.measurements import Measurement, Position, Stamp, TimeScale, Velocity
from tests.nav.healthy_receivers import RECEIVERS, Receiver, Truth, fly, measure
from tests.nav.plausibility.receiver_runs import T0, UBX1, UBX10, S, make_tests, run, simulate, straight


def unchanged(t: float, m: Measurement) -> Measurement:
    return m


@pytest.mark.parametrize("receiver", RECEIVERS, ids=lambda r: r.name)
def test_legs_and_turns(receiver: Receiver, scale: int) -> None:
    for seed in range(1 if scale == 1 else 3):
        result = simulate(unchanged, receiver=receiver, seconds=450 if scale == 1 else 900, seed=seed)
        assert result.events == []
        assert all(valid and whole for _, valid, whole in result.valid)


@pytest.mark.parametrize("receiver", RECEIVERS, ids=lambda r: r.name)
def test_turns_of_a_fighter(receiver: Receiver, scale: int) -> None:
    """8 g, at up to 200 m/s, with the limits of such an aircraft."""
    rng = np.random.default_rng(11)
    truth = fly(rng, 300 if scale == 1 else 600, 8.0)
    assert simulate(unchanged, receiver=receiver, truth=truth, limits={"acceleration_mps2": 100.0}).events == []


@pytest.mark.parametrize("receiver", RECEIVERS, ids=lambda r: r.name)
@pytest.mark.parametrize("speed", [0.0, 0.4, 3.0])
def test_on_the_ground_in_hover_and_at_a_walk(receiver: Receiver, speed: float, scale: int) -> None:
    truth = straight(200 if scale == 1 else 600, speed)
    assert simulate(unchanged, receiver=receiver, truth=truth).events == []


def test_a_receiver_that_holds_its_place_on_the_ground() -> None:
    """Static hold: the same digits for minutes, velocity zero, until the aircraft taxies."""
    n = 600 * 20
    speed = np.clip((np.arange(n) / 20.0 - 300.0) * 0.5, 0.0, 8.0)
    velocity = np.stack([speed, np.zeros(n), np.zeros(n)], axis=1)
    truth = Truth(np.cumsum(velocity, axis=0) / 20.0, velocity)
    measurements: dict[type, Measurement] = {}

    def change(t: float, m: Measurement) -> Measurement:
        if t >= 300.0:
            return m
        still = replace(m, north=0.0, east=0.0, down=0.0) if isinstance(m, Velocity) else m
        return replace(measurements.setdefault(type(m), still), stamp=m.stamp)

    assert simulate(change, receiver=UBX10, truth=truth).events == []


@pytest.mark.parametrize("length_s", [2.0, 10.0, 59.0, 300.0])
def test_gaps(length_s: float, scale: int) -> None:
    def change(t: float, m: Measurement) -> Measurement | None:
        return None if 100.0 <= t < 100.0 + length_s else m

    seconds = round(200 + length_s) if scale == 1 else 600
    for receiver in (UBX1, UBX10):
        assert simulate(change, receiver=receiver, seconds=seconds, seed=5).events == []


def test_positions_are_missing_and_velocities_are_not() -> None:
    def change(t: float, m: Measurement) -> Measurement | None:
        return None if 100.0 <= t < 160.0 and isinstance(m, Position) else m

    assert simulate(change, receiver=UBX10, seconds=400, seed=5).events == []


def test_a_receiver_that_restarts() -> None:
    """Silent for 20 s; its time since start begins again, and it converges again from 5 m."""

    def change(t: float, m: Measurement) -> Measurement | None:
        if 100.0 <= t < 120.0:
            return None
        device_time_s = t + 5000.0 if t < 100.0 else t - 118.0
        stamp = replace(m.stamp, t_dev_ns=round(device_time_s * S), time_scale=TimeScale.BOOT)
        if isinstance(m, Position) and m.lat is not None and t >= 120.0:
            return replace(m, stamp=stamp, lat=m.lat + 5.0 / 6.37e6 * math.exp(-(t - 120.0) / 60.0))
        return replace(m, stamp=stamp)

    assert simulate(change, receiver=UBX1, seconds=400).events == []


@pytest.mark.parametrize("receiver", [UBX1, UBX10])
def test_a_receiver_that_loses_and_finds_its_corrections(receiver: Receiver) -> None:
    """For a minute the error is that of 20 m, and stated; it steps in and out of it by twice the sigma at most."""
    for seed, offset in enumerate((-40.0, -15.0, 30.0, 40.0)):

        def change(t: float, m: Measurement, offset: float = offset) -> Measurement:
            if not (isinstance(m, Position) and m.lat is not None and 100.0 <= t < 160.0):
                return m
            return replace(m, lat=m.lat + offset / 6.37e6, horizontal_sd=20.0)

        assert simulate(change, receiver=receiver, seconds=300, seed=seed).events == []


def test_a_counter_of_32_bits_of_milliseconds_that_starts_again() -> None:
    def change(t: float, m: Measurement) -> Measurement:
        device_time_s = (2**32 - 100_000 + round(1000.0 * t)) % 2**32
        return replace(m, stamp=Stamp(m.stamp.t_rx_ns, device_time_s * 1_000_000, TimeScale.BOOT, m.stamp.t_valid_ns))

    assert simulate(change, receiver=UBX10, seconds=200).events == []


def test_messages_that_come_late_together() -> None:
    """For 1.5 s nothing arrives, then all of it at once, with the times at which it was true."""

    def change(t: float, m: Measurement) -> Measurement:
        rx = T0 + round(101.5 * S) if 100.0 <= t < 101.5 else m.stamp.t_rx_ns
        return replace(m, stamp=Stamp(rx, round((t + 50.0) * S), TimeScale.GPS, m.stamp.t_valid_ns))

    assert simulate(change, receiver=UBX10, seconds=200).events == []


def test_position_and_velocity_in_messages_of_their_own() -> None:
    """Latitude, longitude, ground speed and track each in a message, 20 ms apart, as of a bus."""
    rng = np.random.default_rng(2)
    tests = make_tests()
    parts: list[tuple[int, Measurement]] = []
    pending: dict[type, Measurement] = {}
    for t_ns, m in measure(rng, fly(rng, 400, 1.5), UBX10, T0):
        pending[type(m)] = m
        position, velocity = pending.get(Position), pending.get(Velocity)
        if isinstance(m, Velocity) and isinstance(position, Position) and isinstance(velocity, Velocity):
            assert velocity.north is not None
            assert velocity.east is not None
            speed, track = math.hypot(velocity.north, velocity.east), math.atan2(velocity.east, velocity.north)
            parts += [
                (t_ns, Position(stamp=m.stamp, lat=position.lat)),
                (t_ns, Position(stamp=m.stamp, lon=position.lon)),
                (t_ns, Velocity(stamp=m.stamp, ground_speed=speed)),
                (t_ns, Velocity(stamp=m.stamp, track=track)),
            ]
    result = run(parts, unchanged, tests)
    assert len(result.valid) == 8000
    assert result.events == []


def test_no_number_and_a_place_off_the_earth_change_nothing() -> None:
    wild = [math.nan, math.inf, -1e300, 7.0]

    def change(t: float, m: Measurement) -> Measurement:
        value = wild[int(t) % 4]
        if not 100.0 <= t < 110.0:
            return m
        if isinstance(m, Position):
            return replace(m, lat=value)
        return replace(m, north=1e6 * value) if isinstance(m, Velocity) else m

    result = simulate(change, receiver=UBX1, seconds=200, truth=straight(200))
    assert [event for _, event in result.events if "impossible" not in event.text] == []
