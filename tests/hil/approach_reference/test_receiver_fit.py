"""A receiver is found again from what it measured; the oracle over level ground is a closed form.

A cone of the half width b that is banked by r over level ground, h below, has its nearest point at h / cos(r - b) where
r > b, and straight below at h otherwise.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fti import config as configuration
from fti.arrays import Array
from fti.config import Device
from fti.errors import ConfigError
from fti.hil.approach_reference.fit_samples import FitSamples
from fti.hil.approach_reference.fitted_receiver import FittedReceiver, as_toml, fit_receiver
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import cosine_antenna
from fti.ranging.radar.edge import LeadingEdge
from fti.ranging.sensor import sensor_poses
from fti.terrain.terrain import Terrain

LAT, LON = math.radians(48.0), math.radians(11.0)
BEAM_DEG, BIAS_M, SCALE = 60.0, 2.0, 1.01
NOISE_M = 0.5


def terrain(heights: Array | None = None, cell_m: float = 40.0) -> Terrain:
    """8 km to each side."""
    n = round(16_000 / cell_m) + 1
    posts = np.zeros((n, n)) if heights is None else heights
    return Terrain.from_array(posts, cell_m, lat0=LAT, lon0=LON, east0=-8000.0, north0=-8000.0)


def device(kind: str = "radar", **altimeter: Any) -> Device:
    limits = {"kind": kind, "range_m": (0.5, 900.0), **altimeter}
    return Device.model_validate({"name": "altimeter", "link": "l", "driver": "d", "altimeter": limits})


def poses(count: int, rng: np.random.Generator, max_bank_deg: float, half_m: float = 200.0) -> dict[str, Any]:
    """Random ones around the origin, 100 to 400 m high, every half second.  Within 200 m the Earth falls by 6 mm."""
    bank, height = np.radians(rng.uniform(-max_bank_deg, max_bank_deg, count)), rng.uniform(100.0, 400.0, count)
    zero = np.zeros(count)
    return {
        "t": 0.5 * np.arange(count),
        "session": np.zeros(count, dtype=int),
        "lat": LAT + rng.uniform(-half_m, half_m, count) / 6.38e6,
        "lon": LON + rng.uniform(-half_m, half_m, count) / 4.3e6,
        "alt": height,
        "roll": bank,
        "pitch": zero,
        "heading": rng.uniform(0.0, 2.0 * np.pi, count),
        "vel_n": np.zeros((count, 3)),
        "vertical_sd": np.zeros(count),
    }


def cone_over_level(pose: dict[str, Any], beam_deg: float) -> Array:
    beyond = np.maximum(np.abs(pose["roll"]) - math.radians(0.5 * beam_deg), 0.0)
    return np.asarray(pose["alt"] / np.cos(beyond))


def measured(seed: int, count: int = 600, max_bank_deg: float = 55.0, alike_s: float = 0.0) -> FitSamples:
    """By the closed form, with noise that is alike for so long, and one sample of twenty 30 to 90 m short."""
    rng = np.random.default_rng(seed)
    pose = poses(count, rng, max_bank_deg)
    noise = rng.normal(0.0, NOISE_M, count)
    if alike_s:
        noise = noise[(pose["t"] // alike_s).astype(int)] + rng.normal(0.0, 0.1, count)
    value = SCALE * cone_over_level(pose, BEAM_DEG) + BIAS_M + noise
    outliers = rng.random(count) < 0.05
    value[outliers] -= rng.uniform(30.0, 90.0, int(outliers.sum()))
    return FitSamples(value=value, **pose)


def fit(samples: FitSamples, **altimeter: Any) -> FittedReceiver:
    return fit_receiver(device(**altimeter), terrain(), samples, models=("nearest",))


TRUE = {"beam_deg": BEAM_DEG, "bias_m": BIAS_M, "scale": SCALE}


def test_beam_bias_and_scale_are_found_where_others_are_configured() -> None:
    fitted_receiver = fit(measured(1))
    for name, value, sd, configured in fitted_receiver.rows():
        assert value == pytest.approx(TRUE[name], abs=3.0 * sd), name
        assert configured == {"beam_deg": 40.0, "bias_m": 0.0, "scale": 1.0}[name]
    assert fitted_receiver.fit.sd_of("beam_deg") < 0.5
    assert fitted_receiver.fit.sd_of("bias_m") < 0.3
    assert fitted_receiver.fit.sd_of("scale") < 0.001
    assert fitted_receiver.fit.unobservable == ()
    before, after = fitted_receiver.rms()
    assert before > 5.0
    assert after == pytest.approx(NOISE_M, rel=0.15)
    assert (~fitted_receiver.used).mean() == pytest.approx(0.05, abs=0.02)


@pytest.mark.parametrize("alike_s", [0.0, 10.0])
def test_the_sigmas_hold_also_where_neighbours_err_alike(alike_s: float) -> None:
    """Of 8 fits the squares of error over sigma are 1 in the mean; of 24 numbers, three of which hang together, 0.2
    to 2.0 hold it: 30 blocks of 10 s make a sigma itself uncertain by an eighth, and of two sigmas the larger counts.
    """
    squares = []
    for seed in range(8):
        fitted_receiver = fit(measured(100 + seed, alike_s=alike_s))
        squares.append([((value - TRUE[name]) / sd) ** 2 for name, value, sd, _ in fitted_receiver.rows()])
    assert 0.2 < np.mean(squares) < 2.0


def test_what_level_flight_over_level_ground_does_not_show_is_marked() -> None:
    fitted_receiver = fit(measured(2, max_bank_deg=0.0), beam_deg=45.0)
    assert fitted_receiver.fit.unobservable == ("beam_deg",)
    assert fitted_receiver.fit["beam_deg"] == pytest.approx(45.0, abs=5.0)
    assert fitted_receiver.fit["bias_m"] == pytest.approx(BIAS_M, abs=0.3)
    assert "not observable: close to the assumed value" in as_toml(fitted_receiver, "altimeter", ["x"])


def test_what_navigation_does_not_know_of_its_height_is_not_known_of_the_bias() -> None:
    samples = measured(3)
    samples.vertical_sd[:] = 2.5
    assert fit(samples).fit.sd_of("bias_m") == pytest.approx(2.5, abs=0.05)
    samples.session[len(samples) // 2 :] = 1
    assert fit(samples).fit.sd_of("bias_m") == pytest.approx(2.5 / math.sqrt(2.0), abs=0.05)


def test_a_laser_has_bias_and_scale_alone() -> None:
    rng = np.random.default_rng(4)
    pose = poses(300, rng, 40.0)
    value = SCALE * pose["alt"] / np.cos(pose["roll"]) + BIAS_M + rng.normal(0.0, 0.1, 300)
    fitted_receiver = fit_receiver(device("laser"), terrain(), FitSamples(value=value, **pose))
    assert (fitted_receiver.model, fitted_receiver.fit.names) == ("laser", ("bias_m", "scale"))
    assert fitted_receiver.fit["bias_m"] == pytest.approx(BIAS_M, abs=0.1)
    assert fitted_receiver.fit["scale"] == pytest.approx(SCALE, abs=5e-4)


def test_a_leading_edge_is_distinguished_from_a_nearest_return_with_its_threshold() -> None:
    """Over hills, by the instrument of the product: 50 deg wide, -12 dB."""
    side = np.arange(-8000.0, 8001.0, 40.0)
    ground = terrain(60.0 * np.sin(side / 60.0)[None, :] * np.cos(side / 75.0)[:, None])
    rng = np.random.default_rng(5)
    pose = poses(300, rng, 35.0, 1000.0)
    width = math.radians(50.0)
    radar = RadarAltimeter(antenna=cosine_antenna(width, width), edge=LeadingEdge(10.0**-1.2), max_range=1350.0)
    position, rpy = (pose["lat"], pose["lon"], pose["alt"]), (pose["roll"], pose["pitch"], pose["heading"])
    d = radar.measure(ground, sensor_poses(ground.frame, position, rpy)).slant_range
    value = SCALE * d + BIAS_M + rng.normal(0.0, NOISE_M, 300)
    known = np.isfinite(value)
    samples = FitSamples(value=value[known], **{name: column[known] for name, column in pose.items()})
    fitted_receiver = fit_receiver(device(), ground, samples)
    assert fitted_receiver.model == "beam"
    assert fitted_receiver.others["nearest"] > 1.5 * fitted_receiver.fit.sd
    for name, true in {**TRUE, "beam_deg": 50.0, "threshold_db": -12.0}.items():
        assert fitted_receiver.fit[name] == pytest.approx(true, abs=3.0 * fitted_receiver.fit.sd_of(name)), name
    assert fitted_receiver.fit.sd_of("threshold_db") < 1.0
    assert fitted_receiver.fit.sd_of("beam_deg") < 3.0


def test_what_is_written_is_what_a_configuration_takes() -> None:
    fitted_receiver = fit(measured(6))
    text = as_toml(fitted_receiver, "altimeter", ["data/a b_0"])
    table = configuration.parse_toml(text, "receiver.toml")["device"]["altimeter"]
    altimeter = device(**table).altimeter
    assert altimeter is not None
    assert altimeter.beam_deg == pytest.approx(fitted_receiver.fit["beam_deg"], abs=0.006)
    assert altimeter.model == "nearest"
    assert altimeter.bias_m == pytest.approx(fitted_receiver.fit["bias_m"], abs=0.006)
    assert altimeter.scale == pytest.approx(fitted_receiver.fit["scale"], abs=1e-5)


def test_too_few_samples_and_ground_that_is_not_known_are_refused() -> None:
    with pytest.raises(ConfigError, match="altimeter: only 40 samples with a position; a fit needs 50"):
        fit(measured(7, count=40))
    outside = measured(8)
    outside.lat[:] += 0.1
    with pytest.raises(ConfigError, match="altimeter: half of the samples have no prediction"):
        fit(outside)
