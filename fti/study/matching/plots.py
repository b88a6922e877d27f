"""Pictures of matching (source 003, fig. 4.5, 4.10, 4.11)."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fti.arrays import Array
from fti.nav.terrain_matching.fix import match
from fti.nav.terrain_matching.search import search_lattice
from fti.plot_style import BLACK, BLUE, VERMILION, add_legend, label_axes, new_figure
from fti.study.matching.experiment import (
    POSITION_SD_M,
    draw_track,
    lattice_over,
    synthetic_ground,
    window_around,
)

#: A profile with two walls [m], as in fig. 4.10: places and heights of the posts.
WALLS_M, WALL_HEIGHT_M, LENGTH_M, STEP_M = (400.0, 700.0), 20.0, 1000.0, 2.0
REACH_M = 150.0
SIGMAS = 3.0


def stairs() -> Figure:
    """Metric of a profile with steep walls, sampled densely, sparsely, and at the walls only."""
    figure = new_figure(
        "Samples at steep ground make the minimum sharp",
        "Metric: mean absolute residual (eq. 4.11), one dimension, exact elevation, no noise.",
        width=10.0,
        height=5.0,
    )
    profile, metric = figure.subplots(1, 2)
    along = np.arange(0.0, LENGTH_M, STEP_M)
    profile.plot(along, _walls(along), color=BLACK, label="ground")
    shifts = np.arange(-REACH_M, REACH_M, STEP_M)
    for name, places, colour, style in (
        ("every 20 m", np.arange(50.0, 950.0, 20.0), BLUE, "-"),
        ("every 150 m", np.arange(50.0, 950.0, 150.0), BLACK, ":"),
        ("at the walls, and both ends", np.array([50.0, 395.0, 405.0, 695.0, 705.0, 945.0]), VERMILION, "--"),
    ):
        profile.plot(places, _walls(places), "o", color=colour, markersize=3)
        metric.plot(shifts, [_metric(places, shift) for shift in shifts], style, color=colour, label=name)
    label_axes(profile, "along the track [m]", "height [m]")
    label_axes(metric, "shift [m]", "metric [m]")
    add_legend(metric)
    return figure


def _walls(along: Array) -> Array:
    begin, end = WALLS_M
    return np.where((along >= begin) & (along < end), WALL_HEIGHT_M, 0.0)


def _metric(places: Array, shift: float) -> float:
    residual = _walls(places) - _walls(places + shift)
    return float(np.abs(residual - residual.mean()).mean())


def matrix(seed: int) -> Figure:
    """Chi-square of all shifts of a flight, with the true shift, the fix and its covariance."""
    ground, rng = synthetic_ground(0), np.random.default_rng([seed, 6])
    track = draw_track(ground, rng, POSITION_SD_M * rng.standard_normal(2))
    profile, lattice = track.profile(ground, rng), lattice_over(ground)
    window = window_around(ground, profile, lattice)
    east, north = lattice.shifts(window.cell_m)
    chi_square, fix = search_lattice(window, profile, lattice), match(window, profile, lattice)
    figure = new_figure(
        "Chi-square of every shift of one flight",
        f"125 samples, 1.5 m noise, posts of {window.cell_m:g} m. Right: around the fix, with {SIGMAS:g} sigma.",
        width=10.5,
        height=5.0,
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


def _draw_fix(axes: Axes, shift: Array, cov: Array) -> None:
    angle = np.linspace(0.0, math.tau, 100)
    edge = shift[:, None] + SIGMAS * np.linalg.cholesky(cov) @ np.stack((np.cos(angle), np.sin(angle)))
    axes.plot(*shift, "+", color=BLUE, label="fix")
    axes.plot(*edge, color=BLUE, label=f"{SIGMAS:g} sigma")
