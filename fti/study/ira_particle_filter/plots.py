"""Errors of the filters over time (Park, fig. 4, 5 and 7), with their bounds."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from fti.plot_style import BLUE, GREY, ORANGE, VERMILION, label_axes, new_figure
from fti.study.ira_particle_filter.experiment import KINDS, MODELS, PERIOD_S, SAMPLES, STARTS_M, fly

RUNS = 12
COLOURS = {"radar": GREY, "nadir": ORANGE, "typical": VERMILION, "proposed": BLUE}


def errors(seed: int) -> Figure:
    """RMS over some runs, and the bounds: kinds of ground by starts."""
    figure = new_figure(
        "Particle filter with an interferometric altimeter",
        f"RMS of the horizontal error of {RUNS} flights; dashed: posterior Cramer-Rao bound of the drawn noise.",
        width=10.5,
        height=7.5,
    )
    grid = figure.subplots(len(KINDS), len(STARTS_M), sharex=True)
    t = PERIOD_S * np.arange(SAMPLES)
    for row, kind in zip(grid, KINDS, strict=True):
        runs = [fly((kind, seed + number)) for number in range(RUNS)]
        for axes, start in zip(row, STARTS_M, strict=True):
            for name, colour in COLOURS.items():
                of_runs = [run[start, name] for run in runs]
                rms = np.sqrt(np.mean([each.error for each in of_runs], axis=0))
                axes.semilogy(t, rms, color=colour, label=MODELS[name].about)
                bound = np.sqrt(np.mean([each.bound for each in of_runs], axis=0))
                axes.semilogy(t, bound, "--", color=colour, linewidth=0.8)
            label_axes(axes, "time [s]", "[m]", title=f"{kind} ground, start of {start:.0f} m")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(handles), frameon=False)
    return figure
