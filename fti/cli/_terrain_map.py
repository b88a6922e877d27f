"""Map of a terrain: shaded relief with height colours, hatched holes, seams, source files, a profile.

Axes: metres (or kilometres) east and north of the frame's origin.  Heights are above the files' datum where all files
have the same one, otherwise above the ellipsoid; the frame's ``up`` is not a height.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LightSource, LinearSegmentedColormap, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from fti.arrays import Array
from fti.errors import ConfigError
from fti.geodesy.geoid import load_geoid
from fti.plot_style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    label_axes,
    new_figure,
)
from fti.terrain.file_info import NO_SOURCE
from fti.terrain.terrain import Terrain

#: Two places: latitude, longitude [rad].
Ends = tuple[tuple[float, float], tuple[float, float]]

#: Points of the map along its longer side, and of a profile.
PIXELS, STEPS = 1100, 1500
#: Low ground to high ground: meadow, field, heath, rock, snow.
RELIEF = LinearSegmentedColormap.from_list(
    "relief", ["#5f8f6b", "#9db57c", "#dcd3a0", "#c2a074", "#9a7a63", "#b9b2ac", "#f6f6f6"]
)
SOURCES = (SKY, ORANGE, GREEN, PURPLE, BLUE, VERMILION, "#F0E442", GREY)
HOLE, HATCH, SEAM = "#f3f3f3", "#8a8a8a", "#7a1f1f"
HALO = withStroke(linewidth=3.0, foreground="white")
#: The light comes from the north-west, as on maps.
LIGHT = LightSource(azdeg=315, altdeg=40)
_DATUMS = {"ellipsoid": "the WGS84 ellipsoid", "egm96": "mean sea level (EGM96)", "egm2008": "mean sea level (EGM2008)"}


class View(NamedTuple):
    """The terrain sampled on the points of the map, row 0 in the south.

    east, north : of columns and rows [m]; height : above ``datum`` [m], NaN in holes; source : number of the file
    """

    east: Array
    north: Array
    height: Array
    source: NDArray[np.uint8]
    datum: str

    @property
    def extent_m(self) -> float:
        """The longer side [m]."""
        return float(max(np.ptp(self.east), np.ptp(self.north)))


def draw_map(terrain: Terrain, profile: Ends | None) -> Figure:
    """The whole figure.  profile : its ends, latitude and longitude [rad]

    Raises ConfigError for a profile outside the terrain, and where no point of the map has a known height.
    """
    view = _sample_view(terrain)
    frame = terrain.frame
    cells = ", ".join(f"{layer.cell_m:g}" for layer in terrain.layers)
    figure = new_figure(
        f"Terrain around {math.degrees(frame.lat0):.5f}, {math.degrees(frame.lon0):.5f} deg",
        f"posts {cells} m apart; heights above {_DATUMS[view.datum]}",
        width=9.0,
        height=8.6 if profile else 7.0,
    )
    rows = figure.add_gridspec(2 if profile else 1, 1, height_ratios=[3.0, 1.0] if profile else None)
    upper = rows[0].subgridspec(1, 2, width_ratios=[3.2, 1.0])
    relief, files = figure.add_subplot(upper[0]), figure.add_subplot(upper[1])
    _draw_relief(figure, relief, view, terrain)
    _draw_sources(files, view, terrain)
    if profile:
        map_scale, _ = _unit(view.extent_m)
        _draw_profile(figure.add_subplot(rows[1]), (relief, map_scale), terrain, profile)
    return figure


# --------------------------------------------------------------------------------------------------------- sampling


def _sample_view(terrain: Terrain) -> View:
    whole = terrain.layers[-1]
    wide, high = whole.east1 - whole.east0, whole.north1 - whole.north0
    step = max(wide, high) / PIXELS
    east = np.linspace(whole.east0, whole.east1, max(2, round(wide / step)))
    north = np.linspace(whole.north0, whole.north1, max(2, round(high / step)))
    height, datum = _heights(terrain, east[None, :], north[:, None])
    if np.isnan(height).all():
        raise ConfigError(f"no height is known at the points of the map, {step:.3g} m apart; give a smaller area")
    return View(east, north, height, terrain.source(east[None, :], north[:, None]), datum)


def _heights(terrain: Terrain, east: Array, north: Array) -> tuple[Array, str]:
    """Heights [m] at points of the frame and their datum: that of all files, or the ellipsoid."""
    up = terrain.up(east, north)
    lat, lon, alt = terrain.frame.to_geodetic(np.stack(np.broadcast_arrays(east, north, up), axis=-1))
    datums = {source.vertical for source in terrain.sources}
    if len(datums) != 1 or "ellipsoid" in datums:
        return alt, "ellipsoid"
    model = datums.pop()
    return np.asarray(alt - load_geoid(model).undulation(lat, lon)), model


# ---------------------------------------------------------------------------------------------------------- drawing


def _unit(extent: float) -> tuple[float, str]:
    return (1000.0, "km") if extent > 5000.0 else (1.0, "m")


def _draw_relief(figure: Figure, axes: Axes, view: View, terrain: Terrain) -> None:
    scale, unit = _unit(view.extent_m)
    extent = tuple(side / scale for side in (view.east[0], view.east[-1], view.north[0], view.north[-1]))
    known = np.isfinite(view.height)
    low, high = (float(f(view.height[known])) for f in (np.min, np.max))
    shown = Normalize(low, max(high, low + 1.0))
    filled = np.where(known, view.height, view.height[known].mean())
    step = float(view.east[1] - view.east[0])
    rises = np.diff(view.height, axis=1)
    rises = np.append(rises[np.isfinite(rises)], 0.0)  # empty where only single points are known
    steepness = max(float(rises.std()) / step, 1e-6)
    shaded = LIGHT.shade(
        filled, RELIEF, norm=shown, blend_mode="soft", dx=step, dy=step, vert_exag=min(0.35 / steepness, 20.0)
    )
    shaded[~known] = 0.0
    axes.imshow(shaded, origin="lower", extent=extent, interpolation="none")
    axes.set_autoscale_on(False)  # a profile may begin and end outside the map
    _hatch_holes(axes, view, scale)
    _draw_seams(axes, terrain, scale)
    axes.plot(0.0, 0.0, "+", color=BLACK, markersize=9)
    label_axes(axes, f"east [{unit}]", f"north [{unit}]")
    axes.grid(visible=False)
    bar = figure.colorbar(mpl.cm.ScalarMappable(shown, RELIEF), ax=axes, shrink=0.75, pad=0.02, label="height [m]")
    bar.outline.set_visible(False)
    _draw_scale(axes, extent, unit)


def _hatch_holes(axes: Axes, view: View, scale: float) -> None:
    holes = np.isnan(view.height)
    if not holes.any():
        return
    areas = axes.contourf(
        view.east / scale, view.north / scale, holes.astype(float), [0.5, 1.5], colors=[HOLE], hatches=["//////"]
    )
    areas.set_edgecolor(HATCH)
    areas.set_linewidth(0.0)
    axes.legend(handles=[Patch(facecolor=HOLE, edgecolor=HATCH, hatch="//////", label="no height")], loc="upper right")


def _draw_seams(axes: Axes, terrain: Terrain, scale: float) -> None:
    for layer in terrain.layers[:-1]:
        corner = layer.east0 / scale, layer.north0 / scale
        size = (layer.east1 - layer.east0) / scale, (layer.north1 - layer.north0) / scale
        axes.add_patch(Rectangle(corner, *size, fill=False, edgecolor=SEAM, linewidth=1.2, linestyle="--"))
        axes.annotate(
            f"{layer.cell_m:g} m",
            (corner[0], corner[1] + size[1]),
            xytext=(3, 3),
            textcoords="offset points",
            color=SEAM,
            fontsize=8,
            path_effects=[HALO],
        )


def _draw_scale(axes: Axes, extent: tuple[float, ...], unit: str) -> None:
    """A bar of a round length, about a fifth of the map."""
    wide = extent[1] - extent[0]
    power = 10.0 ** math.floor(math.log10(wide / 5.0))
    length = next(m * power for m in (5.0, 2.0, 1.0) if m * power <= wide / 5.0)
    x, y = extent[0] + 0.04 * wide, extent[2] + 0.05 * (extent[3] - extent[2])
    axes.plot([x, x + length], [y, y], color="white", linewidth=5.0, solid_capstyle="butt")
    axes.plot([x, x + length], [y, y], color=BLACK, linewidth=2.5, solid_capstyle="butt")
    axes.annotate(
        f"{length:g} {unit}",
        (x + length / 2, y),
        xytext=(0, 4),
        textcoords="offset points",
        ha="center",
        fontsize=8.5,
        path_effects=[HALO],
    )


def _draw_sources(axes: Axes, view: View, terrain: Terrain) -> None:
    """The source file of each point; files beyond the colours share the last one."""
    colours = [*SOURCES[: len(terrain.sources)], HOLE]
    index = np.where(view.source == NO_SOURCE, len(colours) - 1, np.minimum(view.source, len(colours) - 2))
    scale, _ = _unit(view.extent_m)
    extent = tuple(side / scale for side in (view.east[0], view.east[-1], view.north[0], view.north[-1]))
    axes.imshow(
        index, ListedColormap(colours), origin="lower", extent=extent, vmin=-0.5, vmax=len(colours) - 0.5,
        interpolation="none",
    )  # fmt: skip
    _draw_seams(axes, terrain, scale)
    axes.grid(visible=False)
    axes.set_anchor("N")
    axes.spines[:].set_visible(True)
    axes.set_xticks([])
    axes.set_yticks([])
    label_axes(axes, title="source")
    shown = sorted(set(view.source.ravel().tolist()) - {NO_SOURCE})
    handles = [
        Patch(facecolor=SOURCES[min(n, len(SOURCES) - 1)], label=_short(terrain.sources[n].path))
        for n in shown[: len(SOURCES)]
    ]
    axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.0, -0.02), frameon=False, borderaxespad=0.0)


def _short(path: str, max_length: int = 26) -> str:
    name = Path(path).name
    return name if len(name) <= max_length else f"{name[: max_length // 2 - 1]}…{name[-max_length // 2 :]}"


# ---------------------------------------------------------------------------------------------------------- profile


def _draw_line(relief: Axes, east: Array, north: Array) -> None:
    relief.plot(east, north, color=BLACK, linewidth=1.0)
    for name, k, side in (("A ", 0, "right"), (" B", -1, "left")):
        relief.annotate(
            name,
            (east[k], north[k]),
            ha=side,
            va="center",
            fontweight="bold",
            path_effects=[HALO],
            annotation_clip=True,
        )


def _draw_profile(axes: Axes, on_map: tuple[Axes, float], terrain: Terrain, ends: Ends) -> None:
    """The terrain along a straight line of the frame, coloured by file.  on_map : the map, and metres per unit of it"""
    relief, map_scale = on_map
    places = np.array([terrain.frame.to_local(*end, 0.0) for end in ends])
    share = np.linspace(0.0, 1.0, STEPS)[:, None]
    east, north = (places[0, :2] * (1.0 - share) + places[1, :2] * share).T
    height, _ = _heights(terrain, east, north)
    if np.isnan(height).all():
        raise ConfigError("--profile: no height is known between the two points")
    along = np.hypot(east - east[0], north - north[0])
    _draw_line(relief, east / map_scale, north / map_scale)
    scale, unit = _unit(float(along[-1]))
    floor = float(np.nanmin(height)) - 0.08 * max(float(np.nanmax(height) - np.nanmin(height)), 5.0)
    axes.fill_between(along / scale, floor, height, color="#e4dccb", linewidth=0.0)
    source = terrain.source(east, north)
    for number in sorted(set(source.tolist()) - {NO_SOURCE}):
        mine = np.where(source == number, height, np.nan)
        axes.plot(along / scale, mine, color=SOURCES[min(number, len(SOURCES) - 1)], linewidth=1.4)
    axes.set_xlim(0.0, along[-1] / scale)
    axes.set_ylim(floor, None)
    label_axes(axes, f"from A to B [{unit}]", "height [m]", "profile, coloured by source")
