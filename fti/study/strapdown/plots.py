"""Pictures of the study of the strapdowns (source 003, fig. 7.4)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from fti.arrays import Array
from fti.plot_style import BLUE, GREEN, GREY, ORANGE, VERMILION, add_legend, label_axes, new_figure
from fti.study.trajectory.experiment import STEPS_S, Closure

COLOURS = {"high order": BLUE, "live": VERMILION}


def steps(errors: dict[str, Array]) -> Figure:
    """Greatest horizontal error after S-turns over the step."""
    figure = new_figure(
        "Free inertial navigation after ten minutes of S-turns",
        "Greatest horizontal error. Grey: falls fourfold for each halving of the step.",
    )
    axes = figure.subplots()
    for form, found in errors.items():
        axes.loglog(STEPS_S, found, "o-", color=COLOURS[form], label=form)
    axes.loglog(
        STEPS_S, errors["live"][0] * np.square(np.array(STEPS_S) / STEPS_S[0]), color=GREY, label="step squared"
    )
    label_axes(axes, x="step [s]", y="error [m]")
    add_legend(axes)
    return figure


def hour(found: Closure) -> Figure:
    """The fast form minus the flight."""
    figure = new_figure(
        "An hour of free inertial navigation by the fast form at 100 Hz, minus the true flight",
        "Legs, turns, climbs and wind; ideal sensors.",
    )
    axes = figure.subplots()
    for column, colour, name in zip(found.pos_n.T, (BLUE, ORANGE, GREEN), ("north", "east", "down"), strict=True):
        axes.plot(found.t / 60.0, 1e3 * column, color=colour, label=name)
    label_axes(axes, x="time [min]", y="position [mm]")
    add_legend(axes)
    return figure
