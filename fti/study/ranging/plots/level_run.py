"""Picture of the level run over forest and buildings (source 003, fig. 2.45, 2.46)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from fti.plot_style import BLACK, BLUE, GREY, GROUND, VERMILION, add_legend, label_axes, new_figure
from fti.study.ranging.level_run import REACH_M, LevelRun, LevelRunSite, Path, fly, level, make_site
from fti.terrain.landscape import Cover

COVERS = {
    Cover.GRASS: ("grass", "#E9EDD8"),
    Cover.CROP: ("crops", "#E8D9A8"),
    Cover.FOREST: ("forest", "#7FA77A"),
    Cover.BUILDING: ("buildings", "#A0522D"),
}


def level_run(seed: int) -> Figure:
    """Map with the track; profile of the surface; heights; errors of model and nadir against the measured ranges."""
    world, rng = make_site(seed), np.random.default_rng([seed, 0])
    path = level(world, rng, step=5.0)
    run = fly(world, path, "wide", rng)
    figure = new_figure(
        "Level run over forest and buildings: the beam model against the nadir height",
        "Measured: true surface, independent rays, 0.5 m noise. Model, nadir: elevation model, 5 m posts, 1.5 m noise.",
        width=11.0,
        height=7.2,
    )
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.0, 1.6))[0]
    _draw_map(left.subplots(), world, path)
    profile, height, error = right.subplots(3, 1, sharex=True, height_ratios=(1.2, 1.2, 1.0))
    _draw_profile(profile, world, path, run)
    _draw_heights(height, run)
    _draw_errors(error, run)
    right.align_ylabels()
    return figure


def _draw_map(axes: Axes, world: LevelRunSite, path: Path) -> None:
    kinds = list(COVERS)
    colours = ListedColormap([colour for _, colour in COVERS.values()])
    bounds = BoundaryNorm([kind - 0.5 for kind in kinds] + [kinds[-1] + 0.5], len(kinds))
    layer = world.truth.finest
    rows, columns = layer.heights.shape
    extent = (layer.east0, layer.east0 + layer.cell_m * columns, layer.north0, layer.north0 + layer.cell_m * rows)
    axes.imshow(
        world.landscape.cover, origin="lower", extent=extent, cmap=colours, norm=bounds, interpolation="nearest"
    )
    east, north, _ = path[1].T
    axes.plot(east, north, color="white", lw=4.0)
    axes.plot(east, north, color=BLACK, lw=1.8)
    axes.plot(east[0], north[0], "o", color=BLACK, mfc="white", ms=6)
    shown, ticks = (-1.1 * REACH_M, 1.1 * REACH_M), [-800, -400, 0, 400, 800]
    axes.set(xlim=shown, ylim=shown, aspect="equal", xticks=ticks, yticks=ticks)
    axes.grid(visible=False)
    patches = [Patch(color=colour, label=name) for name, colour in COVERS.values()]
    axes.legend(handles=patches, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=4, handlelength=1.2)
    label_axes(axes, "east [m]", "north [m]", "track, from the circle on")


def _draw_profile(axes: Axes, world: LevelRunSite, path: Path, run: LevelRun) -> None:
    east, north, _ = path[1].T
    along = np.linspace(0.0, run.along[-1], 1200)
    at = np.interp(along, run.along, east), np.interp(along, run.along, north)
    top, bare = world.truth.up(*at), world.landscape.ground.up(*at)
    floor = float(np.min(bare)) - 10.0
    axes.fill_between(along, floor, bare, color=GROUND, lw=0.0, label="bare ground")
    axes.fill_between(along, bare, top, color=COVERS[Cover.FOREST][1], lw=0.0, label="trees, houses, crops")
    axes.plot(run.along, run.up, color=BLACK, label="aircraft")
    axes.set_ylim(floor, None)
    label_axes(axes, y="height [m]")
    add_legend(axes)


def _draw_heights(axes: Axes, run: LevelRun) -> None:
    axes.plot(run.along, run.nadir, color=GREY, lw=1.0, label="nadir")
    axes.plot(run.along, run.measured, color=BLACK, lw=2.2, label="measured")
    axes.plot(run.along, run.model, color=BLUE, lw=1.2, label="model")
    label_axes(axes, y="height above\nground [m]")
    add_legend(axes)


def _draw_errors(axes: Axes, run: LevelRun) -> None:
    model, nadir = np.sqrt(run.mean_squares())
    axes.plot(run.along, run.nadir - run.measured, color=VERMILION, lw=1.0, label=f"nadir, RMS {nadir:.1f} m")
    axes.plot(run.along, run.model - run.measured, color=BLUE, lw=1.3, label=f"model, RMS {model:.1f} m")
    axes.axhline(0.0, color=BLACK, lw=0.8)
    label_axes(axes, "distance [m]", "minus\nmeasured [m]")
    add_legend(axes)
    axes.set_xlim(run.along[0], run.along[-1])
