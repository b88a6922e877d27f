"""Errors of the filters and the bound over time (Bergman 1999, section 5.4)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from fti.plot_style import BLACK, BLUE, GREY, label_axes, new_figure
from fti.study.bound.experiment import CASES, FIRST_CONVERGED, PERIOD_S, SAMPLES, track

FLIGHTS = 20


def errors(seed: int) -> Figure:
    """RMS over some flights: navigated position, filter and bound."""
    figure = new_figure(
        "Sequential terrain filters at the posterior Cramer-Rao bound",
        f"RMS of the horizontal error over {FLIGHTS} flights. Errors right of the line are judged.",
        width=10.5,
        height=9.0,
    )
    t = PERIOD_S * np.arange(SAMPLES)
    grid = figure.subplots(len(CASES) // 2, 2, sharex=True, sharey=True)
    for axes, (name, case) in zip(grid.flat, CASES.items(), strict=True):
        flights = [track(name, seed + number) for number in range(FLIGHTS)]
        for part, colour, label in (("inertial", GREY, "INS"), ("error", BLUE, "filter"), ("bound", BLACK, "bound")):
            squares = np.mean([getattr(flight, part) for flight in flights], axis=0)
            axes.plot(t, np.sqrt(squares), color=colour, label=label)
        axes.axvline(PERIOD_S * FIRST_CONVERGED, color="0.8", linewidth=0.7)
        axes.set_yscale("log")
        label_axes(
            axes,
            "time [s]" if axes in grid[-1] else "",
            "RMS of the error [m]" if axes in grid[:, 0] else "",
            title=case.about,
        )
    axes.legend(loc="center right", frameon=False)
    return figure
