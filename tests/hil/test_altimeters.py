"""The laser altimeter, in clear air and in fog; devices that the configuration describes."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fti import config, drivers
from fti.config import Device
from fti.devices import BoundDevice
from fti.drivers import lightware_ascii
from fti.errors import ConfigError
from fti.hil.environment import Environment
from fti.hil.faults.values import DeviceFaults
from fti.hil.sensors import MODELS, SimulatedSensor
from fti.hil.tables.fault_types import Fog
from fti.hil.tables.schema import AirConditions, SensorSettings
from fti.messages.measurements import Attitude, Measurement, RadioHeight, Range, Reading, Stamp, Temperature
from fti.terrain.terrain import Terrain
from tests.hil.worlds import flat_terrain, path, scenario, world

START_NS = 1_700_000_000_000_000_000


@cache
def environment() -> Environment:
    return world(duration_s=30.0)


def sensor(driver: str, options: dict[str, Any] | None = None, **keys: object) -> SimulatedSensor:
    device = Device.model_validate({"name": "device", "link": "line", "driver": driver, **keys})
    module = drivers.load(driver)
    bound = BoundDevice(device, module, config.bind(module.Options, options or {}, "test"))
    return SimulatedSensor(bound, MODELS[driver], environment(), seed=1)


def samples(result: SimulatedSensor) -> list[list[Measurement]]:
    return [result.measure(k, START_NS) for k in range(len(result.t))]


def ranges(result: SimulatedSensor) -> list[Range]:
    return [m for sample in samples(result) for m in sample if isinstance(m, Range)]


# ----------------------------------------------------------------------------------------------------------- laser


@pytest.mark.parametrize("driver", ["lightware_ascii", "lightware_binary"])
def test_a_laser_measures_nine_times_a_second_with_its_noise(driver: str) -> None:
    result = sensor(driver)
    assert len(result.t) == pytest.approx(270, abs=1)
    state = environment().state(result.t)
    height = state.alt - environment().ground(state)
    expected = height / (np.cos(state.roll) * np.cos(state.pitch))
    error = np.array([m.slant_range for m in ranges(result)]) - expected
    assert error.std() == pytest.approx(0.05, rel=0.4)
    assert abs(error.mean()) < 0.05


def test_the_beam_goes_along_the_mounting() -> None:
    """30 degrees to the side the ground is 15 % further away, but for the bank of the aircraft."""
    down, side = (
        np.array([m.slant_range for m in ranges(sensor("lightware_ascii", rpy_bs_deg=(roll, 0.0, 0.0)))])
        for roll in (0.0, 30.0)
    )
    bank = environment().state(sensor("lightware_ascii").t).roll
    np.testing.assert_allclose(side / down, np.cos(bank) / np.cos(bank + math.radians(30.0)), rtol=5e-3)


def test_above_its_range_the_signal_is_lost_and_the_line_says_so() -> None:
    result = sensor("lightware_ascii", altimeter={"kind": "laser", "range_m": (0.2, 200.0)})
    first, last = ranges(result)[0], ranges(result)[-1]
    assert (first.valid, first.slant_range) == (False, None)
    assert last.valid
    assert result.encoder.encode(first) == [b"130.00\r"]
    (line,) = result.encoder.encode(last)
    decoder = lightware_ascii.make_decoder(lightware_ascii.Options(first_line="take"))
    (decoded,) = decoder.feed(line, 1)
    assert isinstance(decoded, Range)
    assert decoded.slant_range == pytest.approx(last.slant_range, abs=0.0051)


def test_the_strength_of_the_return_falls_with_the_distance() -> None:
    strengths = [m.value for sample in samples(sensor("lightware_binary")) for m in sample if isinstance(m, Reading)]
    assert strengths[0] is not None
    assert strengths[-1] is not None
    assert 0.0 < strengths[0] < strengths[-1] <= 100.0


# ------------------------------------------------------------------------------------------------------------- fog


def in_fog(fog: Fog, t: float, slant_range: float | None) -> tuple[float | None, bool]:
    message = Range(stamp=Stamp(5), slant_range=slant_range, valid=slant_range is not None)
    height = RadioHeight(stamp=Stamp(5), height_agl=300.0)
    decoded, radar = DeviceFaults("laser", [fog]).apply(t, [message, height])
    assert isinstance(decoded, Range)
    assert radar == height
    assert decoded.stamp == Stamp(5)
    return decoded.slant_range, decoded.valid


def test_in_fog_a_laser_loses_the_ground() -> None:
    fog = Fog(kind="fog", from_s=10.0, to_s=20.0, visibility_m=100.0)
    assert in_fog(fog, 15.0, 150.0) == (None, False)
    assert in_fog(fog, 15.0, 99.0) == (99.0, True)
    assert in_fog(fog, 15.0, None) == (None, False)
    assert in_fog(fog, 9.9, 150.0) == (150.0, True)
    assert in_fog(fog, 20.0, 150.0) == (150.0, True)


def test_or_it_takes_the_fog_for_the_ground_and_does_not_say_so() -> None:
    """From 75 m to 5 m, as in flight test 3 of Spiegel 2018; half way it is 40 m."""
    fog = Fog(kind="fog", from_s=10.0, to_s=20.0, visibility_m=100.0, echo_m=(75.0, 5.0))
    assert in_fog(fog, 10.0, 300.0) == (75.0, True)
    assert in_fog(fog, 15.0, None) == (40.0, True)
    assert in_fog(fog, 15.0, 60.0) == (60.0, True)


# ------------------------------------------------------------------------------------------------ described devices


def test_a_described_device_is_flown_with_what_its_fields_carry() -> None:
    fields = [
        {"name": "static_air_temperature", "unit": "degC"},
        {"name": "true_heading", "unit": "deg"},
        {"name": "humidity", "limits": [20, 60]},
    ]
    line = "{static_air_temperature:.1f},{true_heading:.1f},{slant_range:.2f},{humidity:.1f}"
    options = {"line": line, "fields": fields, "first_line": "take"}
    result = sensor("ascii_line", options)
    assert len(result.t) == pytest.approx(300, abs=1)
    lines = [line for sample in samples(result) for m in sample for line in result.encoder.encode(m)]
    assert len(lines) == len(result.t)
    module = drivers.load("ascii_line")
    measurements = module.make_decoder(config.bind(module.Options, options, "test")).feed(b"".join(lines), 1)
    temperatures = [m.static for m in measurements if isinstance(m, Temperature)]
    headings = [m.heading for m in measurements if isinstance(m, Attitude)]
    humidities = [m.value for m in measurements if isinstance(m, Reading)]
    assert all(t is not None and 270.0 < t < 300.0 for t in temperatures)
    assert all(h is not None and abs(math.degrees(h) - 250.0) < 15.0 for h in headings)
    assert all(h is not None and 20.0 <= h <= 60.0 for h in humidities)
    assert len(temperatures) == len(headings) == len(humidities) == len(result.t)


def test_a_described_radar_altimeter_measures_radio_height() -> None:
    fields = [{"name": "radio_height", "at": 1, "type": "u16", "unit": "ft"}]
    result = sensor("binary_struct", {"sync": "a5", "length": 3, "fields": fields})
    assert [m for m in samples(result)[-1] if isinstance(m, RadioHeight)]
    assert not ranges(result)


# ------------------------------------------------------------------------------------------------ the FMCW altimeter


def radar_heights(model: str | None, terrain: Terrain | None = None, **keys_of_sensor: float) -> NDArray[np.float64]:
    """What a radar altimeter says over a terrain, with the noise of the same seed; NaN without a height [m]."""
    settings_keys = keys_of_sensor | ({} if model is None else {"model": model})
    settings = {"device": SensorSettings.model_validate(settings_keys)} if settings_keys else {}
    plan = scenario(flight=environment().scenario.flight, sensor=settings)
    there = Environment(plan, path(), terrain or flat_terrain(), undulation=47.0)
    keys = {"kind": "radar", "range_m": (0.5, 762.0), "beam_deg": 40.0}
    device = Device.model_validate({"name": "device", "link": "l", "driver": "freeflight_ra4500", "altimeter": keys})
    module = drivers.load("freeflight_ra4500")
    result = SimulatedSensor(BoundDevice(device, module, module.Options()), MODELS["freeflight_ra4500"], there, seed=1)
    heights = [m.height_agl for sample in samples(result) for m in sample if isinstance(m, RadioHeight)]
    return np.array([math.nan if height is None else height for height in heights])


def test_over_level_ground_both_radars_read_the_same_but_for_the_comb_of_the_rays() -> None:
    """The edge of 2051 rays lies up to 0.85 m behind the nearest point, never before it."""
    long_by = radar_heights("fmcw") - radar_heights("nearest")
    assert np.isfinite(long_by).all()
    assert long_by.min() > -0.05
    assert long_by.max() < 0.9
    np.testing.assert_array_equal(radar_heights(None), radar_heights("nearest"))


def test_the_fmcw_radar_looks_past_a_mast_that_the_nearest_return_sees() -> None:
    heights = flat_terrain().finest.heights.copy()
    heights[::15, ::15] = 30.0  # every 300 m one post
    masts = flat_terrain().with_finest(heights)
    past = radar_heights("fmcw", masts) - radar_heights("nearest", masts)
    assert np.nanmax(past) > 5.0


@pytest.mark.parametrize("model", ["nearest", "fmcw"])
def test_bias_and_scale_of_the_instrument_are_in_what_it_reports(model: str) -> None:
    bare, wrong = radar_heights(model), radar_heights(model, bias_m=2.0, scale=1.01)
    step = np.where(bare > 152.0, 20.0, 5.0) * 0.3048  # of the RA-4500, 499 ft
    assert (np.abs(wrong - (1.01 * bare + 2.0)) < 1.01 * step + 0.1).all()
    assert np.mean(wrong - bare) == pytest.approx(0.01 * np.mean(bare) + 2.0, abs=0.5)


def test_the_beam_need_not_be_the_one_that_is_configured() -> None:
    """Ridges beside the flight come into a wider beam, and into a deeper threshold."""
    heights = flat_terrain().finest.heights.copy()
    heights[::10, :] = 60.0
    ridges = flat_terrain().with_finest(heights)
    assert np.nanmean(radar_heights("nearest", ridges) - radar_heights("nearest", ridges, beam_deg=70.0)) > 3.0
    by_threshold = radar_heights("fmcw", ridges, threshold_db=-3.0) - radar_heights("fmcw", ridges, threshold_db=-20.0)
    assert np.nanmean(by_threshold) > 1.0


def test_a_model_that_there_is_not_is_refused_by_its_key() -> None:
    with pytest.raises(ConfigError, match=r"sensor.device.model = 'best'.*'nearest' or 'fmcw'"):
        radar_heights("best")


# --------------------------------------------------------------------------------------------------- fog of the air


def laser_ranges(**air: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What a laser sees on the small approach in that air, and how high it is above the ground [m]."""
    there = Environment(
        scenario(flight=environment().scenario.flight, air=AirConditions(**air)),
        path(),
        flat_terrain(),
        undulation=47.0,
    )
    device = Device.model_validate({
        "name": "laser", "link": "l", "driver": "lightware_ascii",
        "altimeter": {"kind": "laser", "range_m": (0.2, 500.0), "beam_deg": 0.2},
    })  # fmt: skip
    t = np.arange(0.0, 30.0, 0.5)
    state = there.state(t)
    return there.laser_ranges(t, device), state.alt - there.ground(state)


def test_through_thin_fog_the_ground_is_seen_and_dense_fog_is_taken_for_it() -> None:
    """Fog up to 100 m under an aircraft that comes down from 250 m.

    A pulse of 1.5 m gets 0.9 % back from fog of 100 m visibility: as far as 107 m where dark ground is seen from 500 m.
    """
    clear, height = laser_ranges()
    assert np.isfinite(clear).all()
    np.testing.assert_array_equal(laser_ranges(visibility_m=5000.0, fog_top_m=100.0)[0], clear)
    dense, _ = laser_ranges(visibility_m=100.0, fog_top_m=100.0)
    far, near = height > 210.0, height < 204.0
    assert min(far.sum(), near.sum()) > 5
    assert np.isnan(dense[far]).all()
    np.testing.assert_allclose(dense[near], height[near] - 100.0, rtol=0.01, atol=0.5)


def test_inside_fog_a_laser_sees_the_length_of_its_pulse() -> None:
    inside, _ = laser_ranges(visibility_m=100.0, fog_top_m=400.0)
    np.testing.assert_allclose(inside, 1.5, atol=0.01)
