"""The statistics of the error model come back: each against its own spread over independent surveys."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.terrain.dem_error import Changes, DemError, correlated_noise
from fti.terrain.landscape import Cover, Landscape, SensedSurface
from fti.terrain.synthetic import fractal_relief
from fti.terrain.synthetic_landscape import synthetic_landscape
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]

SHAPE, CELL = (141, 141), 10.0
FLAT = Terrain.from_array(np.zeros(SHAPE), CELL, east0=-700.0, north0=-700.0)
#: Student's t for 15 degrees of freedom at 0.1 %, both sides: the mean of 16 surveys lies so many of its own standard
#: errors beside the truth in one test of a thousand, and the seeds are fixed.
SURVEYS, T_001 = 16, 4.07


def errors(error: DemError, surveys: int, seed: int) -> Array:
    """Error of every post over flat ground, (surveys, rows, columns) [m]."""
    rng = np.random.default_rng(seed)
    return np.array([error.apply(FLAT, rng).finest.heights for _ in range(surveys)])


def assert_mean(per_survey: Array, expected: float) -> None:
    limit = T_001 * per_survey.std(ddof=1) / np.sqrt(len(per_survey))
    assert abs(per_survey.mean() - expected) < limit, f"{per_survey.mean()} beside {expected} +- {limit}"


def test_bias_and_standard_deviation_come_back(scale: int) -> None:
    values = errors(DemError(bias=1.5, noise_sd=2.0), SURVEYS * scale, 1)
    assert_mean(values.mean(axis=(1, 2)), 1.5)
    assert_mean(((values - 1.5) ** 2).mean(axis=(1, 2)), 4.0)
    spread = 2.0 * np.sqrt(0.5 * 2 * np.pi * 300.0**2 / 1410.0**2)  # of a survey's mean, if its parts were far apart
    assert values.mean(axis=(1, 2)).std() == pytest.approx(spread, rel=0.5)


@pytest.mark.parametrize(("length", "lags"), [(30.0, (1, 3, 9)), (300.0, (3, 30, 60))])
def test_noise_is_correlated_over_its_length(length: float, lags: tuple[int, ...], scale: int) -> None:
    rng = np.random.default_rng(int(length))
    fields = np.array([correlated_noise(SHAPE, CELL, rng, length) for _ in range(SURVEYS * scale)])
    for lag in lags:
        expected = np.exp(-lag * CELL / length)
        assert_mean((fields[:, lag:] * fields[:, :-lag]).mean(axis=(1, 2)), expected)
        assert_mean((fields[:, :, lag:] * fields[:, :, :-lag]).mean(axis=(1, 2)), expected)
    lag = lags[1]  # across, as along: 1/e lies on a circle
    assert_mean((fields[:, lag:, lag:] * fields[:, :-lag, :-lag]).mean(axis=(1, 2)), np.exp(-np.sqrt(2.0)))
    assert_mean((fields**2).mean(axis=(1, 2)), 1.0)


def test_one_side_of_the_noise_does_not_know_the_other() -> None:
    """600 m apart at 30 m: nothing, where a field without a margin has 0.26.  100 fields of 10 lengths: 0.03."""
    rng = np.random.default_rng(12)
    fields = np.array([correlated_noise((61, 61), CELL, rng, 30.0) for _ in range(100)])
    for first, last in ((fields[:, 0], fields[:, -1]), (fields[:, :, 0], fields[:, :, -1])):
        assert abs((first * last).mean()) < 0.1


def test_variance_is_split_as_stated(scale: int) -> None:
    values = errors(DemError(noise_sd=1.0, short_share=0.8), SURVEYS * scale, 3)
    for lag in (2, 10, 30):
        expected = 0.8 * np.exp(-lag * CELL / 30.0) + 0.2 * np.exp(-lag * CELL / 300.0)
        assert_mean((values[:, :, lag:] * values[:, :, :-lag]).mean(axis=(1, 2)), expected)


def test_share_and_size_of_outliers_come_back() -> None:
    values = errors(DemError(outlier_share=0.01, outlier_sd=20.0), 8, 4)
    count, posts = np.count_nonzero(values), values.size
    assert count == pytest.approx(0.01 * posts, abs=3.3 * np.sqrt(0.01 * 0.99 * posts))  # binomial, 0.1 %
    assert values[values != 0.0].std() == pytest.approx(20.0, rel=3.3 / np.sqrt(2.0 * count))
    assert_mean(np.count_nonzero(values, axis=(1, 2)) / values[0].size, 0.01)


def relief(seed: int = 9, sd: float = 30.0) -> Terrain:
    rng = np.random.default_rng(seed)
    heights = fractal_relief(SHAPE, CELL, rng, sd=sd, max_size_m=1500.0, min_size_m=150.0)
    return Terrain.from_array(heights, CELL, east0=-700.0, north0=-700.0)


def inside() -> tuple[Array, Array]:
    east, north = np.meshgrid(np.arange(-600.0, 601.0, 13.0), np.arange(-600.0, 601.0, 13.0))
    return east, north


def test_shift_is_found_by_cross_correlation() -> None:
    truth = relief()
    dem = DemError(noise_sd=1.5, shift_east=12.0, shift_north=-7.0).apply(truth, np.random.default_rng(6))
    east, north = inside()
    known = dem.up(east, north)
    alike = {
        (de, dn): float(np.corrcoef(known.ravel(), truth.up(east - de, north - dn).ravel())[0, 1])
        for de in range(6, 19)
        for dn in range(-13, 0)
    }
    best = max(alike, key=lambda shift: alike[shift])
    assert np.abs(np.array(best) - (12, -7)).max() <= 1  # 1.5 m of noise on slopes of 0.2 leave less than 1 m
    assert alike[best] > alike[12, -1] and alike[best] > 0.99


def test_horizontal_error_becomes_vertical_on_a_slope() -> None:
    """Eq. 2.49: exact on a plane, to first order elsewhere."""
    east, north = inside()
    layer = FLAT.finest
    slope = FLAT.with_finest(0.2 * layer.east[None, :] - 0.1 * layer.north[:, None])
    error = DemError(bias=0.5, shift_east=12.0, shift_north=-7.0)
    dem = error.apply(slope, np.random.default_rng(1))
    expected = np.full_like(east, -(0.2 * 12.0 + 0.1 * 7.0) + 0.5)
    assert dem.up(east, north) - slope.up(east, north) == pytest.approx(expected, abs=1e-9)
    hills = relief()
    moved = DemError(shift_east=2.0, shift_north=1.0).apply(hills, np.random.default_rng(1))
    slope_east, slope_north = hills.gradient(east, north)
    wrong = moved.up(east, north) - hills.up(east, north)
    left = wrong + 2.0 * slope_east + slope_north
    assert left.std() < 0.08 * wrong.std()  # what the slope changes over 2 m, and over an edge between two cells
    assert np.abs(wrong).max() > 0.5


def test_holes_stay_holes_and_several_layers_are_refused() -> None:
    heights = np.zeros((5, 5))
    heights[2, 3] = np.nan
    holed = DemError(bias=1.0, noise_sd=1.0).apply(FLAT.with_finest(heights), np.random.default_rng(1))
    assert np.argwhere(np.isnan(holed.finest.heights)).tolist() == [[2, 3]]
    coarse = Terrain.from_array(np.zeros((20, 20)), 100.0, east0=-1000.0, north0=-1000.0)
    stack = Terrain((FLAT.finest, coarse.finest), FLAT.frame)
    with pytest.raises(ValueError, match="2 layers"):
        DemError(bias=1.0).apply(stack, np.random.default_rng(1))


def test_same_generator_same_bytes() -> None:
    error = DemError(bias=1.0, noise_sd=1.0, outlier_share=0.01)
    first, again = (error.apply(FLAT, np.random.default_rng(5)).finest.heights.tobytes() for _ in range(2))
    assert first == again


# ---------------------------------------------------------------------------------------------------- sensor and age


def test_model_of_a_radar_lies_a_share_of_the_canopy_above_the_ground() -> None:
    now = synthetic_landscape("forest", 1, extent_m=600.0)
    dem = DemError().survey(now, np.random.default_rng(1), sensed=SensedSurface.RADAR)
    over = dem.finest.heights - now.ground.finest.heights
    trees = now.cover == Cover.FOREST
    assert over[trees] == pytest.approx(0.7 * now.canopy[trees], abs=1e-9)


def then_of(changes: Changes, name: str) -> tuple[Landscape, Landscape]:
    now = synthetic_landscape(name, 2, extent_m=1500.0)
    return now, changes.revert(now, np.random.default_rng(7))


def test_trees_have_grown_and_stands_were_cut_and_planted() -> None:
    now, then = then_of(Changes(growth=3.0, cleared_forest=0.1, new_forest=0.2), "forest")
    forest_now, forest_then = now.cover == Cover.FOREST, then.cover == Cover.FOREST
    both = forest_now & forest_then
    assert now.canopy[both] - then.canopy[both] == pytest.approx(np.full(both.sum(), 3.0), abs=1e-12)
    assert (forest_now & ~forest_then).sum() / forest_now.sum() == pytest.approx(0.2, abs=0.1)
    assert (~forest_now & forest_then).sum() / (~forest_now).sum() == pytest.approx(0.1, abs=0.07)
    assert (then.canopy[forest_now & ~forest_then] == 0.0).all()
    assert (then.canopy[~forest_now & forest_then] >= 10.0).all()
    edges = (forest_now ^ forest_then)[:, 1:] != (forest_now ^ forest_then)[:, :-1]
    assert edges.mean() < 0.02  # stands, not single posts


def test_changes_of_all_leave_nothing_behind() -> None:
    now, then = then_of(Changes(cleared_forest=1.0), "forest")
    assert not np.isin(then.cover, [Cover.BARE, Cover.GRASS, Cover.CROP]).any()
    _, then = then_of(Changes(new_forest=1.0), "forest")
    assert not (then.cover == Cover.FOREST).any()
    _, then = then_of(Changes(growth=18.0), "forest")  # what is lower than that was no forest
    stood = then.cover == Cover.FOREST
    assert (then.canopy[stood] > 0.0).all() and 0 < stood.sum() < (now.cover == Cover.FOREST).sum()
    assert (then.cover[(now.cover == Cover.FOREST) & (now.canopy <= 18.0)] == Cover.GRASS).all()


def test_new_buildings_are_missing_whole() -> None:
    now, then = then_of(Changes(new_buildings=0.3), "town")
    built = now.cover == Cover.BUILDING
    missing = built & (then.cover != Cover.BUILDING)
    roofs, gone = np.unique(now.canopy[built]), np.unique(now.canopy[missing])
    assert len(gone) == pytest.approx(0.3 * len(roofs), abs=3.3 * np.sqrt(0.21 * len(roofs)))
    assert (missing == np.isin(now.canopy, gone) & built).all()
    assert (then.cover[~built] == now.cover[~built]).all()


def test_old_model_has_no_new_house_where_there_is_one() -> None:
    now = synthetic_landscape("town", 2, extent_m=600.0)
    dem = DemError().survey(now, np.random.default_rng(7), sensed=SensedSurface.TOP, changes=Changes(new_buildings=1.0))
    built = now.cover == Cover.BUILDING
    short = now.surface.finest.heights - dem.finest.heights
    assert short[built] == pytest.approx(now.canopy[built], abs=1e-9) and np.abs(short[~built]).max() == 0.0


def test_wrong_figures_are_refused() -> None:
    for bad in ({"bias": np.nan}, {"noise_sd": -1.0}, {"short_share": 1.1}, {"outlier_share": -0.1}, {"long_m": 0.0}):
        with pytest.raises(ValueError, match=next(iter(bad))):
            DemError(**bad)
    for wrong in ({"growth": -1.0}, {"cleared_forest": 1.5}, {"new_forest": -0.1}, {"new_buildings": np.nan}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            Changes(**wrong)
