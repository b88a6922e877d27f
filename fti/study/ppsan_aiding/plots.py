"""Errors of one flight, with the ground and without (source 003, fig. 7.26 to 7.28)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from fti.plot_style import BLACK, BLUE, VERMILION, add_legend, label_axes, new_figure
from fti.study.ppsan_aiding.experiment import PARTS, SURVEY_SD_M, fly_schedule

SIGMAS = 3.0


def errors(seed: int, name: str) -> Figure:
    """Errors north and east with their 3 sigma.  name : of the schedule"""
    figure = new_figure(
        f"Satellites {'fail' if name == 'outages' else 'are degraded'} three times: the ground bounds the error",
        "First flight of the study; grey: the three parts of table 7.4 or 7.5; dashed: 3 sigma.",
        width=10.0,
        height=6.0,
    )
    axes = figure.subplots(2, 1, sharex=True)
    for elevation_sd, colour, text in ((None, BLACK, "satellites alone"), (SURVEY_SD_M, BLUE, "with the ground")):
        run = fly_schedule(name, elevation_sd, seed, 0)
        t, error = np.array(run.t), np.array(run.error)
        sd = SIGMAS * run.sd
        for axis, ax in enumerate(axes):
            ax.plot(t, error[:, axis], color=colour, label=text)
            ax.plot(t, sd[:, axis], "--", color=colour, linewidth=0.8)
            ax.plot(t, -sd[:, axis], "--", color=colour, linewidth=0.8)
            if elevation_sd is not None:
                fixes = [(fix.fix.t_valid_ns or 0, fix.error[axis]) for fix in run.fixes if fix.fix.valid]
                ax.plot([t_ns / 1e9 for t_ns, _ in fixes], [e for _, e in fixes], "o", color=VERMILION, label="fixes")
    for ax, axis_name in zip(axes, ("north", "east"), strict=True):
        for part in PARTS:
            ax.axvspan(*part, color="0.9", zorder=0)
        label_axes(ax, "time [s]" if axis_name == "east" else "", f"error {axis_name} [m]")
    add_legend(axes[0])
    return figure
