"""The smallest detectable obstacle: its search, and closed forms over level ground."""

import math

import numpy as np
import pytest
from scipy.stats import binom

from fti.hil.approach_reference import obstacles
from fti.hil.approach_reference.approaches import LASER, TerrainGround
from fti.hil.approach_reference.obstacles import (
    HEIGHTS_M,
    detectable_obstacles,
    lowest_rung,
    max_misses,
    min_obstacle_height,
    terrain_strip,
)
from fti.hil.approach_reference.options import ReferenceOptions
from fti.nav.integrity.approach import Airfield, ApproachPath
from fti.nav.integrity.reference import ApproachReference, Limits, Obstacles, ReferenceHeader, ReferenceProfile, grid
from fti.terrain.terrain import Terrain

S_MAX, SD_M, T4, LENGTH_M = 3000.0, 4.0, 5.0, 40.0
PLAN = ReferenceOptions(surface="level", date="2024-01-01", s_max=S_MAX, obstacle_runs=100)


@pytest.mark.parametrize("runs", [1, 98, 99, 100, 158, 500])
def test_so_few_misses_prove_the_pd(runs: int) -> None:
    """With a Pd of 0.97 that few would be seen in 5 % of the cases at most, one more in more."""
    m = max_misses(runs)
    assert m < 0 or binom.cdf(m, runs, 0.03) <= 0.05
    assert binom.cdf(m + 1, runs, 0.03) > 0.05


@pytest.mark.parametrize("missed", [0, 1, 4])
def test_the_least_rung_is_an_order_statistic_and_few_are_asked_twice(missed: int) -> None:
    rng, calls = np.random.default_rng(missed), list[tuple[int, int]]()
    needs = rng.integers(0, 9, 100)

    def is_detected(run: int, rung: int) -> bool:
        calls.append((run, rung))
        return bool(rung >= needs[run])

    assert lowest_rung(is_detected, 12, 100, missed) == np.sort(needs)[-1 - missed]
    assert len(calls) < 150
    assert lowest_rung(is_detected, int(np.sort(needs)[-1 - missed]), 100, missed) == np.sort(needs)[-1 - missed]


def test_the_table_promises_what_stands_in_its_row_and_nothing_beside_it() -> None:
    table = Obstacles(
        pd=0.97, width_m=(30.0, 60.0), s_m=(2000.0, 1000.0), agl_m=(100.0, 50.0),
        height_m=((40.0, 15.0), (25.0, 10.0)), runs=100,
    )  # fmt: skip
    calls = [
        (1500.0, 30.0),
        (1500.0, 59.0),
        (1500.0, 150.0),
        (1000.0, 60.0),
        (0.0, 30.0),
        (1500.0, 20.0),
        (2001.0, 60.0),
    ]
    assert [table.min_height(*place) for place in calls] == [40.0, 40.0, 25.0, 10.0, 15.0, math.inf, math.inf]


# ---------------------------------------------------------------------------------------------------- level ground


@pytest.fixture
def path() -> ApproachPath:
    return ApproachPath(
        Airfield(
            name="level", threshold_lat_deg=48.0, threshold_lon_deg=11.0, threshold_alt_m=0.0, course_deg=250.0,
            runway_length_m=1500.0, survey_date="2024-01-01",
        )
    )  # fmt: skip


@pytest.fixture
def ground(path: ApproachPath) -> TerrainGround:
    """Level within the curvature of the Earth, 5 m between the posts, 4 km around."""
    lat, lon = map(float, path.to_geodetic(1500.0, 0.0))
    flat = Terrain.from_array(np.zeros((1000, 1000)), 5.0, lat0=lat, lon0=lon, east0=-2500.0, north0=-2500.0)
    return TerrainGround(path, LASER, (flat,))


@pytest.fixture
def reference(path: ApproachPath) -> ApproachReference:
    s = grid(5.0, S_MAX)
    profile = ReferenceProfile(
        surface="level", made_from="terrain", date="2024-01-01", ds_m=5.0, s_max_m=S_MAX, draws=100, seed=1,
        window_m=400.0, correlation_m=LENGTH_M, datum_sd_m=1.0,
    )  # fmt: skip
    limits = Limits.model_validate(
        {f"t{k}": T4 for k in range(1, 5)}
        | {f"t{k}_interval": (1.0, 9.0) for k in range(1, 5)}
        | {
            "pfa": 0.01,
            "pmd": 1e-3,
            "runs": 1,
            "verified_runs": 0,
            "verified_alarms": 0,
            "seed": 1,
            "method": "by hand",
        }
        | {"t4_widths_m": (5.0, 15.0, 30.0, 50.0, 75.0, 100.0)}
    )
    header = ReferenceHeader(airfield=path.airfield, sensor=LASER.sensor, profile=profile, limits=limits)
    return ApproachReference(header, s, np.zeros_like(s), np.full_like(s, SD_M), np.full_like(s, 0.1))


def by_theory(bins: int) -> float:
    """Height at which a box over so many bins reaches the limit: H / s n / sqrt(sum rho^|i - j|)."""
    rho = (LENGTH_M - 5.0) / (LENGTH_M + 5.0)
    lag = np.abs(np.subtract.outer(np.arange(bins), np.arange(bins)))
    return T4 * SD_M / (bins / math.sqrt(float(np.sum(rho**lag))))


def test_over_level_ground_it_is_the_height_that_the_templates_need(
    ground: TerrainGround, reference: ApproachReference
) -> None:
    """A flight's own errors, of elevation and attitude, are 1 to 2 m: up to the next height or the one behind it."""
    value = min_obstacle_height(ground, PLAN, reference, (100.0, 2000.0))
    assert by_theory(20) == pytest.approx(11.4, abs=0.1)
    assert value in (15.0, 20.0)
    assert by_theory(1) == 20.0  # what a single bin would need, which the next height above the noise is not


def test_a_table_has_a_figure_for_each_width_and_part(
    ground: TerrainGround, reference: ApproachReference, monkeypatch: pytest.MonkeyPatch
) -> None:
    """None where no whole window lies before the obstacle; the aircraft is above the middle of each part."""
    monkeypatch.setattr(obstacles, "WIDTHS_M", (60.0,))
    monkeypatch.setattr(
        obstacles, "min_obstacle_height", lambda *args: 15.0 if args[-1] != (60.0, 3000.0) else math.inf
    )
    shares = list[float]()
    table = detectable_obstacles(ground, PLAN, reference, lambda _, share: shares.append(share))
    assert table is not None
    assert (table.s_m, table.height_m, table.runs) == ((3000.0, 2000.0, 1000.0), ((math.inf, 15.0, 15.0),), 100)
    assert table.agl_m == pytest.approx([s * math.tan(math.radians(3.0)) for s in (2500.0, 1500.0, 500.0)], abs=1.5)
    assert shares[-1] == 1.0
    bare = ReferenceOptions(surface="level", date="2024-01-01", obstacle_runs=0)
    assert detectable_obstacles(ground, bare, reference, lambda *step: None) is None


@pytest.mark.parametrize(("cell", "runs"), [((60.0, 1000.0), 98), ((60.0, 4000.0), 100)])
def test_nothing_is_promised_of_too_few_flights_or_where_no_window_fits(
    ground: TerrainGround, reference: ApproachReference, cell: tuple[float, float], runs: int
) -> None:
    plan = ReferenceOptions(surface="level", date="2024-01-01", s_max=S_MAX, obstacle_runs=runs)
    assert math.isinf(min_obstacle_height(ground, plan, reference, cell))


def test_a_limit_that_nothing_reaches_promises_nothing(ground: TerrainGround, reference: ApproachReference) -> None:
    high = reference.header.limits.model_copy(update={"t4": 1e3})
    known = ApproachReference(
        reference.header.model_copy(update={"limits": high}), reference.s, reference.z_ref, reference.s_ref,
        reference.s_alt,
    )  # fmt: skip
    assert HEIGHTS_M[-1] < 1e3
    assert math.isinf(min_obstacle_height(ground, PLAN, known, (60.0, 2000.0)))


def test_a_piece_of_the_terrain_is_that_terrain(path: ApproachPath) -> None:
    """Also between the posts, about the way and 300 m beside it."""
    rng = np.random.default_rng(2)
    lat, lon = map(float, path.to_geodetic(1500.0, 0.0))
    rough = Terrain.from_array(rng.normal(0.0, 5.0, (800, 800)), 5.0, lat0=lat, lon0=lon, east0=-1998.7, north0=-2003.1)
    piece = terrain_strip(rough, path, 1900.0, 1200.0)
    s, y = rng.uniform(1200.0, 1900.0, 500), rng.uniform(-300.0, 300.0, 500)
    east, north = rough.frame.to_local(*path.to_geodetic(s, y), 0.0)[..., :2].T
    np.testing.assert_allclose(piece.up(east, north), rough.up(east, north), atol=1e-9)
    assert piece.finest.heights.size < rough.finest.heights.size / 2
