"""Errors of one flight with each aid (source 003, fig. 7.35 and 7.36)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from fti.plot_style import BLACK, BLUE, VERMILION, add_legend, label_axes, new_figure
from fti.study.long_endurance.experiment import NAMES, OUTAGE_S, UNIT, fly_with

SIGMAS = 3.0
COLOURS = {"baro": BLACK, "1": BLUE, "9": VERMILION}


def errors(seed: int) -> Figure:
    """The horizontal error with each aid; errors north and east of the beams with their 3 sigma."""
    figure = new_figure(
        "500 s without satellites: the inertial error grows, the position from the ground is stable",
        "First flight of the study, tactical unit; grey: without satellites; dashed: 3 sigma.",
        width=10.0,
        height=8.0,
    )
    distance, *each_axis = figure.subplots(3, 1, sharex=True)
    for aid, colour in COLOURS.items():
        run = fly_with(UNIT, aid, seed, 0)
        t, error = np.array(run.t), np.array(run.error)
        distance.semilogy(t, run.distance, color=colour, label=NAMES[aid])
        if aid == "baro":
            continue
        sd = SIGMAS * run.sd
        for axis, ax in enumerate(each_axis):
            ax.plot(t, error[:, axis], color=colour)
            ax.plot(t, sd[:, axis], "--", color=colour, linewidth=0.8)
            ax.plot(t, -sd[:, axis], "--", color=colour, linewidth=0.8)
    names = ("horizontal error [m]", "error north [m]", "error east [m]")
    for ax, name in zip((distance, *each_axis), names, strict=True):
        ax.axvspan(*OUTAGE_S, color="0.9", zorder=0)
        label_axes(ax, "time [s]" if ax is each_axis[-1] else "", name)
    add_legend(distance)
    return figure
