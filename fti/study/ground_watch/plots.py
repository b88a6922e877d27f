"""A receiver that drifts, with the ground and without."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from fti.plot_style import BLACK, BLUE, VERMILION, add_legend, label_axes, new_figure
from fti.study.ground_flights import fly
from fti.study.ground_watch.experiment import RAMP_S, ramp_case

SPEED_MPS = 0.3


def ramp(seed: int) -> Figure:
    """Error and protection level of a flight whose receiver drifts with 0.3 m/s."""
    figure = new_figure(
        "The ground shows a receiver that drifts slowly",
        f"First flight of the study: {SPEED_MPS:g} m/s from {RAMP_S:g} s on, onset 0.02 m/s^2; dots: warnings.",
        width=10.0,
        height=5.0,
    )
    axes = figure.subplots()
    case = ramp_case("fine", SPEED_MPS)
    for name, flown_case, colour in (
        ("satellites alone", replace(case, window_s=None), BLACK),
        ("with the ground", case, BLUE),
    ):
        run = fly(flown_case, seed, 0)
        axes.plot(run.t, run.distance, color=colour, label=f"error, {name}")
        axes.plot(run.t, run.hpl, "--", color=colour, linewidth=0.9, label=f"protection level, {name}")
        warnings = [t for t, event in run.events if event.level == "warning"]
        axes.plot(warnings, np.interp(warnings, run.t, run.distance), "o", color=VERMILION)
    label_axes(axes, "time [s]", "horizontal [m]")
    add_legend(axes)
    return figure
