"""Pictures of the beam: dome, antenna, and what comes back over roll (source 003, fig. 2.30 to 2.35, 2.50, 2.53)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure, SubFigure

from fti.ranging.radar.dome import half_dome, sphere
from fti.study import ranging
from fti.study._plots import BLACK, BLUE, VERMILION, label, sheet

#: The antenna looks down: sensor axes to those of the picture.  From where a body is looked at [rad].
DOWN = np.array([1.0, 1.0, -1.0])
ELEVATION, AZIMUTH = np.radians(-28.0), np.radians(-60.0)


def dome() -> Figure:
    """Fig. 2.30 and 2.32: the rays of the half dome, and their ranges to a level surface."""
    figure = sheet(
        "Geodesic dome of order 12: 751 rays before the antenna",
        "Colour: solid angle of a ray, by which it is weighed. Right: the rays meet level ground 100 m below.",
        width=10.0,
        height=5.0,
    )
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.05, 1.0))[0]
    _draw_dome(left)
    _draw_ranges(right)
    return figure


def _draw_dome(figure: SubFigure) -> None:
    """Seen from below and aside; what the dome itself hides is left out."""
    axes: Any = figure.add_subplot(projection="3d")
    whole, half = sphere(ranging.ORDER), half_dome(ranging.ORDER)
    shown = whole.triangles[(whole.rays[whole.triangles, 2] > -1e-9).all(axis=1)]
    corners = (whole.rays * DOWN).T
    axes.plot_trisurf(*corners, triangles=shown, color="#FFFFFF", edgecolor="#9A9A9A", linewidth=0.4, shade=False)
    rays = half.rays_s * DOWN
    towards = rays @ [np.cos(ELEVATION) * np.cos(AZIMUTH), np.cos(ELEVATION) * np.sin(AZIMUTH), np.sin(ELEVATION)]
    x, y, z = rays[towards > 0.0].T
    dots = axes.scatter(x, y, z, c=1e3 * half.solid_angles[towards > 0.0], s=11, depthshade=False)
    axes.quiver(0.0, 0.0, -1.0, 0.0, 0.0, -0.3, color=BLACK, lw=1.2)
    axes.text(0.05, 0.0, -1.28, "boresight", va="center")
    bare(axes, (1.0, 1.0, 0.65), 1.0)
    axes.view_init(elev=np.degrees(ELEVATION), azim=np.degrees(AZIMUTH))
    figure.colorbar(dots, ax=axes, orientation="horizontal", shrink=0.6, pad=0.0, label="solid angle of a ray [msr]")


def bare(axes: Any, aspect: tuple[float, float, float], half: float) -> None:
    """Axes without frame and ticks around a body that reaches ``half`` to every side and hangs down."""
    axes.set(xlim=(-half, half), ylim=(-half, half), zlim=(-1.3 * half, 0.0))
    axes.set_box_aspect(aspect, zoom=1.2)
    axes.set_axis_off()


def _draw_ranges(figure: SubFigure) -> None:
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
    angle, found = ranging.level_ranges()
    curve = np.linspace(0.0, ranging.WIDEST, 300)
    above.plot(np.degrees(curve), ranging.LEVEL_HEIGHT_M / np.cos(curve), color=BLACK, label="h / cos  (eq. 2.67)")
    above.plot(np.degrees(angle), found, "o", ms=3.0, color=VERMILION, alpha=0.6, label="rays cast on the surface")
    above.legend()
    label(above, y="range [m]")
    below.plot(np.degrees(angle), 1e15 * (found * np.cos(angle) / ranging.LEVEL_HEIGHT_M - 1.0), ".", ms=3, color=BLUE)
    label(below, "angle off the boresight [deg]", "relative error [1e-15]")
