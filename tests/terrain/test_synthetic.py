import numpy as np
import pytest

from fti.terrain.synthetic import buildings, fields, forest, fractal_relief, irregular_steps, ridges


def rng() -> np.random.Generator:
    return np.random.default_rng(11)


def test_relief_has_the_stated_roughness_and_band() -> None:
    relief = fractal_relief((256, 512), 5.0, rng(), sd=4.0, max_size_m=500.0, min_size_m=40.0)
    assert relief.std() == pytest.approx(4.0) and abs(relief.mean()) < 1e-9
    power = np.abs(np.fft.rfft2(relief)) ** 2
    frequency = np.hypot(np.fft.fftfreq(256, 5.0)[:, None], np.fft.rfftfreq(512, 5.0)[None, :])
    band = (frequency >= 1 / 500.0) & (frequency <= 1 / 40.0)
    assert power[~band].sum() < 1e-20 * power.sum()


@pytest.mark.parametrize("hurst", [0.3, 0.5, 0.8])
def test_spectrum_of_relief_falls_by_its_hurst_exponent(hurst: float) -> None:
    """A line through the logarithms of 16 000 waves, each exponential: their sd of 1.28 leaves 0.02 of the slope."""
    relief = fractal_relief((512, 512), 5.0, rng(), sd=4.0, max_size_m=1000.0, min_size_m=20.0, hurst=hurst)
    power = np.abs(np.fft.fft2(relief)) ** 2
    frequency = np.hypot(np.fft.fftfreq(512, 5.0)[:, None], np.fft.fftfreq(512, 5.0)[None, :])
    band = (frequency >= 1 / 1000.0) & (frequency <= 1 / 20.0)
    slope = np.polyfit(np.log(frequency[band]), np.log(power[band]), 1)[0]
    assert slope == pytest.approx(-(2.0 * hurst + 2.0), abs=0.07)


def test_sizes_that_are_no_block_are_cut() -> None:
    assert fractal_relief((37, 91), 5.0, rng(), sd=1.0, max_size_m=150.0, min_size_m=20.0).shape == (37, 91)


def test_forest_covers_its_share_between_10_and_25_m() -> None:
    canopy = forest((400, 600), 5.0, rng(), cover=0.3)
    under = canopy > 0
    assert under.mean() == pytest.approx(0.3, abs=0.01)
    assert canopy[under].min() >= 10.0 and canopy[under].max() <= 25.0
    edges = (under[:, 1:] != under[:, :-1]).sum(axis=1).mean() / (600 * 5.0 / 1000)
    assert 1.0 < edges < 30.0  # edges a kilometre: stands of some hundred metres, not single trees


def test_irregular_steps_reach_the_end_and_keep_to_their_sizes() -> None:
    steps = irregular_steps(-300.0, 5000.0, rng(), min_size_m=80.0, max_size_m=200.0)
    sizes = np.diff(steps)
    assert steps[0] == -300.0 and steps[-1] > 5000.0
    assert sizes.min() >= 80.0 and sizes.max() <= 200.0 and sizes.std() > 20.0


def test_ridges_and_hollows_alternate_and_have_no_period() -> None:
    relief = ridges(np.arange(0.0, 40000.0, 5.0), rng(), low=5.0, high=9.0, min_size_m=100.0, max_size_m=200.0)
    rising = np.diff(relief) > 0
    turns = np.flatnonzero(rising[1:] != rising[:-1]) + 1
    assert (np.sign(relief[turns][1:]) == -np.sign(relief[turns][:-1])).all()
    assert np.abs(relief[turns]).min() >= 4.9 and np.abs(relief).max() <= 9.0
    assert np.diff(turns).min() * 5.0 >= 95.0 and np.diff(turns).max() * 5.0 <= 205.0
    lags = range(100, 1000)  # 500 m to 5 km: nowhere is it like itself again
    assert max(float(np.corrcoef(relief[:-lag], relief[lag:])[0, 1]) for lag in lags) < 0.5


def test_fields_hold_trees_where_wooded_and_crops_elsewhere() -> None:
    along = np.arange(0.0, 20000.0, 5.0)
    wooded = np.sin(along / 60.0) > 0.0
    height = fields(along, wooded, rng(), min_size_m=80.0, max_size_m=200.0)
    assert height[wooded].min() >= 9.0 and height[wooded].max() <= 18.0
    assert height[~wooded].min() >= 0.0 and height[~wooded].max() <= 4.0
    crop_sizes = 20000.0 / len(np.unique(height[~wooded]))
    assert 80.0 <= crop_sizes <= 200.0


def test_buildings_are_blocks_of_stated_size() -> None:
    heights = buildings((400, 500), 5.0, rng(), per_km2=20.0)
    built = heights[heights > 0]
    assert built.min() >= 4.0 and built.max() <= 18.0
    assert 50 * 100 < len(built) * 25.0 < 120 * 1600  # 100 blocks of 100 to 1600 m2


def test_same_generator_same_bytes() -> None:
    assert (forest((64, 64), 5.0, rng()) == forest((64, 64), 5.0, rng())).all()
    assert (buildings((64, 64), 5.0, rng()) == buildings((64, 64), 5.0, rng())).all()
