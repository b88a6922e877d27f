"""Drift between two looks: closed forms, honest covariance, refusals.

The looks are made here, from functions of east and north, not with the ray caster of fti.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from fti.arrays import Array
from fti.nav.scan_matching.look import Look, place_look
from fti.nav.scan_matching.plane_lattice import SLOPE_EAST, SLOPE_NORTH, TIME, UP, fit_planes, frame_around, surfaces_at
from fti.nav.scan_matching.registration import MAX_SD_M, STEP, Refusal, ScanDrift, point_distance, register

Surface = Callable[[Array, Array], Array]
HEIGHT_M, RANGE_SD, PIXELS = 300.0, 0.1, 61


def hills(east: Array, north: Array) -> Array:
    """Two waves of 4 m, 90 and 70 m long, and one across."""
    return np.asarray(
        4.0 * np.sin(east / 14.0 + 0.3)
        + 4.0 * np.sin(north / 11.0)
        + 2.0 * np.sin((east + north) / 17.0 + np.cos(east / 60.0))
    )


def ridges(east: Array, north: Array) -> Array:
    """Hills that are the same everywhere to the north."""
    return np.asarray(4.0 * np.sin(east / 14.0) + 3.0 * np.sin(east / 23.0) + 0.0 * north)


def flat(east: Array, north: Array) -> Array:
    return np.zeros_like(east)


def look_at(
    surface: Surface, east: float, north: float, rng: np.random.Generator, t: float, sd: float = RANGE_SD
) -> Look:
    """An image from above a place, with noise along the rays; points found by fixed-point iteration."""
    tangent = np.linspace(-0.55, 0.55, PIXELS)
    x, y = (grid.ravel() for grid in np.meshgrid(tangent, tangent))
    rays = np.stack((x, y, -np.ones_like(x)), axis=1)
    depth = np.full(len(x), HEIGHT_M)
    for _ in range(60):
        depth = HEIGHT_M - surface(east + x * depth, north + y * depth)
    length = np.linalg.norm(rays, axis=1)
    ranges = depth * length + sd * rng.standard_normal(len(x))
    origin = np.array([east, north, HEIGHT_M])
    return place_look(origin, rays / length[:, None], ranges, np.full(len(x), t), sd)


def drift_of(
    surface: Surface, offset: tuple[float, float, float], seed: int, expected_sd: float = 2.0, sd: float = RANGE_SD
) -> ScanDrift:
    rng = np.random.default_rng(seed)
    east, north = rng.uniform(-500.0, 500.0, 2)
    first = look_at(surface, east, north, rng, 0.0, sd)
    second = look_at(surface, east + 60.0, north + 20.0, rng, 0.5, sd)
    return register(first, second.moved(np.array(offset)), expected_sd)


def in_level_axes(found: ScanDrift) -> tuple[Array, Array]:
    """Drift east, north, up [m] and its covariance, of a drift in three directions."""
    assert len(found.axes_l) == 3
    return found.axes_l.T @ found.drift, found.axes_l.T @ found.cov @ found.axes_l


def test_the_drift_is_found_within_its_sigma() -> None:
    offset = np.array([1.7, -2.2, 0.8])
    drift, cov = in_level_axes(drift_of(hills, tuple(offset), 1))
    assert np.abs(drift - offset).max() < 0.05
    assert np.sqrt(np.diag(cov)).max() < 0.05


def test_the_sigma_is_that_of_the_errors() -> None:
    offset = np.array([0.4, 0.2, -0.3])
    errors = []
    for seed in range(60):
        drift, cov = in_level_axes(drift_of(hills, tuple(offset), seed))
        errors.append((drift - offset) / np.sqrt(np.diag(cov)))
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert ((rms > 0.75) & (rms < 1.3)).all(), rms  # 60 pairs: 1 +- 0.09


def test_time_and_overlap_are_those_of_the_looks() -> None:
    found = drift_of(hills, (0.0, 0.0, 0.0), 2)
    assert found.t == pytest.approx(0.25)
    assert found.interval == pytest.approx(0.5)
    assert found.overlap == pytest.approx((1 - 60 / 330) * (1 - 20 / 330), abs=0.08)


def test_the_roughness_is_that_of_the_points_without_their_noise() -> None:
    """Level ground has none; waves of 1 m that are shorter than the step have their RMS, 0.87 m."""

    def waves(east: Array, north: Array) -> Array:
        short: Array = np.sin(2.1 * east) * np.sin(1.7 * north) + np.sin(1.3 * east + 2.6 * north)
        return hills(east, north) + short

    assert drift_of(flat, (0.0, 0.0, 0.0), 4).roughness < 0.03
    short, long = (drift_of(surface, (0.0, 0.0, 0.0), 4).roughness for surface in (waves, hills))
    assert np.sqrt(short**2 - long**2) == pytest.approx(np.sqrt(0.25 + 0.5), rel=0.2)


def test_level_ground_gives_the_height_only() -> None:
    found = drift_of(flat, (0.5, 0.3, 0.7), 3, sd=0.2)
    assert found.axes_l.tolist() == [[0.0, 0.0, 1.0]]
    assert found.refusals == (Refusal.FLAT,)
    assert found.drift[0] == pytest.approx(0.7, abs=0.03)


def test_ridges_give_the_direction_across() -> None:
    found = drift_of(ridges, (1.1, 0.9, 0.2), 4)
    assert found.refusals == (Refusal.FLAT,)
    assert len(found.axes_l) == 2
    east = found.axes_l[0, 0]
    assert abs(east) == pytest.approx(1.0, abs=0.01)
    assert found.drift[0] * np.sign(east) == pytest.approx(1.1, abs=0.05)
    assert found.drift[1] == pytest.approx(0.2, abs=0.05)


def test_equal_dunes_are_ambiguous() -> None:
    """A period of 40 m, within the expected drift."""

    def dunes(east: Array, north: Array) -> Array:
        return np.asarray(2.0 * np.sin(2.0 * np.pi * east / 40.0) + 2.0 * np.sin(2.0 * np.pi * north / 40.0))

    found = drift_of(dunes, (0.5, 0.5, 0.0), 5, expected_sd=16.0)
    assert found.refusals == (Refusal.AMBIGUOUS,)
    assert len(found.drift) == 0


def test_a_large_drift_is_found_where_it_is_expected() -> None:
    drift, _ = in_level_axes(drift_of(hills, (11.0, -8.0, 1.0), 6, expected_sd=6.0))
    assert np.abs(drift - [11.0, -8.0, 1.0]).max() < 0.1


def test_a_height_that_is_far_off_is_found() -> None:
    """40 m, and at another place: the residuals are then far beyond the weights of the first iteration."""
    for up in (40.0, -3.5):
        drift, _ = in_level_axes(drift_of(hills, (11.0, -8.0, up), 6, expected_sd=6.0))
        assert np.abs(drift - [11.0, -8.0, up]).max() < 0.1


def test_a_drift_that_was_not_expected_is_refused() -> None:
    found = drift_of(hills, (3.0, 0.0, 0.0), 7, expected_sd=0.2)
    assert found.refusals == (Refusal.UNEXPECTED,)


def test_few_points_are_refused() -> None:
    rng = np.random.default_rng(8)
    first = look_at(hills, 0.0, 0.0, rng, 0.0)
    second = look_at(hills, 900.0, 0.0, rng, 5.0)
    assert register(first, second, 1.0).refusals == (Refusal.FEW_POINTS,)
    empty = place_look(np.zeros(3), np.tile([0.0, 0.0, -1.0], (9, 1)), np.full(9, np.nan), np.zeros(9), 0.1)
    assert register(first, empty, 1.0).refusals == (Refusal.FEW_POINTS,)


def test_noise_of_slopes_is_no_information() -> None:
    """Level ground with noise: the horizontal is refused, or its error is inside 4 sigma, in 200 of 200 pairs."""
    worst = 0.0
    for seed in range(200):
        found = drift_of(flat, (0.5, 0.3, 0.0), 100 + seed, sd=0.2)
        assert len(found.drift)
        errors = found.drift - found.axes_l @ np.array([0.5, 0.3, 0.0])
        worst = max(worst, float(np.abs(errors / np.sqrt(np.diag(found.cov))).max()))
    assert worst < 4.5


def test_a_drift_that_changes_within_the_look() -> None:
    """A scanner whose lines come one after another: the points of the second look move with time."""
    rng = np.random.default_rng(9)
    first = look_at(hills, 0.0, 0.0, rng, 0.0)
    image = look_at(hills, 40.0, 0.0, rng, 0.0)
    t = 1.0 + (image.points_l[:, 0] - image.points_l[:, 0].mean()) / 170.0
    rate = np.array([0.4, -0.3, 0.1])
    moved = image.points_l + np.array([0.5, 0.2, -0.1]) + (t - t.mean())[:, None] * rate
    second = Look(moved, image.directions_l, t, RANGE_SD)
    drift, _ = in_level_axes(register(first, second, 1.0, changing=True))
    assert np.abs(drift - [0.5, 0.2, -0.1]).max() < 0.05


def tilted_pair(surface: Surface, seed: int, offset: Array, tilt: float) -> tuple[Look, Look]:
    """Two images of lines that are measured one after the other; the second one rises by the tilt to the east [rad]."""
    rng, looks = np.random.default_rng(seed), []
    for t in (0.0, 1.0):
        image = look_at(surface, 20.0 * t, 0.0, rng, 0.0)
        times = t + (image.points_l[:, 1] - image.points_l[:, 1].mean()) / 170.0
        rise = np.outer(t * tilt * image.points_l[:, 0], [0.0, 0.0, 1.0])
        looks.append(Look(image.points_l + t * offset + rise, image.directions_l, times, RANGE_SD))
    return looks[0], looks[1]


def test_a_tilt_of_the_second_look_does_not_shift_it() -> None:
    """4 mrad raise the edges by 0.7 m, and the hills on them slide."""
    offset, east = np.array([0.5, 0.2, -0.1]), np.array([1.0, 0.0])
    first, second = tilted_pair(hills, 12, offset, 4e-3)
    found = register(first, second, 1.0, changing=True, tilt_axis=east)
    drift, _ = in_level_axes(found)
    assert np.abs(drift - offset - [0.0, 0.0, 4e-3 * found.centre_l[0]]).max() < 0.05
    without, _ = in_level_axes(register(first, second, 1.0, changing=True))
    assert np.abs(without - offset)[:2].max() > 0.08


@pytest.mark.parametrize("seed", range(5))
def test_across_a_valley_a_tilt_hides_the_shift(seed: int) -> None:
    """A parabola that moves to the side is tilted: of waves to the north only the drift to the north is measured."""

    def valley(east: Array, north: Array) -> Array:
        return np.asarray(4.0 * np.sin(north / 11.0) + 5e-5 * east**2)

    offset = np.array([0.3, -0.2, 0.1])
    first, second = tilted_pair(valley, seed, offset, 0.0)
    found = register(first, second, 1.0, changing=True, tilt_axis=np.array([1.0, 0.0]))
    assert len(found.axes_l) == 2 and abs(found.axes_l[0, 1]) > 0.99
    assert np.abs(found.drift - found.axes_l @ offset).max() < 0.05


def test_planes_follow_a_plane_exactly() -> None:
    rng = np.random.default_rng(10)
    points = np.column_stack((rng.uniform(0.0, 100.0, (4000, 2)), np.zeros(4000)))
    points[:, 2] = 3.0 + 0.2 * points[:, 0] - 0.1 * points[:, 1]
    look = Look(points, np.tile([0.0, 0.0, -1.0], (4000, 1)), points[:, 0] / 100.0, 0.1)
    assert point_distance(look.points_l) == pytest.approx(np.sqrt(100.0 * 100.0 / 4000.0), rel=0.05)
    frame = frame_around((look,), STEP * point_distance(look.points_l))
    found = surfaces_at(fit_planes(look, frame), np.array([frame.east0, frame.north0]), frame.step, points)
    known = found[np.isfinite(found[:, UP])]
    assert len(known) > 3000
    assert np.nanmax(np.abs(found[:, UP] - points[:, 2])) < 1e-9
    assert np.abs(known[:, SLOPE_EAST] - 0.2).max() < 1e-9
    assert np.abs(known[:, SLOPE_NORTH] + 0.1).max() < 1e-9
    assert np.nanmax(np.abs(found[:, TIME] - look.t)) < 0.02


def test_points_of_different_times_are_no_surface() -> None:
    rng = np.random.default_rng(11)
    first = look_at(hills, 0.0, 0.0, rng, 0.0)
    again = look_at(hills, 3.0, 2.0, rng, 2.0)
    both = Look(
        np.concatenate((first.points_l, again.points_l)), np.concatenate((first.directions_l, again.directions_l)),
        np.concatenate((first.t, again.t)), RANGE_SD,
    )  # fmt: skip
    frame = frame_around((first, both), STEP * point_distance(first.points_l))
    assert np.isfinite(fit_planes(first, frame)[..., UP]).sum() > 2000
    assert np.isfinite(fit_planes(both, frame)[..., UP]).sum() < 100


@pytest.mark.parametrize(
    ("points", "t", "sd", "message"),
    [
        (np.zeros((3, 2)), np.zeros(3), 0.1, "points_l has the shape"),
        (np.full((3, 3), np.nan), np.zeros(3), 0.1, "points_l has values that are not finite"),
        (np.zeros((3, 3)), np.zeros(3), 0.0, "range_sd is 0.0 m, must be positive"),
    ],
)
def test_a_look_refuses_what_is_no_look(points: Array, t: Array, sd: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Look(points, np.zeros((3, 3)), t, sd)


def test_points_far_away_change_nothing() -> None:
    """One false return in each look, at 40 km and at 3 km."""
    rng = np.random.default_rng(20)
    first = look_at(hills, 0.0, 0.0, rng, 0.0)
    second = look_at(hills, 60.0, 20.0, rng, 0.5).moved(np.array([0.6, -0.4, 0.2]))
    clean, _ = in_level_axes(register(first, second, 1.0))
    for far in (3000.0, 40_000.0):
        looks = [
            Look(
                np.vstack((look.points_l, [far, -far, 0.0])), np.vstack((look.directions_l, [0.0, 0.0, -1.0])),
                np.append(look.t, look.t[0]), RANGE_SD,
            )
            for look in (first, second)
        ]  # fmt: skip
        found, _ = in_level_axes(register(looks[0], looks[1], 1.0))
        assert np.abs(found - clean).max() < 0.05


SHAPES: dict[str, Callable[[np.random.Generator, int], Array]] = {
    "one place": lambda rng, n: np.tile(100.0 * rng.normal(size=3), (n, 1)),
    "line": lambda rng, n: rng.uniform(0.0, 300.0, (n, 1)) * np.array([1.0, 2.0, 0.0]),
    "wall": lambda rng, n: rng.normal(size=(n, 3)) * np.array([1e-9, 1e-9, 1.0]),
    "noise": lambda rng, n: rng.uniform(0.0, 300.0, (n, 3)) * np.array([1.0, 1.0, 100.0]),
    "level": lambda rng, n: rng.uniform(0.0, 300.0, (n, 3)) * np.array([1.0, 1.0, 0.0]),
    "two pieces": lambda rng, n: rng.uniform(0.0, 300.0, (n, 3)) + np.repeat([0.0, 5e4], [n // 2, n - n // 2])[:, None],
    "steep": lambda rng, n: rng.uniform(0.0, 300.0, (n, 2))[:, [0, 1, 1]] * np.array([1.0, 1.0, 1e6]),
    "far": lambda rng, n: np.vstack((np.full((1, 3), 1e9), rng.uniform(0.0, 300.0, (n - 1, 3)))),
    "nothing": lambda rng, n: np.zeros((0, 3)),
}


@pytest.mark.parametrize("first", SHAPES)
@pytest.mark.parametrize("second", SHAPES)
def test_any_points_give_a_finite_drift_or_a_refusal(first: str, second: str) -> None:
    for seed in range(2):
        rng = np.random.default_rng([seed, len(first), len(second)])
        looks = []
        for name, t in ((first, 0.0), (second, 1.0)):
            points = SHAPES[name](rng, int(rng.integers(380, 900)))
            looks.append(Look(points, np.tile([0.0, 0.0, -1.0], (len(points), 1)), np.full(len(points), t), 0.1))
        found = register(looks[0], looks[1], float(rng.choice([1e-6, 0.1, 3.0, 1e3, 1e9])), changing=bool(seed % 2))
        assert found.refusals or len(found.drift) == 3
        assert np.isfinite(found.drift).all()
        assert np.isfinite(found.cov).all()
        assert len(found.drift) == 0 or np.linalg.eigvalsh(found.cov)[0] >= 0.0


def test_the_largest_sigma_is_that_of_the_limit() -> None:
    """Gentle ground: what is reported has a sigma within the limit."""

    def gentle(east: Array, north: Array) -> Array:
        return np.asarray(0.05 * hills(east, north))

    found = drift_of(gentle, (0.1, 0.1, 0.0), 12, sd=0.3)
    assert (np.sqrt(np.diag(found.cov)) <= MAX_SD_M).all()
