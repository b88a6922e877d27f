"""Pictures of the compensation study (source 003, fig. 7.62 to 7.67)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fti.arrays import Array
from fti.plot_style import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, add_legend, label_axes, new_figure
from fti.study.compensation import experiment, low_level
from fti.study.compensation.low_level import Knowledge

COLOURS = {"raw": VERMILION, "attitude": ORANGE, "excess": PURPLE, "range": SKY, "beam": BLUE}
#: Plotted methods of each sensor: for a laser, excess equals attitude, and beam equals range.
SHOWN = {"laser": ("raw", "attitude", "range"), "radar": ("raw", "attitude", "range", "beam")}
#: Larger errors are plotted at the edge [m].
EDGE_M = 60.0


def errors(seed: int, sensor: str) -> Figure:
    """Errors of the mix by bank, with the surface as it is, and how they are distributed with and without errors."""
    mix = low_level.fly(seed)
    heights = {known: experiment.compensate(mix, low_level.predict(mix, known, seed)) for known in Knowledge}
    figure = new_figure(
        f"Low over forest and buildings: {sensor} altimeter, raw and compensated",
        "One country, 200 poses, 40 to 350 m above the surface; 70 % rolled less than 10 deg, 30 % up to 50 deg.",
        width=10.0,
        height=7.5,
    )
    by_bank, shares = figure.subplots(2, 1, height_ratios=(1.3, 1.0))
    for way in SHOWN[sensor]:
        error = heights[Knowledge.ALL][sensor, way] - mix.nadir
        rms = float(np.sqrt(np.nanmean(error**2)))
        shown = np.clip(error, -EDGE_M, EDGE_M)
        name = f"{way}, {rms:.1f} m"
        by_bank.plot(np.degrees(np.abs(mix.roll)), shown, ".", ms=5.0, color=COLOURS[way], label=name)
    label_axes(by_bank, "bank [deg]", "error [m]")
    add_legend(by_bank)
    _draw_shares(shares, heights, mix.nadir, sensor)
    return figure


def _draw_shares(axes: Axes, heights: dict[Knowledge, dict[tuple[str, str], Array]], nadir: Array, sensor: str) -> None:
    """Share of the poses whose error is smaller."""
    axes.semilogx(*_share(heights[Knowledge.ALL][sensor, "raw"] - nadir), color=VERMILION, label="raw")
    for known, colour in zip(Knowledge, (BLUE, GREEN, BLACK), strict=True):
        axes.semilogx(
            *_share(heights[known][sensor, "beam"] - nadir), color=colour, label=f"compensated, {known.value}"
        )
    axes.set_xlim(0.05, 200.0)
    label_axes(axes, "size of the error [m]", "share below")
    add_legend(axes)


def _share(error: Array) -> tuple[Array, Array]:
    size = np.sort(np.abs(error[np.isfinite(error)]))
    return size, np.arange(1, len(size) + 1) / len(size)


def banks(seed: int) -> Figure:
    """RMS error over bank, for each beam: raw, by attitude, by excess of the tilt over half the beam."""
    table = experiment.bank_table([experiment.fly(seed)])
    figure = new_figure(
        "Where the attitude helps a radar without terrain",
        "One country, 40 to 350 m above forest and buildings; RMS error. A leading edge is short already.",
        width=10.0,
        height=6.0,
    )
    for k, axes in enumerate(figure.subplots(2, 3, sharex=True, sharey=True).flat):
        for way, name in enumerate(("raw", "attitude", "excess")):
            axes.semilogy(experiment.BANKS_DEG, table[k, :, way], ".-", color=COLOURS[name], label=name)
        label_axes(axes, "bank [deg]" if k > 2 else "", "RMS error [m]" if k % 3 == 0 else "", "")
        axes.set_title(f"beam {experiment.WIDTHS_DEG[k]} deg")
        if k == 0:
            axes.legend()
    return figure
