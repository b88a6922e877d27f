"""Errors of the methods fix by fix, and the likelihood of one fix (source 003, fig. 7.24, 7.25, 4.36)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from fti.nav.terrain_matching.search import Lattice, search_lattice
from fti.nav.terrain_matching.window import cut_window
from fti.plot_style import BLUE, GREEN, ORANGE, VERMILION, add_legend, label_axes, new_figure
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import NARROW
from fti.ranging.radar.dome import random_turn
from fti.study.ppsan.experiment import (
    FIXES_PER_GROUND,
    METHODS,
    REACH_M,
    TRUTH_ORDER,
    draw_track,
    fly,
    make_ground,
    range_map,
    select,
)

FIXES = 12
COLOURS = dict(zip(METHODS, (VERMILION, ORANGE, GREEN, BLUE), strict=True))


def methods(seed: int) -> Figure:
    """Horizontal and vertical errors of the first fixes."""
    figure = new_figure(
        "Only the model of beam and attitude finds the position of a rolling aircraft",
        f"First {FIXES} fixes, independent beam; a method without a fix has no point.",
        width=10.0,
        height=6.0,
    )
    runs = [fly(seed + number) for number in range(FIXES)]
    for axes, axis in zip(figure.subplots(2, 1, sharex=True), ("horizontal", "vertical"), strict=True):
        for name in METHODS:
            errors = [getattr(run.methods[name], axis, np.nan) for run in runs]
            axes.semilogy(range(1, FIXES + 1), errors, "o-", color=COLOURS[name], label=name)
        label_axes(axes, "fix" if axis == "vertical" else "", f"{axis} error [m]")
        add_legend(axes)
    return figure


def chi_square(seed: int) -> Figure:
    """RMS residual of every shift of the first fix: ranges as heights, and the predicted-range map."""
    rng, ground = np.random.default_rng([seed, 151]), make_ground(seed // FIXES_PER_GROUND)
    track = draw_track(ground, rng)
    truth = RadarAltimeter(antenna=NARROW, order=TRUTH_ORDER, turn=random_turn(rng))
    measured = track.measure(ground, truth, rng)
    measured, reach_m = select(measured, np.isfinite(measured.slant_range)), round(REACH_M)
    windows = {
        "ranges as heights": cut_window(ground, measured.profile, REACH_M + ground.finest.cell_m),
        "predicted-range map": range_map(measured, ground, reach_m),
    }
    figure = new_figure(
        "The predicted-range map has one sharp minimum, at the true position",
        "RMS residual [m] of all shifts of one fix of a rolling aircraft.",
        width=10.5,
        height=5.0,
    )
    for axes, (name, window) in zip(figure.subplots(1, 2), windows.items(), strict=True):
        lattice = Lattice(int(reach_m / window.cell_m))
        residual = np.sqrt(search_lattice(window, measured.profile, lattice) / len(measured.t)) * measured.sd[0]
        east, north = lattice.shifts(window.cell_m)
        figure.colorbar(axes.pcolormesh(east, north, residual, rasterized=True), ax=axes)
        axes.plot(*track.error, "x", color=VERMILION, label="true shift")
        axes.set_aspect("equal")
        label_axes(axes, "east [m]", "north [m]", name)
        add_legend(axes)
    return figure
