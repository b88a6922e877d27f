"""Errors over the crab angle (source 000, table 4), and the measured points of one flight (fig. 16 a)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from fti.nav.interferometric.closest_point import PointMethod
from fti.plot_style import BLACK, BLUE, GREY, VERMILION, add_legend, label_axes, new_figure
from fti.study.ira_closest_point.experiment import MIN_DIFFERENCES_M, fixes, fly, rms
from fti.study.ira_closest_point.flight import CRABS_DEG, HEIGHT_M, PERIOD_S, SAMPLES, SPEED_MPS, flights

FLIGHTS, HALF_PLAN_M = 10, 2500.0
COLOURS = {PointMethod.SIMPLE: GREY, PointMethod.CONVENTIONAL: VERMILION, PointMethod.PROPOSED: BLUE}
COMPARED = (PointMethod.CONVENTIONAL, PointMethod.PROPOSED)


def crab(seed: int) -> Figure:
    """RMS of the position over the crab angle."""
    runs = [fly(seed + number) for number in range(FLIGHTS)]
    figure = new_figure(
        "Position by an interferometric altimeter in side wind",
        f"RMS of the fixes of {FLIGHTS} flights. The simple form is wrong by the pitch, up to the reach of the search.",
        height=4.5,
    )
    every, some = figure.subplots(1, 2, sharey=True)
    for axes, least in zip((every, some), MIN_DIFFERENCES_M, strict=False):
        for method, colour in COLOURS.items():
            if method in COMPARED or axes is every:
                axes.semilogy(CRABS_DEG, rms(runs, method, least), "o-", color=colour, label=method.value)
    label_axes(every, "crab angle [deg]", "RMS of the position [m]", title="All samples")
    words = f"Samples whose points differ by {MIN_DIFFERENCES_M[1]:.0f} m at {CRABS_DEG[-1]:.0f} deg"
    label_axes(some, "crab angle [deg]", title=words)
    add_legend(every)
    return figure


def track(seed: int) -> Figure:
    """Points of a flight at the largest crab angle, their difference, and the errors of its fixes."""
    flight = flights(seed)[-1]
    figure = new_figure(
        f"One flight with a crab of {CRABS_DEG[-1]:.0f} deg",
        f"{HEIGHT_M:.0f} m, {SPEED_MPS:.0f} m/s. Map: elevation.",
        height=7.5,
    )
    plan, apart, errors = figure.subplots(3, 1, height_ratios=(3.0, 1.5, 1.5))
    layer = flight.elevation.finest
    rows, columns = layer.heights.shape
    edges = (layer.east0, layer.east0 + columns * layer.cell_m, layer.north0, layer.north0 + rows * layer.cell_m)
    plan.imshow(layer.heights, origin="lower", extent=edges, aspect="auto", cmap="Greys", alpha=0.6)
    plan.plot(*flight.poses.origins_l[:, :2].T, color=BLACK, label="track")
    points = {method: flight.poses.origins_l + flight.points(method).relative for method in COMPARED}
    for method in COMPARED:
        plan.plot(*points[method][:, :2].T, ".", ms=3.0, color=COLOURS[method], label=method.value)
        found = [float(np.hypot(*fix.matched)) for fix in fixes(flight, method, np.ones(SAMPLES, dtype=bool))]
        errors.plot(np.arange(len(found)) + 1, found, "o-", color=COLOURS[method])
    plan.set_ylim(-HALF_PLAN_M, HALF_PLAN_M)
    difference = points[COMPARED[0]] - points[COMPARED[1]]
    apart.plot(PERIOD_S * np.arange(SAMPLES), np.hypot(difference[:, 0], difference[:, 1]), color=GREY)
    label_axes(plan, "east [m]", "north [m]")
    label_axes(apart, "time [s]", "[m]", title="Horizontal difference of the two forms")
    label_axes(errors, "fix", "[m]", title="Error of the fix, all samples")
    add_legend(plan)
    return figure
