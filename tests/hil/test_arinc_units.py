"""Units on ARINC 429 in the emulator: every label set in full, in every kind of packet, and the approach in DDM."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti import drivers
from fti.config import Altimeter, Device, bind
from fti.devices import BoundDevice
from fti.drivers import arinc429
from fti.drivers.arinc429.labels import built_in_sets
from fti.hil.environment import Environment
from fti.hil.sensors import SimulatedSensor
from fti.hil.sensors.arinc_units import ArincUnit, IlsReceiver
from fti.messages.measurements import Deviation, DmeRange, Measurement, Position, RadioHeight, Reading, Stamp, TimeScale
from fti.ranging.radar.quantise import quantisation_step_ft
from tests.hil.worlds import world

START_NS = 1_700_000_000_000_000_000
FOOT = 0.3048
RADAR = Altimeter(kind="radar", range_m=(0.5, 762.0))


@pytest.fixture(scope="module")
def environment() -> Environment:
    return world(duration_s=30.0)


def sensor(environment: Environment, **options: object) -> SimulatedSensor:
    device = Device(name="unit", link="line", driver="arinc429", altimeter=RADAR)
    settings = bind(arinc429.Options, options, "test.toml")
    return SimulatedSensor(BoundDevice(device, drivers.load("arinc429"), settings), ArincUnit, environment, 1)


def decode_all(result: SimulatedSensor, **options: object) -> tuple[arinc429.Decoder, list[Measurement]]:
    decoder = arinc429.make_decoder(bind(arinc429.Options, options, "test.toml"))
    measurements: list[Measurement] = []
    for k in range(0, len(result.t), 100):
        for measurement in result.measure(k, START_NS):
            for data in result.encoder.encode(measurement):
                measurements += decoder.feed(data, k)
    return decoder, measurements


@pytest.mark.parametrize("packets", ["none", "apmp", "chapter10"])
@pytest.mark.parametrize("name", list(built_in_sets()))
def test_every_label_of_every_set_is_played(environment: Environment, name: str, packets: str) -> None:
    options = {"set": name, "packets": packets}
    decoder, found = decode_all(sensor(environment, **options), **options)
    names = {label.quantity or label.reading or label.name for label in built_in_sets()[name].labels}
    assert names | {"equipment_id"} <= set(decoder.counters.messages)
    assert not [m for m in found if getattr(m, "ok", True) is False]
    if packets != "none":
        assert found[0].stamp.time_scale is TimeScale.BOOT
        assert found[0].stamp.t_dev_ns is not None


def test_the_radar_altimeter_of_a_set_with_steps_says_how_coarse_it_is(environment: Environment) -> None:
    options = {"set": "freeflight_ra4500"}
    measurements = [
        m for m in decode_all(sensor(environment, **options), **options)[1] if isinstance(m, RadioHeight) and m.valid
    ]
    assert measurements
    for m in measurements:
        assert m.height_agl is not None
        step = quantisation_step_ft(m.height_agl / FOOT)
        assert m.sd == pytest.approx(step * FOOT / math.sqrt(12))
        assert math.remainder(m.height_agl / FOOT, step) == pytest.approx(0.0, abs=1e-6)


def test_a_position_with_fine_words_is_good_to_centimetres_on_the_wire(environment: Environment) -> None:
    result = sensor(environment, set="gnss_743a")
    (position,) = [m for m in result.measure(0, START_NS) if isinstance(m, Position)]
    decoder = arinc429.make_decoder(arinc429.Options(set="gnss_743a"))
    measurements = decoder.feed(b"".join(result.encoder.encode(position)), 1)
    (lat,) = [m.lat for m in measurements if isinstance(m, Position) and m.lat is not None]
    assert position.lat is not None
    assert abs(lat - position.lat) * 6.4e6 < 0.01


def test_deviations_are_those_of_the_approach(environment: Environment) -> None:
    """Right of the centre line the localizer says fly left, above the path the glide slope says fly down."""
    t = np.linspace(0.0, 20.0, 400)
    state = environment.state(t)
    receiver = IlsReceiver(state, environment, t, np.random.default_rng(1))
    measurements = [m for k in range(len(t)) for m in receiver.measure(k, Stamp(0)) if isinstance(m, Deviation)]
    s, y = environment.path.to_path(state.lat, state.lon)
    above = state.alt - environment.path.alt_path(s)
    localizer = np.array([m.localizer_ddm for m in measurements])
    glide = np.array([m.glide_slope_ddm for m in measurements])
    assert np.std(localizer) < 0.1
    np.testing.assert_allclose(localizer, -0.00145 * y, atol=0.03 + 0.5 * 0.00145 * np.abs(y).max())
    expected = 0.0875 * np.arctan2(above, s) / (0.12 * environment.path.glide)
    np.testing.assert_allclose(glide, expected, atol=0.06)


def test_readings_fit_together(environment: Environment) -> None:
    result = sensor(environment, set="air_data")
    readings = {m.name: m for m in result.measure(3, START_NS) if isinstance(m, Reading)}
    assert readings["total_pressure"].unit == "Pa"
    assert readings["mach"].value == pytest.approx(environment.state(result.t[3:4]).tas[0] / 340.0, rel=0.03)
    assert readings["normal_acceleration"].value == pytest.approx(9.8, abs=1.5)
    assert next(m.station for m in result.measure(3, START_NS) if isinstance(m, DmeRange)) == "dme_1"
