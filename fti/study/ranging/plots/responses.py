"""Plots of the received power: over roll and range, and one response with its leading edge (fig. 2.50, 2.53)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from fti.plot_style import BLACK, BLUE, GREY, ORANGE, SKY, VERMILION, label_axes, new_figure
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import WIDE
from fti.ranging.radar.beam import trace_beam
from fti.ranging.sensor import Poses
from fti.study.ranging.level_run import make_site
from fti.study.ranging.signals import LEVEL
from fti.study.ranging.sweep import D_MAX, HEIGHTS_M, ROLLS_DEG, Sweep, highest, sweep

#: Plotted ranges over each height [m], and the levels [dB below the wings-level echo].
SHOWN_M = {100.0: (80.0, 360.0), 400.0: (340.0, 1200.0), 800.0: (700.0, 2000.0)}
LOWEST_DB = -50.0
ROWS = 280
FINE_DEG = np.linspace(0.0, 90.0, 9001)
RESPONSE_HEIGHT_M = 150.0


def roll_sweep() -> Figure:
    """Fig. 2.50."""
    figure = new_figure(
        "Roll over level ground: received power over range, and its leading edge",
        "Power per range bin under the strongest at 0 deg. Red: h > d_max cos(roll), beyond the reach along the "
        f"boresight, d_max = {D_MAX:.0f} m.",
        width=10.5,
        height=10.0,
    )
    axes = figure.subplots(len(HEIGHTS_M), 2, squeeze=False, sharex=True, sharey="row")
    for row, height in zip(axes, HEIGHTS_M, strict=True):
        for cell, name in zip(row, ("narrow", "wide"), strict=True):
            image = _draw_sweep(cell, sweep(name, height))
            cell.set_title(f"{name} beam, {height:.0f} m")
        row[0].set_ylabel("range [m]")
    for cell in axes[-1]:
        cell.set_xlabel("roll [deg]")
    axes[0, 0].legend(loc="upper left", framealpha=0.95)
    figure.colorbar(image, ax=axes, shrink=0.5, pad=0.02, label="power in a range bin [dB]")
    return figure


def _draw_sweep(axes: Axes, found: Sweep) -> AxesImage:
    low, high = SHOWN_M[found.height]
    level = 10.0 * np.log10(_merge(found, low, high) / np.max(found.spectra[0]))
    image = axes.imshow(
        level.T, origin="lower", aspect="auto", vmin=LOWEST_DB, vmax=0.0, cmap="cividis", interpolation="nearest",
        extent=(ROLLS_DEG[0] - 0.5, ROLLS_DEG[-1] + 0.5, low, high),
    )  # fmt: skip
    axes.plot(ROLLS_DEG, found.edge, color=VERMILION, lw=2.0, label="leading edge")
    slant = found.height / np.cos(np.radians(ROLLS_DEG))
    axes.plot(ROLLS_DEG, slant, ":", color="white", lw=1.5, label="h / cos(roll)")
    axes.axhline(found.height, color="white", lw=1.0, ls="--", label="height h")
    reach_deg = float(np.interp(-found.height, -highest(np.radians(FINE_DEG)), FINE_DEG))
    axes.axvspan(reach_deg, 90.0, fc=VERMILION, alpha=0.22, lw=0.0, label="h > d_max cos(roll)")
    axes.axvline(reach_deg, color=VERMILION, lw=0.8)
    axes.set(xlim=(0.0, 75.0), ylim=(low, high))
    axes.grid(visible=False)
    return image


def _merge(found: Sweep, low: float, high: float) -> np.ndarray:
    """Power per range bin (roll, row) between two ranges [m], neighbouring bins averaged to ``ROWS`` rows."""
    shown = found.spectra[:, (found.ranges >= low) & (found.ranges <= high)]
    together = max(1, shown.shape[1] // ROWS)
    whole = shown[:, : shown.shape[1] // together * together]
    return np.asarray(whole.reshape(len(whole), -1, together).mean(axis=2))


def response(seed: int) -> Figure:
    """Fig. 2.53: one ramp over trees and houses, the mean of many, the level and the edge."""
    world = make_site(seed)
    mean, ramp = (RadarAltimeter(antenna=WIDE, coherent=coherent) for coherent in (False, True))
    rng = np.random.default_rng([seed, 6])
    east, north = rng.uniform(-300.0, 300.0, 2)
    nadir = float(world.truth.up(east, north))
    poses = Poses.stationary([[east, north, nadir + RESPONSE_HEIGHT_M]], LEVEL[None])
    echoes = trace_beam(world.truth, poses, mean.beam, mean.ground, mean.max_range)
    smooth, speckled = mean.spectra(echoes)[0], ramp.spectra(echoes, rng)[0]
    found = mean.edge.find(smooth[None])
    edge_m, peak = float(mean.waveform.range_of_bin(found.position)[0]), float(found.peak[0])
    figure = new_figure(
        "A response and its leading edge",
        f"Wide antenna, wings level, {RESPONSE_HEIGHT_M:.0f} m over country with trees and houses.",
        width=9.0,
        height=4.8,
    )
    axes = figure.subplots()
    ranges, db = mean.baseband.ranges, 10.0 * np.log10(np.stack((smooth, speckled)) / peak)
    axes.plot(ranges, db[1], color=SKY, lw=0.9, label="one ramp (coherent: speckle)")
    axes.plot(ranges, db[0], color=BLUE, lw=2.0, label="mean of many ramps")
    axes.axhline(10.0 * np.log10(mean.edge.threshold), color=ORANGE, ls="--", label="threshold, a quarter of the peak")
    axes.axhline(10.0 * np.log10(mean.noise / peak), color=GREY, ls=":", label="receiver noise in a bin")
    axes.axvline(edge_m, color=VERMILION, label=f"leading edge {edge_m:.1f} m")
    axes.axvline(RESPONSE_HEIGHT_M, color=BLACK, ls="--", lw=1.0, label=f"nadir {RESPONSE_HEIGHT_M:.1f} m")
    axes.set(xlim=(100.0, 450.0), ylim=(-75.0, 6.0))
    axes.legend(loc="upper right")
    label_axes(axes, "range [m]", "power in a range bin [dB of the peak]")
    return figure
