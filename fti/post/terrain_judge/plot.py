"""Maps: residuals of the altimeters on the track, over the relief of each elevation model."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LightSource, Normalize
from matplotlib.figure import Figure

from fti.plot_style import GREY, label_axes, new_figure
from fti.post.terrain_judge.fit import EAST, LAG, NORTH
from fti.post.terrain_judge.judge import AltimeterResult, MapResult
from fti.post.terrain_judge.session import SessionResult

#: Points across a map, and its margin around the track [m].
MAP_POINTS, MARGIN_M = 250, 300.0
#: Share of the residuals within the colours; the others have the outermost colour.
SHOWN_PERCENT = 95.0
COLOURS, LIGHT = "RdBu_r", LightSource(azdeg=315, altdeg=40)


def draw(result: SessionResult) -> Figure:
    """One row for each altimeter, one map for each elevation model."""
    columns = max(len(each.maps) for each in result.altimeters)
    figure = new_figure(
        "Measured ground minus elevation model, as given",
        f"bias and lag removed; shifts relative to {', '.join(result.position_sources)}",
        width=max(4.6 * columns + 1.0, 7.0),
        height=4.9 * len(result.altimeters) + 0.8,
    )
    grid = figure.add_gridspec(len(result.altimeters), columns)
    for row, altimeter in enumerate(result.altimeters):
        residuals = np.concatenate([each.as_given.residuals for each in altimeter.maps])
        limit = max(float(np.nanpercentile(np.abs(residuals), SHOWN_PERCENT)), 0.01)
        shown = Normalize(-limit, limit)
        panels = [figure.add_subplot(grid[row, column]) for column in range(len(altimeter.maps))]
        for axes, each in zip(panels, altimeter.maps, strict=True):
            _draw_map(axes, altimeter, each, shown)
        label = f"{altimeter.sensor}: residual [m]"
        figure.colorbar(ScalarMappable(shown, COLOURS), ax=panels, shrink=0.7, label=label)
    return figure


def _draw_map(axes: Axes, altimeter: AltimeterResult, result: MapResult, shown: Normalize) -> None:
    points = altimeter.samples.measured(0.0)[:, :2]
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    half = 0.5 * float(np.ptp(points, axis=0).max()) + MARGIN_M
    east, north = (np.linspace(place - half, place + half, MAP_POINTS) for place in middle)
    up = result.terrain.up(*np.meshgrid(east, north))
    extent = tuple(side / 1000.0 for side in (east[0], east[-1], north[0], north[-1]))
    step = float(east[1] - east[0])
    relief = max(float(np.nanstd(np.diff(up, axis=1))) / step, 1e-6) if np.isfinite(up).any() else 1.0
    filled = np.where(np.isfinite(up), up, np.nanmean(up) if np.isfinite(up).any() else 0.0)
    shade = LIGHT.hillshade(filled, vert_exag=min(0.35 / relief, 20.0), dx=step, dy=step)
    axes.imshow(
        np.where(np.isfinite(up), shade, math.nan), origin="lower", extent=extent, cmap="Greys_r", alpha=0.6, vmin=0.0
    )
    residuals = result.as_given.residuals
    known = np.isfinite(residuals)
    axes.plot(*(points[~known].T / 1000.0), "x", color=GREY, markersize=3)
    at_east, at_north = points[known].T / 1000.0
    axes.scatter(at_east, at_north, c=residuals[known], norm=shown, cmap=COLOURS, s=7, linewidths=0.0)
    axes.set(aspect="equal", xlim=extent[:2], ylim=extent[2:])
    axes.grid(visible=False)
    label_axes(axes, "east [km]", "north [km]", _title(result))


def _title(result: MapResult) -> str:
    fit, spread = result.best, f"spread {result.as_given.spread_m:.2f} m"
    shift = f"shift {fit.values[EAST]:+.0f} m east, {fit.values[NORTH]:+.0f} m north"
    lag = ", if the lag is 0" if result.refusals else f", lag {1000.0 * fit.values[LAG]:+.0f} ms"
    return f"{Path(result.name).name}: {spread}\n{shift}{lag}"
