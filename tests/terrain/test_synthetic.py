import numpy as np
import pytest

from fti.terrain.synthetic import buildings, forest, fractal_relief


def rng() -> np.random.Generator:
    return np.random.default_rng(11)


def test_relief_has_the_stated_roughness_and_band() -> None:
    relief = fractal_relief((256, 512), 5.0, rng(), sd=4.0, longest_m=500.0, shortest_m=40.0)
    assert relief.std() == pytest.approx(4.0) and abs(relief.mean()) < 1e-9
    power = np.abs(np.fft.rfft2(relief)) ** 2
    frequency = np.hypot(np.fft.fftfreq(256, 5.0)[:, None], np.fft.rfftfreq(512, 5.0)[None, :])
    band = (frequency >= 1 / 500.0) & (frequency <= 1 / 40.0)
    assert power[~band].sum() < 1e-20 * power.sum()
    low, high = power[band & (frequency < 0.004)].mean(), power[band & (frequency > 0.016) & (frequency < 0.025)].mean()
    slope = np.log(low / high) / np.log(0.0195 / 0.003)
    assert slope == pytest.approx(2 * 0.8 + 2, abs=0.7)


def test_sizes_that_are_no_block_are_cut() -> None:
    assert fractal_relief((37, 91), 5.0, rng(), sd=1.0, longest_m=150.0, shortest_m=20.0).shape == (37, 91)


def test_forest_covers_its_share_between_10_and_25_m() -> None:
    canopy = forest((400, 600), 5.0, rng(), cover=0.3)
    under = canopy > 0
    assert under.mean() == pytest.approx(0.3, abs=0.01)
    assert canopy[under].min() >= 10.0 and canopy[under].max() <= 25.0
    edges = (under[:, 1:] != under[:, :-1]).sum(axis=1).mean() / (600 * 5.0 / 1000)
    assert 1.0 < edges < 30.0  # edges a kilometre: stands of some hundred metres, not single trees


def test_buildings_are_blocks_of_stated_size() -> None:
    heights = buildings((400, 500), 5.0, rng(), per_km2=20.0)
    built = heights[heights > 0]
    assert built.min() >= 4.0 and built.max() <= 18.0
    assert 50 * 100 < len(built) * 25.0 < 120 * 1600  # 100 blocks of 100 to 1600 m2


def test_same_generator_same_bytes() -> None:
    assert (forest((64, 64), 5.0, rng()) == forest((64, 64), 5.0, rng())).all()
    assert (buildings((64, 64), 5.0, rng()) == buildings((64, 64), 5.0, rng())).all()
