"""The model of the two-frequency receiver: what it says fits together, and errors are as large as it states."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from fti import drivers
from fti.constants import SPEED_OF_LIGHT
from fti.drivers import novatel_oem6
from fti.geodesy.formulas import SEMI_MAJOR
from fti.messages.measurements import (
    Measurement,
    Position,
    Pseudorange,
    Pseudoranges,
    ReceiverClock,
    Satellites,
    Velocity,
)
from tests.hil.test_sensors import START_NS, environment, sensor

Key = tuple[str, int, str]


@cache
def measured() -> tuple[tuple[Measurement, ...], ...]:
    """Twenty seconds."""
    result = sensor("novatel_oem6")
    return tuple(tuple(result.measure(k, START_NS)) for k in range(200))


def epochs() -> list[dict[Key, Pseudorange]]:
    measurements = [m for sample in measured() for m in sample if isinstance(m, Pseudoranges)]
    return [{(o.system, o.number, o.signal): o for o in epoch.observations} for epoch in measurements]


def present(value: float | None) -> float:
    assert value is not None
    return value


def test_pairs_of_signals_differ_by_the_ionosphere() -> None:
    """The delay goes with the inverse square of the frequency: L2 is 0.647 of the L1 delay later, 2.6 m upwards."""
    first = epochs()[0]
    assert 8 <= len({key[:2] for key in first}) <= 30
    assert len(first) == 2 * len({key[:2] for key in first})
    ratio = (1575.42 / 1227.6) ** 2 - 1.0
    for (system, number, signal), o in first.items():
        if (system, signal) == ("gps", "L1C"):
            later = present(first[system, number, "L2W"].pseudorange) - present(o.pseudorange)
            noise = 4 * math.hypot(present(o.pseudorange_sd), present(first[system, number, "L2W"].pseudorange_sd))
            assert 4.0 * ratio - noise < later < 12.0 * ratio + noise


def test_doppler_is_the_rate_of_the_phase_turned() -> None:
    earlier, later = epochs()[:2]
    dt = 0.1
    for key in earlier.keys() & later.keys():
        rate = (present(later[key].carrier_phase) - present(earlier[key].carrier_phase)) / dt
        assert -rate == pytest.approx(present(earlier[key].doppler), abs=8.0)  # of thousands


def test_code_and_phase_tell_the_same_distance_but_for_whole_cycles_and_noise() -> None:
    """Code minus phase stays: its spread is the noise that each observation states."""
    results: dict[Key, list[float]] = {}
    for epoch in epochs():
        for key, o in epoch.items():
            phase = present(o.carrier_phase) * SPEED_OF_LIGHT / present(o.carrier_hz)
            results.setdefault(key, []).append((present(o.pseudorange) - phase) / present(o.pseudorange_sd))
    spreads = [np.std(np.diff(values)) / math.sqrt(2.0) for values in results.values() if len(values) > 150]
    assert len(spreads) > 16
    assert np.mean(spreads) == pytest.approx(1.0, abs=0.1)


def test_carriers_of_glonass_have_their_channels() -> None:
    carriers = {key[1]: present(o.carrier_hz) for key, o in epochs()[0].items() if key[::2] == ("glonass", "L1C")}
    assert carriers
    for hz in carriers.values():
        channel = (hz - 1602e6) / 562.5e3
        assert channel == pytest.approx(round(channel), abs=1e-6)
        assert -7 <= round(channel) <= 6


def test_all_satellites_that_are_used_have_directions_and_give_the_dilution() -> None:
    sky = next(m for m in measured()[0] if isinstance(m, Satellites))
    assert sky.used == len(sky.satellites)
    up = np.array([present(s.elevation) for s in sky.satellites])
    azimuth = np.array([present(s.azimuth) for s in sky.satellites])
    design = np.stack(
        [np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth), np.sin(up), np.ones(len(up))], axis=1
    )
    q = np.linalg.inv(design.T @ design)
    assert sky.hdop == pytest.approx(math.sqrt(q[0, 0] + q[1, 1]))
    assert sky.pdop == pytest.approx(math.sqrt(np.trace(q[:3, :3])))
    assert up.min() > math.radians(5.0)


def test_errors_are_those_of_the_data_sheet() -> None:
    """1.2 m RMS horizontally and 1.8 m vertically on two frequencies, 0.03 m/s, 20 ns; over several flights."""
    north, up, speed, time = [], [], [], []
    for seed in range(10):
        result = sensor("novatel_oem6", seed=seed, rate_hz=0.2)
        state = environment().state(result.t)
        for k in range(len(result.t)):
            messages = {type(m): m for m in result.measure(k, START_NS)}
            position, velocity, clock = messages[Position], messages[Velocity], messages[ReceiverClock]
            assert isinstance(position, Position)
            assert isinstance(velocity, Velocity)
            assert isinstance(clock, ReceiverClock)
            north.append((present(position.lat) - state.lat[k]) * SEMI_MAJOR)
            up.append(present(position.alt) - state.alt[k])
            speed.append(present(velocity.north) - state.vel_n[k, 0])
            time.append(present(clock.offset))
    assert math.sqrt(2.0) * rms(north) == pytest.approx(1.2, rel=0.5)
    assert rms(up) == pytest.approx(1.8, rel=0.5)
    assert math.sqrt(2.0) * rms(speed) == pytest.approx(0.03, rel=0.5)
    assert rms(time) == pytest.approx(20e-9, rel=0.5)


def rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def test_over_the_line_comes_what_was_asked_for_at_its_rate() -> None:
    """Twenty seconds of the aircraft's logs, through driver and emulated receiver."""
    driver = drivers.load("novatel_oem6")
    options = novatel_oem6.Options()
    encoder, decoder = driver.make_encoder(options), driver.make_decoder(options)
    assert [f for sample in measured()[:5] for m in sample for f in encoder.encode(m)] == []
    for data in driver.on_connect(options):
        assert [m for r in encoder.respond(data) for m in decoder.feed(r, 0)] == []  # nothing was refused
    assert decoder.counters.messages == {"response": 8}
    data = b"".join(f for sample in measured() for m in sample for f in encoder.encode(m))
    decoder.feed(data, 0)
    counts = decoder.counters.messages
    assert decoder.counters.framed == decoder.counters.bytes_in
    for name, expected in (("BESTPOS", 200), ("BESTVEL", 200), ("TIME", 20), ("CLOCKMODEL", 20), ("PSRDOP", 20),
                           ("RANGE", 20), ("RXSTATUS", 20)):  # fmt: skip
        assert abs(counts[name] - expected) <= 1, name
    assert 4 <= counts["SATVIS2"] <= 6  # every ten seconds, for two systems
    assert len(data) / 20 < 0.5 * 115_200 / 10  # half of the line at most
