"""Pictures of matching (source 003, fig. 4.5, 4.10 to 4.19, 4.27, 4.36)."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fti.arrays import Array
from fti.nav.terrain_matching.fix import match
from fti.nav.terrain_matching.likelihood import Likelihood
from fti.nav.terrain_matching.printed_metric import mean_absolute_residual
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.search import Lattice, search_lattice
from fti.nav.terrain_matching.window import TerrainWindow
from fti.plot_style import BLACK, BLUE, GREY, VERMILION, add_legend, label_axes, new_figure
from fti.study.matching.experiment import (
    POSITION_SD_M,
    SELECTED,
    TRACKED_SD_M,
    Track,
    draw_banked,
    draw_track,
    lattice_over,
    select,
    synthetic_ground,
    window_around,
)

#: A profile along one line: its length and the distance of its dense samples [m].
LENGTH_M, STEP_M = 1000.0, 2.0
#: Walls of fig. 4.10 [m], and the obstacles of fig. 4.18 and 4.19.
WALLS_M, WALL_HEIGHT_M = (400.0, 700.0), 20.0
OBSTACLE_M, SECOND_M, OBSTACLE_WIDTH_M = 300.0, 700.0, 60.0
REACH_M = 150.0
SIGMAS = 3.0
#: The drift of fig. 4.27 in the time of the profile, north and east [m].
DRIFT_M = (10.0, 15.0)
SURFACE = Callable[[Array], Array]


def stairs() -> Figure:
    """Metric of a profile with steep walls, sampled densely, sparsely, and at the walls only."""
    figure = _figure(
        "Samples at steep ground make the minimum sharp",
        "Metric: mean absolute residual (eq. 4.11), exact elevation, no noise (fig. 4.10, 4.11). Dots are 1 m off.",
    )
    shifts = np.arange(-REACH_M, REACH_M, STEP_M)
    samples = {
        "every 20 m": np.arange(50.0, 950.0, 20.0),
        "every 150 m": np.arange(50.0, 950.0, 150.0),
        "at the walls, and both ends": np.array([50.0, 395.0, 405.0, 695.0, 705.0, 945.0]),
    }
    _draw_line(figure.subplots(1, 2), _walls, samples, shifts)
    return figure


def _figure(title: str, subtitle: str, height: float = 5.0) -> Figure:
    return new_figure(title, subtitle, width=10.5, height=height)


def _draw_line(axes: tuple[Axes, Axes], surface: SURFACE, samples: dict[str, Array], shifts: Array) -> None:
    """A surface along a line with its samples, and their metric; shifts [m]."""
    profile, metric = axes
    along = np.arange(0.0, LENGTH_M, STEP_M)
    profile.plot(along, surface(along), color=GREY, label="ground")
    looks = zip(((BLUE, "-"), (BLACK, ":"), (VERMILION, "--")), (0.0, -1.0, 1.0), strict=True)
    for (name, places), ((colour, style), offset) in zip(samples.items(), looks, strict=True):
        profile.plot(places, surface(places) + offset, "o", color=colour, markersize=3)
        metric.plot(shifts, [_metric(surface, places, shift) for shift in shifts], style, color=colour, label=name)
    label_axes(profile, "along the track [m]", "height [m]")
    label_axes(metric, "shift [m]", "metric [m]")
    add_legend(metric)


def _walls(along: Array) -> Array:
    begin, end = WALLS_M
    return np.where((along >= begin) & (along < end), WALL_HEIGHT_M, 0.0)


def _metric(surface: SURFACE, places: Array, shift: float) -> float:
    residual = surface(places) - surface(places + shift)
    return float(np.abs(residual - residual.mean()).mean())


def obstacles() -> Figure:
    """A profile of one obstacle, shifted over a second one that is a triangle, and one that is 10 m wider."""
    figure = _figure(
        "Sparse samples confuse obstacles of different shape",
        "Profile over the left obstacle, shifted to the right one. Metric as in fig. 4.18, 4.19. Dots are 1 m off.",
        height=7.5,
    )
    begin, end = OBSTACLE_M, OBSTACLE_M + OBSTACLE_WIDTH_M
    samples = {
        "every 5 m": np.arange(begin - 100.0, end + 100.0, 5.0),
        "every 60 m": np.arange(begin - 90.0, end + 100.0, OBSTACLE_WIDTH_M),
        "at the edges": np.array([begin - 3.0, begin + 3.0, end - 3.0, end + 3.0]),
    }
    for axes, second in zip(figure.subplots(2, 2), (_triangle, _wider), strict=True):
        _draw_line(axes, _obstacle_and(second), samples, np.arange(-200.0, 600.0, STEP_M))
    return figure


def _obstacle_and(second: SURFACE) -> SURFACE:
    return lambda along: np.where(_is_between(along, OBSTACLE_M, OBSTACLE_WIDTH_M), WALL_HEIGHT_M, second(along))


def _is_between(along: Array, begin: float, width: float) -> Array:
    return np.asarray((along >= begin) & (along < begin + width), dtype=np.float64)


def _triangle(along: Array) -> Array:
    half = 0.5 * OBSTACLE_WIDTH_M
    return np.asarray(WALL_HEIGHT_M * np.clip(1.0 - np.abs(along - SECOND_M - half) / half, 0.0, None))


def _wider(along: Array) -> Array:
    return np.asarray(WALL_HEIGHT_M * _is_between(along, SECOND_M, OBSTACLE_WIDTH_M + 10.0))


def gradients() -> Figure:
    """Profiles over gentle and steep ground: their metric, without and with an error of the altimeter."""
    figure = _figure(
        "Steep ground distinguishes shifts",
        "Waves of the same length, heights of 2 m and 20 m. Grey band: mean absolute noise of 1.5 m (fig. 4.14).",
    )
    profile, metric = figure.subplots(1, 2)
    along, shifts = np.arange(0.0, LENGTH_M, STEP_M), np.arange(-REACH_M, REACH_M, STEP_M)
    for height, colour in ((2.0, BLUE), (20.0, VERMILION)):
        surface = _waves(height)
        profile.plot(along, surface(along), color=colour)
        values = [_metric(surface, np.arange(200.0, 800.0, 10.0), shift) for shift in shifts]
        metric.plot(shifts, values, color=colour, label=f"{height:g} m high")
    metric.axhspan(0.0, 1.5 * math.sqrt(2.0 / math.pi), color=GREY, alpha=0.3)
    label_axes(profile, "along the track [m]", "height [m]")
    label_axes(metric, "shift [m]", "metric [m]")
    add_legend(metric)
    return figure


def _waves(height: float) -> SURFACE:
    return lambda along: np.asarray(
        0.3 * height * (np.sin(math.tau * along / 310.0) + 0.6 * np.sin(math.tau * along / 130.0 + 1.0))
    )


# ------------------------------------------------------------------------------------------------- simulated flights


def matrix(seed: int) -> Figure:
    """Chi-square of all shifts of a flight, with the true shift, the fix and its covariance."""
    track, profile, window, lattice = _flight(seed)
    east, north = lattice.shifts(window.cell_m)
    chi_square, fix = search_lattice(window, profile, lattice), match(window, profile, lattice)
    figure = _figure(
        "Chi-square of every shift of one flight",
        f"125 samples, 1.5 m noise, posts of {window.cell_m:g} m. Right: around the fix, with {SIGMAS:g} sigma.",
    )
    whole, near = figure.subplots(1, 2)
    image = whole.pcolormesh(east, north, np.sqrt(chi_square / len(profile)), rasterized=True)
    figure.colorbar(image, ax=whole, label="RMS residual over sigma")
    whole.plot(*track.error, "x", color=VERMILION, label="true shift")
    _draw_fix(near, fix.shift, fix.cov)
    near.plot(*track.error, "x", color=VERMILION, label="true shift")
    for axes in (whole, near):
        axes.set_aspect("equal")
        label_axes(axes, "east [m]", "north [m]")
        add_legend(axes)
    return figure


def _flight(seed: int, drift: Array | None = None) -> tuple[Track, Profile, TerrainWindow, Lattice]:
    """A flight over synthetic relief."""
    ground, rng = synthetic_ground(0), np.random.default_rng([seed, 6])
    track = draw_track(ground, rng, POSITION_SD_M * rng.standard_normal(2), drift)
    profile, lattice = track.profile(ground, rng), lattice_over(ground)
    return track, profile, window_around(ground, profile, lattice), lattice


def _draw_fix(axes: Axes, shift: Array, cov: Array) -> None:
    angle = np.linspace(0.0, math.tau, 100)
    edge = shift[:, None] + SIGMAS * np.linalg.cholesky(cov) @ np.stack((np.cos(angle), np.sin(angle)))
    axes.plot(*shift, "+", color=BLUE, label="fix")
    axes.plot(*edge, color=BLUE, label=f"{SIGMAS:g} sigma")


def selection(seed: int) -> Figure:
    """A tenth of the samples: where they are, the shape of their metric, and the error that it leaves."""
    track, profile, window, _ = _flight(seed)
    kinds = {"informative": VERMILION, "evenly spaced": BLUE}
    chosen = {kind: profile.select(select(kind, window, profile, TRACKED_SD_M)) for kind in kinds}
    figure = _figure(
        f"{SELECTED} of {len(profile)} samples: the most informative, and evenly spaced ones",
        "Metric: mean absolute residual less its minimum; noise of 1.5 m. Dashed: the true shift (fig. 4.12 to 4.17).",
        height=7.0,
    )
    upper, lower = figure.subplots(2, 2)
    along = np.hypot(profile.east - profile.east[0], profile.north - profile.north[0])
    for axes, (kind, colour) in zip(upper, kinds.items(), strict=True):
        axes.plot(along, profile.ground, ".", color=GREY, markersize=3, label="all")
        here = np.isin(profile.t, chosen[kind].t)
        axes.plot(along[here], profile.ground[here], "o", color=colour, markersize=5, label=kind)
        label_axes(axes, "along the track [m]", "measured ground [m]")
        add_legend(axes)
    profiles = {"all": (profile, BLACK), **{kind: (chosen[kind], colour) for kind, colour in kinds.items()}}
    for axis, axes in enumerate(lower):
        _draw_sections(axes, track, profiles, axis)
    return figure


def _draw_sections(axes: Axes, track: Track, profiles: dict[str, tuple[Profile, str]], axis: int) -> None:
    """The printed metric through the true shift, along east (0) or north (1)."""
    along = np.arange(-REACH_M, REACH_M + 1.0, STEP_M)
    shifts = np.tile(track.error, (len(along), 1))
    shifts[:, axis] += along
    for name, (profile, colour) in profiles.items():
        metric = mean_absolute_residual(synthetic_ground(0), profile, shifts)
        axes.plot(shifts[:, axis], metric - metric.min(), color=colour, label=name)
    axes.axvline(track.error[axis], color=GREY, linestyle="--")
    label_axes(axes, f"{('east', 'north')[axis]} shift [m]", "metric [m]")
    add_legend(axes)


def drift(seed: int) -> Figure:
    """Chi-square around the true shift of a position that drifts, with a constant offset and with offset and drift."""
    seconds = 24.8
    velocity = np.array(DRIFT_M[::-1]) / seconds
    track, profile, window, _ = _flight(seed, velocity)
    figure = _figure(
        "Offset and drift together fit a position that drifts",
        f"{DRIFT_M[0]:g} m to the north and {DRIFT_M[1]:g} m to the east in {seconds:g} s (fig. 4.27). Dashed: the "
        "true shift in the middle.",
    )
    models = {
        "constant offset": (Likelihood(window, profile), BLUE),
        "offset and drift": (Likelihood(window, profile, 1.0, velocity), VERMILION),
    }
    along = np.arange(-30.0, 30.5, 0.5)
    for axis, axes in enumerate(figure.subplots(1, 2)):
        shifts = np.tile(track.error, (len(along), 1))
        shifts[:, axis] += along
        for name, (likelihood, colour) in models.items():
            values = np.sqrt(likelihood.chi_square(shifts) / len(profile))
            axes.plot(shifts[:, axis], values, color=colour, label=name)
        axes.axvline(track.error[axis], color=GREY, linestyle="--")
        label_axes(axes, f"{('east', 'north')[axis]} shift [m]", "RMS residual over sigma")
        add_legend(axes)
    return figure


def banked(seed: int) -> Figure:
    """Chi-square of the ranges of a laser that rolls: as heights, and compensated for every shift."""
    flight = draw_banked(synthetic_ground(0), np.random.default_rng([seed, 7]))
    figure = _figure(
        "Compensation for every shift",
        "A laser rolls by 10 deg, 125 samples, 1.5 m noise. x: the true shift; +: the fix (fig. 4.36).",
        height=5.4,
    )
    forms = {"slant ranges as heights": flight.plain, "compensated for every shift": flight.compensated}
    results = {
        name: np.sqrt(search_lattice(window, flight.profile, flight.lattice) / len(flight.profile))
        for name, window in forms.items()
    }
    highest = max(float(result.max()) for result in results.values())
    east, north = flight.lattice.shifts(flight.plain.cell_m)
    panels = figure.subplots(1, 2)
    for axes, (name, result) in zip(panels, results.items(), strict=True):
        image = axes.pcolormesh(east, north, result, vmin=0.0, vmax=highest, rasterized=True)
        axes.plot(*flight.error, "x", color=VERMILION)
        axes.plot(*match(forms[name], flight.profile, flight.lattice).shift, "+", color="white")
        axes.set_aspect("equal")
        label_axes(axes, "east [m]", "north [m]", f"{name}: {result.min():.1f} at the minimum")
    figure.colorbar(image, ax=panels, label="RMS residual over sigma")
    return figure
