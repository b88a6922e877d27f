"""Picture of the comparison: the track with the fixes, and the errors of each method over time."""

from __future__ import annotations

import itertools
import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.plot_style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, label_axes, new_figure
from fti.post.terrain_comparison.observer import ALONE, BOUND, ComparedFlight, MethodFix
from fti.post.terrain_comparison.statistics import FlightResult, bound_with_map, stated_cov

BROWN, NAVY, OLIVE, DARK_RED = "#6f4518", "#1b1f6b", "#7a7a00", "#7a0c1f"
#: One for each method; the bound is SKY.
COLOURS = (BLUE, ORANGE, PURPLE, VERMILION, GREEN, BROWN, NAVY, OLIVE, DARK_RED)
#: Points across the map, and its margin around the track [m].
MAP_POINTS, MAP_MARGIN_M = 300, 800.0
#: The ellipses of the map contain 95 %; drawn so large that those of the method in flight have this share.
SIGMAS_95, ELLIPSE_SHARE = 2.448, 0.04
#: Enlargements of the ellipses.
SCALES = (1, 2, 5, 10, 20, 50, 100, 200, 500)
#: Smaller errors are drawn here [m].
MIN_DRAWN_M = 0.1


def draw(flight: ComparedFlight, result: FlightResult) -> Figure:
    """The picture of a flight."""
    colours = dict(zip(flight.fixes, itertools.cycle(COLOURS), strict=False))
    alone, filtered, bound = (f"{value:.1f} m" for value in result.totals)
    figure = new_figure(
        "Methods of position from the ground",
        f"Reference: {result.reference}. RMS without satellites: inertial alone {alone}, filter ({result.in_flight}) "
        f"{filtered}, bound {bound}.",
        width=14.0,
        height=2.2 + 1.35 * len(colours),
    )
    grid = figure.add_gridspec(len(colours) + 1, 2, width_ratios=(1.0, 1.1), height_ratios=[1.0] * len(colours) + [1.8])
    _map(figure.add_subplot(grid[:, 0]), flight, colours)
    first: Axes | None = None
    for k, (name, colour) in enumerate(colours.items()):
        axes = figure.add_subplot(grid[k, 1], sharex=first, sharey=first)
        _errors(axes, flight, name, colour)
        axes.tick_params(labelbottom=False)
        if first is None:
            axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        first = first or axes
    _filters(figure.add_subplot(grid[-1, 1], sharex=first), flight, colours)
    return figure


def _map(axes: Axes, flight: ComparedFlight, colours: dict[str, str]) -> None:
    ground = flight.ground
    if ground is None or not flight.track:
        return
    frame = ground.terrain.frame
    track = np.array([frame.to_local(position.lat, position.lon, frame.alt0)[:2] for _, position in flight.track])
    middle, half = 0.5 * (track.min(axis=0) + track.max(axis=0)), 0.5 * np.ptp(track, axis=0).max() + MAP_MARGIN_M
    low, high = middle - half, middle + half
    east, north = (np.linspace(low[i], high[i], MAP_POINTS) for i in range(2))
    extent = tuple(value / 1000.0 for value in (low[0], high[0], low[1], high[1]))
    up = ground.terrain.up(*np.meshgrid(east, north)) + frame.alt0
    image = axes.imshow(up, origin="lower", extent=extent, alpha=0.6, cmap="Greys_r")
    axes.figure.colorbar(image, ax=axes, label="ground above the ellipsoid [m]", location="bottom", shrink=0.7)
    axes.plot(*(track.T / 1000.0), color=BLACK, linewidth=1.2)
    scale = _scale(flight, 2.0 * half)
    for name, colour in reversed(colours.items()):  # the method of flight on top
        for each in flight.fixes[name]:
            _ellipse(axes, flight, each, colour, scale)
    handles = [Line2D([], [], color=BLACK, label="reference track")]
    handles += [Line2D([], [], color=colour, marker="o", linestyle="", label=name) for name, colour in colours.items()]
    axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.0, -0.12), ncols=3)
    axes.set(aspect="equal", xlim=extent[:2], ylim=extent[2:])
    axes.grid(visible=False)
    label_axes(
        axes, "east [km]", "north [km]", f"valid fixes: errors and 95 % ellipses of fix and map, enlarged {scale} times"
    )


def _scale(flight: ComparedFlight, size_m: float) -> int:
    """Enlargement of the ellipses."""
    valid = [each for each in flight.fixes[flight.in_flight] if each.fix.valid]
    if not valid:
        return 1
    median = float(np.median([math.sqrt(np.trace(stated_cov(each, flight.map_sd))) for each in valid]))
    return max(scale for scale in SCALES if scale == 1 or scale * 2.0 * SIGMAS_95 * median <= ELLIPSE_SHARE * size_m)


def _ellipse(axes: Axes, flight: ComparedFlight, each: MethodFix, colour: str, scale: int) -> None:
    """A valid fix beside the place where the aircraft was, with its error enlarged as its ellipse."""
    ground, fix = flight.ground, each.fix
    if ground is None or not fix.valid or each.error is None or fix.lat is None or fix.lon is None:
        return
    frame = ground.terrain.frame
    at = frame.to_local(fix.lat, fix.lon, frame.alt0)[:2] + (scale - 1) * each.error[::-1]
    variances, axes_ne = np.linalg.eigh(stated_cov(each, flight.map_sd))
    width, height = 2.0 * SIGMAS_95 * scale * np.sqrt(variances) / 1000.0
    angle = math.degrees(math.atan2(axes_ne[0, 0], axes_ne[1, 0]))
    middle = (float(at[0]) / 1000.0, float(at[1]) / 1000.0)
    axes.add_patch(Ellipse(middle, width, height, angle=angle, fill=False, edgecolor=colour, linewidth=0.9))
    axes.plot(*middle, ".", color=colour, markersize=3)


def _seconds(flight: ComparedFlight, t_ns: list[int]) -> Array:
    begin_ns = flight.track[0][0] if flight.track else 0
    return (np.array(t_ns, dtype=np.int64) - begin_ns) / SECOND_NS


def _errors(axes: Axes, flight: ComparedFlight, name: str, colour: str) -> None:
    """Errors of one method, with the stated sigma of its valid fixes and the bound."""
    fixes = flight.fixes[name]
    t = _seconds(flight, [each.fix.t_valid_ns or 0 for each in fixes])
    error = np.array([math.nan if each.error is None else max(np.hypot(*each.error), MIN_DRAWN_M) for each in fixes])
    valid = np.array([each.fix.valid for each in fixes], dtype=bool)
    sd = np.array([math.sqrt(np.trace(stated_cov(each, flight.map_sd))) for each in fixes])
    axes.plot(t[valid], error[valid], "o", color=colour, markersize=4, label="valid")
    axes.plot(t[~valid], error[~valid], "x", color=GREY, markersize=5, label="refused")
    axes.plot(t[valid], sd[valid], "_", color=BLACK, markersize=10, label="stated sigma")
    axes.plot(
        t, [bound_with_map(bound, flight.map_sd) for bound in flight.bounds], color=SKY, linewidth=0.9, label="bound"
    )
    axes.set_yscale("log")
    label_axes(axes, "", "[m]", f"{name}: error of the fix")


def _filters(axes: Axes, flight: ComparedFlight, colours: dict[str, str]) -> None:
    """Errors of the filters without satellites."""
    t = _seconds(flight, flight.outage_ns)
    lines = {ALONE: (BLACK, "inertial alone"), **{name: (colour, name) for name, colour in colours.items()}}
    for name, (colour, label) in lines.items():
        error = [max(float(np.hypot(*sample.error)), MIN_DRAWN_M) for sample in flight.filters[name]]
        axes.plot(t, error, color=colour, linewidth=1.0, label=label)
    axes.plot(t, [sample.sd for sample in flight.filters[BOUND]], "--", color=BLACK, linewidth=0.9, label="bound")
    axes.set_yscale("log")
    label_axes(axes, "time [s]", "[m]", "error of the filter without satellites, with the fixes of each method")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
