"""What the emulated inertial system passes on beside its solution: when, and as true as it says."""

from __future__ import annotations

from collections import Counter
from functools import cache

import numpy as np
import pytest

from fti import drivers
from fti.config import Device
from fti.devices import BoundDevice
from fti.drivers import Decoder
from fti.drivers import imar_ixcom as ix
from fti.geodesy.formulas import SEMI_MAJOR
from fti.hil.environment import Environment
from fti.hil.sensors import MODELS, SimulatedSensor
from fti.hil.sensors.inertial_aids import AID_RATES_HZ
from fti.hil.sensors.inertial_solution import drift_sigmas
from fti.hil.sensors.magnetometer import earth_field_b
from fti.messages.measurements import (
    Airspeed,
    Attitude,
    DeviceStatus,
    ImpactPressure,
    MagneticField,
    Measurement,
    Position,
    PressureAltitude,
    Satellites,
    StaticPressure,
    Velocity,
)
from tests.hil.worlds import world

START_NS = 1_700_000_000_000_000_000
DURATION_S = 5.0
EVERYTHING = {
    "INSSOL": 1,
    "GNSSSOL": 0,
    "AIRDATA": 0,
    "MAGDATA": 0,
    "EKFSTDDEV": 0,
    "SYSSTAT": 50,
}  # divider 0: as often as there is something new


@cache
def environment() -> Environment:
    return world(duration_s=DURATION_S)


def system(options: ix.Options) -> SimulatedSensor:
    device = Device.model_validate({"name": "ins", "link": "line", "driver": "imar_ixcom"})
    return SimulatedSensor(
        BoundDevice(device, drivers.load("imar_ixcom"), options), MODELS["imar_ixcom"], environment(), seed=1
    )


def line(logs: dict[str, int]) -> tuple[Decoder, list[Measurement]]:
    """What a decoder makes of the line of an emulated system that sends these."""
    sensor, decoder = system(ix.Options(logs=logs)), ix.make_decoder(ix.Options())
    measurements: list[Measurement] = []
    for k in range(len(sensor.t)):
        stream = [data for m in sensor.measure(k, START_NS) for data in sensor.encoder.encode(m)]
        measurements += decoder.feed(b"".join(stream), START_NS + k)
    return decoder, measurements


@cache
def everything() -> tuple[Decoder, list[Measurement]]:
    return line(EVERYTHING)


def first(kind: type, measurements: list[Measurement]) -> Measurement:
    return next(m for m in measurements if isinstance(m, kind))


def test_messages_are_as_many_as_their_dividers_say() -> None:
    decoder, _ = everything()
    expected = {name: DURATION_S * AID_RATES_HZ.get(name, 100.0) for name in EVERYTHING} | {"SYSSTAT": DURATION_S * 2.0}
    assert set(decoder.counters.messages) == set(expected)
    for name, count in expected.items():
        assert decoder.counters.messages[name] == pytest.approx(count, abs=1), name
    assert decoder.counters.lost == Counter()
    assert not sum(decoder.counters.skipped.values())


def test_unless_it_is_asked_the_system_sends_its_solution_alone() -> None:
    decoder, _ = line({"INSSOL": 1})
    assert set(decoder.counters.messages) == {"INSSOL"}


def test_the_deviations_that_it_sends_are_those_of_its_errors() -> None:
    _, found = everything()
    position = [m for m in found if isinstance(m, Position)][-1]
    velocity = [m for m in found if isinstance(m, Velocity)][-1]
    attitude = [m for m in found if isinstance(m, Attitude)][-1]
    sigmas = drift_sigmas("navigation")
    assert position.horizontal_sd == pytest.approx(sigmas.position)
    assert position.vertical_sd == pytest.approx(sigmas.height)
    assert velocity.sd == pytest.approx(sigmas.velocity)
    assert attitude.roll_sd == pytest.approx(sigmas.tilt, rel=0.05)
    assert attitude.heading_sd == pytest.approx(sigmas.heading)


def test_its_receiver_has_a_solution_of_its_own() -> None:
    _, found = line({"GNSSSOL": 0})
    position, velocity, satellites = (first(kind, found) for kind in (Position, Velocity, Satellites))
    assert isinstance(position, Position)
    assert isinstance(velocity, Velocity)
    assert isinstance(satellites, Satellites)
    assert position.stamp.t_dev_ns is not None
    assert 8 <= (satellites.used or 0) <= 24
    assert position.valid
    assert position.lat is not None
    assert position.horizontal_sd is not None
    state = environment().state(np.array([0.0]))
    assert abs(position.lat - float(state.lat[0])) * SEMI_MAJOR < 4 * position.horizontal_sd + 0.2 * 60.0
    assert velocity.north == pytest.approx(float(state.vel_n[0, 0]), abs=2.0)


def test_its_air_data_fit_together() -> None:
    _, found = line({"AIRDATA": 0})
    speed, static, q_c, altitude = (
        first(k, found) for k in (Airspeed, StaticPressure, ImpactPressure, PressureAltitude)
    )
    assert isinstance(speed, Airspeed)
    assert isinstance(static, StaticPressure)
    assert isinstance(q_c, ImpactPressure)
    assert isinstance(altitude, PressureAltitude)
    assert speed.tas is not None
    assert q_c.q_c == pytest.approx(0.5 * static.p_static / (287.05 * 285.0) * speed.tas**2, rel=0.04)
    assert altitude.alt_press == pytest.approx(44330.8 * (1 - (static.p_static / 101325.0) ** 0.190263), abs=1.0)


@pytest.mark.parametrize("unit", ["nT", "mG"])
def test_its_magnetometer_feels_the_earth(unit: str) -> None:
    """The field of the place, through the unit of the line; level enough for a compass."""
    options = ix.Options.model_validate({"logs": {"MAGDATA": 0}, "magnetometer_unit": unit})
    sensor = system(options)
    stream = b"".join(data for m in sensor.measure(0, START_NS) for data in sensor.encoder.encode(m))
    field = first(MagneticField, ix.make_decoder(options).feed(stream, 1))
    assert isinstance(field, MagneticField)
    state = environment().state(sensor.t[:1])
    assert field.field_b == pytest.approx(earth_field_b(state)[0], abs=2e-6)
    heading = np.arctan2(-field.field_b[1], field.field_b[0])
    assert np.cos(heading - state.heading[0]) > 0.95


def test_its_status_names_what_it_is_doing() -> None:
    _, found = line({"SYSSTAT": 100})
    status = first(DeviceStatus, found)
    assert isinstance(status, DeviceStatus)
    assert status.ok
    assert {"navigation_mode", "in_motion", "ekf_position_valid"} <= set(status.flags)
