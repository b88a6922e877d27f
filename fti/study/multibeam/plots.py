"""Pictures of the study ``multibeam`` (source 003, fig. 4.40 to 4.43, 7.30 to 7.32)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from fti.plot_style import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILION, add_legend, label_axes, new_figure
from fti.study.matching.experiment import synthetic_ground
from fti.study.multibeam.aided import (
    DURATION_S,
    FIRST_FIX_S,
    MIN_REACH_M,
    PHASES,
    RADIUS_M,
    RATE_HZ,
    WINDOW_S,
    draw_turn,
    navigate,
)
from fti.study.multibeam.experiment import CHOICES, TRACKED_SD_M, choose, draw_flight
from fti.study.multibeam.flights import BEAM_SETS, counted, fix_of, sigma

COLOURS = dict(zip(BEAM_SETS, (BLACK, ORANGE, GREEN, BLUE, VERMILION), strict=True))
MARGIN_M = 350.0


def sigma_along(seed: int) -> Figure:
    """One sigma of the fix of each set of beams along a turn (fig. 7.30)."""
    ground = synthetic_ground(seed)
    turn = draw_turn(ground, np.random.default_rng([seed, 7]))
    figure = new_figure(
        "Sigma of the fix by number of beams",
        f"Turn with a radius of {RADIUS_M:g} m, 125 samples in 5 s for each beam, exact elevation, noise of 1.5 m.",
    )
    axes = figure.subplots()
    ends = range(WINDOW_S, DURATION_S, WINDOW_S)
    for number in BEAM_SETS:
        sigmas = []
        for end in ends:
            samples = slice((end - WINDOW_S) * RATE_HZ, end * RATE_HZ)
            true = (turn.flight.true.origins_l - turn.flight.navigated.origins_l)[samples, :2]
            sigmas.append(sigma(fix_of(ground, turn.flight.track(number, samples, true), MIN_REACH_M)))
        axes.plot(ends, sigmas, color=COLOURS[number], label=counted(number))
    axes.set_yscale("log")
    label_axes(axes, "time [s]", "sigma of the fix, each axis [m]")
    add_legend(axes)
    return figure


def aided(seed: int, case: str) -> Figure:
    """Error and 3 sigma of the position with each set of beams (fig. 7.31, 7.32)."""
    ground = synthetic_ground(seed)
    turn = draw_turn(ground, np.random.default_rng([seed, 7]))
    figure = new_figure(
        f"Inertial system with fixes, satellites: {case}",
        f"Grey: phases of table {'7.4' if case == 'degraded' else '7.5'}. Lines: error; dashed: 3 sigma of the filter.",
        height=7.0,
    )
    east, north = figure.subplots(2, 1, sharex=True)
    for number, colour in {0: PURPLE, **COLOURS}.items():
        flight = navigate(ground, turn, case, number)
        for axis, axes in enumerate((east, north)):
            axes.plot(flight.error[:, axis], color=colour, label=counted(number) if number else "no fixes")
            axes.plot(3.0 * flight.sd[:, axis], "--", color=colour, linewidth=0.7)
    for axes, name in ((east, "east"), (north, "north")):
        for begin, end, _ in PHASES:
            axes.axvspan(begin, end, color="0.9")
        axes.axvline(FIRST_FIX_S, color="0.7", linewidth=0.7)
        label_axes(axes, "time [s]" if axes is north else "", f"error {name} [m]")
    add_legend(east)
    return figure


def choice(seed: int) -> Figure:
    """Where one beam at a time measures, and the sigma of its fix (fig. 4.40 to 4.43)."""
    ground = synthetic_ground(seed)
    flight = draw_flight(ground, np.random.default_rng([seed, 8]), TRACKED_SD_M)
    figure = new_figure(
        "One beam at a time: which one",
        "125 samples, true points over the ground; the number is the sigma of the fix, each axis.",
        width=11.0,
        height=8.0,
    )
    tracks = {choice: choose(ground, flight, choice, TRACKED_SD_M) for choice in CHOICES}
    points = {choice: track.profile() for choice, track in tracks.items()}
    widest = points["steered"]
    east = np.arange(widest.east.min() - MARGIN_M, widest.east.max() + MARGIN_M, 5.0)
    north = np.arange(widest.north.min() - MARGIN_M, widest.north.max() + MARGIN_M, 5.0)
    up = ground.up(*np.meshgrid(east, north))
    for axes, (name, profile) in zip(figure.subplots(2, 2).flat, points.items(), strict=True):
        axes.pcolormesh(east, north, up, cmap="Greys", rasterized=True)
        axes.plot(profile.east, profile.north, ".", color=VERMILION, markersize=3)
        axes.set_aspect("equal")
        sd = sigma(fix_of(ground, tracks[name], 5.0 * TRACKED_SD_M))
        label_axes(axes, "east [m]", "north [m]", title=f"{name}: {sd:.2f} m")
    return figure
