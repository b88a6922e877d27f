"""Pictures of the rays and of the antennas (source 003, fig. 2.30 to 2.35)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure, SubFigure

from fti.plot_style import BLACK, BLUE, ORANGE, VERMILION, label_axes, new_figure
from fti.ranging.radar.antenna import NARROW, WIDE, Antenna
from fti.ranging.radar.dome import half_dome, sphere
from fti.study.ranging import experiment

#: The antenna points down: sensor axes to plot axes.  View direction [rad].
DOWN = np.array([1.0, 1.0, -1.0])
ELEVATION, AZIMUTH = np.radians(-28.0), np.radians(-60.0)
#: Gain at the centre of the antenna pictures [dBi].
CENTRE_DBI = -20.0


def dome() -> Figure:
    """Fig. 2.30 and 2.32: the rays of the half dome, and their ranges to a level surface."""
    figure = new_figure(
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
    """View from below and from the side; rays that the dome hides are omitted."""
    axes: Any = figure.add_subplot(projection="3d")
    whole, half = sphere(experiment.ORDER), half_dome(experiment.ORDER)
    shown = whole.triangles[(whole.rays[whole.triangles, 2] > -1e-9).all(axis=1)]
    corners = (whole.rays * DOWN).T
    axes.plot_trisurf(*corners, triangles=shown, color="#FFFFFF", edgecolor="#9A9A9A", linewidth=0.4, shade=False)
    rays = half.rays_s * DOWN
    towards = rays @ [np.cos(ELEVATION) * np.cos(AZIMUTH), np.cos(ELEVATION) * np.sin(AZIMUTH), np.sin(ELEVATION)]
    x, y, z = rays[towards > 0.0].T
    dots = axes.scatter(x, y, z, c=1e3 * half.solid_angles[towards > 0.0], s=11, depthshade=False)
    axes.quiver(0.0, 0.0, -1.0, 0.0, 0.0, -0.3, color=BLACK, lw=1.2)
    axes.text(0.05, 0.0, -1.28, "boresight", va="center")
    _hide_axes(axes, 1.0, 1.3, zoom=1.2)
    figure.colorbar(dots, ax=axes, orientation="horizontal", shrink=0.6, pad=0.0, label="solid angle of a ray [msr]")


def _hide_axes(axes: Any, half: float, depth: float, zoom: float) -> None:
    """Hide frame and ticks of a body with half width ``half`` and height ``depth``."""
    axes.set(xlim=(-half, half), ylim=(-half, half), zlim=(-depth, 0.0))
    axes.set_box_aspect((1.0, 1.0, 0.5 * depth / half), zoom=zoom)
    axes.set_axis_off()
    axes.view_init(elev=np.degrees(ELEVATION), azim=np.degrees(AZIMUTH))


def _draw_ranges(figure: SubFigure) -> None:
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
    angle, found = experiment.level_ranges()
    curve = np.linspace(0.0, experiment.MAX_OFF_BORESIGHT, 300)
    above.plot(np.degrees(curve), experiment.LEVEL_HEIGHT_M / np.cos(curve), color=BLACK, label="h / cos  (eq. 2.67)")
    above.plot(np.degrees(angle), found, "o", ms=3.0, color=VERMILION, alpha=0.6, label="rays cast on the surface")
    above.legend()
    label_axes(above, y="range [m]")
    below.plot(
        np.degrees(angle), 1e15 * (found * np.cos(angle) / experiment.LEVEL_HEIGHT_M - 1.0), ".", ms=3, color=BLUE
    )
    label_axes(below, "angle off the boresight [deg]", "relative error [1e-15]")


def antennas() -> Figure:
    """Fig. 2.33 and 2.35: the two cuts of each antenna, and the gain in every direction between them."""
    figure = new_figure(
        "Antennas: gain from two cuts, blended by an ellipse",
        f"Radius: gain over an isotropic antenna, {CENTRE_DBI:.0f} dBi at the centre. Dotted: half power.",
        width=10.0,
        height=6.8,
    )
    rows = figure.subfigures(2, 1, squeeze=False)[:, 0]
    _draw_antenna(rows[0], WIDE, "Wide: half power 35 deg (azimuth) and 26 deg (elevation) off the boresight")
    _draw_antenna(rows[1], NARROW, "Narrow: half power 15 deg off the boresight, all round")
    return figure


def _draw_antenna(figure: SubFigure, antenna: Antenna, title: str) -> None:
    figure.suptitle(title, x=0.012, ha="left", fontsize=10)
    left: Any = figure.add_subplot(1, 2, 1, projection="polar")
    left.set_theta_zero_location("S")
    angle = np.radians(np.arange(-90.0, 91.0))
    left.plot(angle, np.maximum(antenna.azimuth.at(angle), CENTRE_DBI), color=BLUE, label="azimuth cut")
    left.plot(angle, np.maximum(antenna.elevation.at(angle), CENTRE_DBI), "--", color=ORANGE, label="elevation cut")
    left.plot(angle, np.full_like(angle, np.max(antenna.azimuth.gains_dbi) - 10.0 * np.log10(2.0)), ":", color=BLACK)
    left.set(thetamin=-90, thetamax=90, ylim=(CENTRE_DBI, 12.0), yticks=[-10, 0, 10])
    left.set_xticks(np.radians(np.arange(-90, 91, 15)))
    left.text(0.5, 0.79, "gain [dBi]", transform=left.transAxes)
    left.legend(loc="lower left", bbox_to_anchor=(-0.12, 0.0))
    _draw_body(figure, antenna)


def _draw_body(figure: SubFigure, antenna: Antenna) -> None:
    off, azimuth = np.meshgrid(np.radians(np.linspace(0.0, 90.0, 61)), np.radians(np.linspace(0.0, 360.0, 121)))
    rays_s = np.stack((np.sin(off) * np.cos(azimuth), np.sin(off) * np.sin(azimuth), np.cos(off)), axis=-1)
    gain = antenna.gain_dbi(rays_s)
    x, y, z = np.moveaxis(np.maximum(gain - CENTRE_DBI, 0.0)[..., None] * rays_s * DOWN, -1, 0)
    axes: Any = figure.add_subplot(1, 2, 2, projection="3d")
    colours = ScalarMappable(Normalize(CENTRE_DBI, 10.0), "cividis")
    axes.plot_surface(x, y, z, facecolors=colours.to_rgba(gain), rstride=1, cstride=1, lw=0.0, shade=False)
    _hide_axes(axes, 20.0, 31.0, zoom=1.45)
    figure.colorbar(colours, ax=axes, shrink=0.7, label="gain [dBi]")
