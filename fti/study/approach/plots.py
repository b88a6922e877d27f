"""Pictures of the compensated approach (source 003, fig. 7.5 to 7.8)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LightSource
from matplotlib.figure import Figure

from fti.arrays import Array
from fti.plot_style import BLACK, BLUE, GREY, GROUND, ORANGE, VERMILION, add_legend, label_axes, new_figure
from fti.study.approach import experiment
from fti.study.approach.heights import WAYS
from fti.study.approach.pattern import Pattern, make_pattern
from fti.terrain.synthetic_landscape import RUNWAY_M

FINE_S = 0.5
KM = 1e-3
MARGIN_M, STEP_M = 900.0, 10.0


def track(seed: int) -> Figure:
    """Fig. 7.5: the pattern over the valley, from above."""
    pattern = make_pattern(seed, FINE_S)
    east, north, up = pattern.flight.origins_l.T
    figure = new_figure("Traffic pattern at an airfield in a valley: the ground track", width=8.0, height=8.2)
    axes = figure.subplots()
    (west, east_end), (south, north_end) = (
        (c.min() - MARGIN_M, c.max() + MARGIN_M) for c in (east, np.append(north, RUNWAY_M))
    )
    grid = np.meshgrid(np.arange(west, east_end, STEP_M), np.arange(south, north_end, STEP_M))
    shaded = LightSource(315.0, 40.0).hillshade(pattern.surface.up(*grid), dx=STEP_M, dy=STEP_M, vert_exag=2.0)
    extent = (west * KM, east_end * KM, south * KM, north_end * KM)
    axes.imshow(shaded, extent=extent, origin="lower", cmap="gray", vmin=-0.6, vmax=1.1)
    axes.plot(east * KM, north * KM, color="white", lw=6.0, solid_capstyle="round")
    points = axes.scatter(east * KM, north * KM, c=up, cmap="plasma", s=9.0, zorder=3)
    figure.colorbar(points, ax=axes, shrink=0.8, label="height of the aircraft [m]")
    axes.plot([0.0, 0.0], [0.0, RUNWAY_M * KM], color=VERMILION, lw=4.0, label="runway")
    axes.set_aspect("equal")
    axes.grid(visible=False)
    axes.legend(loc="upper left")
    label_axes(axes, "east [km]", "north [km]")
    return figure


def heights(seed: int) -> Figure:
    """Fig. 7.6 and 7.7: profile, height above ground, and its error, raw and compensated."""
    pattern, rng = make_pattern(seed, FINE_S), np.random.default_rng([seed, 15, 0])
    elevation = experiment.elevation_model(pattern.surface, seed)
    errors = experiment.pattern_errors(pattern, elevation, "wide", rng)
    figure = new_figure(
        "Approach by radar altimeter: raw, and compensated for attitude, terrain and beam",
        "Wide beam, 8101 rays, 0.5 m noise. Compensated by 2051 other rays over the surface; over an elevation model"
        " 1.5 m, 10 m beside.",
        width=10.0,
        height=9.0,
    )
    profile, height, raw, left, attitude = figure.subplots(5, 1, sharex=True, height_ratios=(1.1, 1.1, 1.1, 1.1, 0.7))
    _draw_profile(profile, pattern)
    _draw_heights(height, pattern, errors["independent"].raw)
    _draw_error(raw, pattern.flight.t, errors["independent"].raw, "raw", VERMILION)
    for kind, name, colour in (("dem", "erroneous elevation, in steps", ORANGE), ("independent", "surface", BLUE)):
        _draw_error(left, pattern.flight.t, errors[kind].compensated, name, colour)
    attitude.plot(pattern.flight.t, np.degrees(pattern.flight.roll), color=BLACK, label="roll")
    attitude.plot(pattern.flight.t, np.degrees(pattern.flight.pitch), color=GREY, label="pitch")
    label_axes(attitude, "time [s]", "[deg]")
    add_legend(attitude)
    figure.align_ylabels()
    return figure


def height_channel(seed: int) -> Figure:
    """Fig. 7.8: error and sigma of the height of a filter, by GNSS alone, with the raw and the compensated radar."""
    pattern = make_pattern(seed)
    found, t = experiment.inertial_heights(pattern, seed), pattern.flight.t[1:-1]
    figure = new_figure(
        "Height of an inertial system aided by GNSS, and by a radar altimeter too",
        "The same inertial data and GNSS three times; sigma as the filter states it. Elevation: the surface itself.",
        width=10.0,
        height=8.0,
    )
    panels = figure.subplots(len(WAYS), 1, sharex=True)
    limit = 1.1 * max(float(np.max(np.abs(one.error))) for one in found.values())
    for axes, (way, one), colour in zip(panels, found.items(), (GREY, VERMILION, BLUE), strict=True):
        axes.fill_between(t, -one.sd, one.sd, color=colour, alpha=0.25, lw=0.0, label="one sigma")
        axes.plot(t, one.error, color=colour, lw=1.0, label=f"{way}, RMS {np.sqrt(np.mean(one.error**2)):.2f} m")
        axes.set_ylim(-limit, limit)
        label_axes(axes, y="error [m]")
        add_legend(axes)
    label_axes(panels[-1], x="time [s]")
    return figure


def _draw_profile(axes: Axes, pattern: Pattern) -> None:
    up = pattern.flight.origins_l[:, 2]
    ground = up - pattern.nadir
    floor = float(ground.min()) - 20.0
    axes.fill_between(pattern.flight.t, floor, ground, color=GROUND, lw=0.0, label="surface below")
    axes.plot(pattern.flight.t, up, color=BLACK, label="aircraft")
    axes.set_ylim(floor, None)
    label_axes(axes, y="height [m]")
    add_legend(axes)


def _draw_heights(axes: Axes, pattern: Pattern, raw: Array) -> None:
    axes.plot(pattern.flight.t, pattern.nadir, color=BLACK, lw=2.0, label="nadir (truth)")
    axes.plot(pattern.flight.t, pattern.nadir + raw, color=VERMILION, lw=1.0, label="radar altimeter")
    axes.set_ylim(0.0, None)
    label_axes(axes, y="above ground [m]")
    add_legend(axes)


def _draw_error(axes: Axes, t: Array, error: Array, name: str, colour: str) -> None:
    rms = float(np.sqrt(np.nanmean(error**2)))
    axes.plot(t, error, color=colour, lw=0.9, label=f"{name}, RMS {rms:.2f} m")
    label_axes(axes, y="error [m]")
    add_legend(axes)
