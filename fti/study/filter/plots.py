"""Pictures of the study of the filter (source 003, fig. 7.26 to 7.28, for the height)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fti.plot_style import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, add_legend, label_axes, new_figure
from fti.study.filter.experiment import INSTANTS_S, FilterRun
from fti.study.filter.flights import CASES, OUTAGES_S
from fti.study.filter.terrain import SPELLS_S, HeightErrors, HeightPair

COLOURS = (GREEN, SKY, BLUE, PURPLE, VERMILION)


def heights(found: dict[str, HeightPair]) -> Figure:
    """Error of the height with and without altimeter, and three sigma, for bad satellites and for none."""
    figure = new_figure(
        "Height with and without a laser altimeter over an elevation model, GNSS degraded or lost",
        "One run. Shaded: GNSS of 4 m / 6 m, 5 m / 7 m, 6 m / 8 m (above), outage (below). Thin: 3 sigma.",
        height=7.0,
    )
    for axes, (name, pair) in zip(figure.subplots(2, 1, sharex=True), found.items(), strict=True):
        _shade(axes, SPELLS_S)
        _draw(axes, pair.unaided, ORANGE, "without altimeter")
        _draw(axes, pair.aided, BLUE, "with altimeter from 30 s")
        label_axes(axes, x="time [s]" if name == "outage" else "", y="error [m]", title=f"GNSS {name}")
        add_legend(axes)
    return figure


def _draw(axes: Axes, height: HeightErrors, colour: str, name: str) -> None:
    t = np.arange(len(height.error))
    axes.plot(t, height.error, color=colour, label=name)
    for sign in (-3.0, 3.0):
        axes.plot(t, sign * height.sd, color=colour, lw=0.7, alpha=0.6)


def _shade(axes: Axes, spells: tuple[tuple[float, float], ...]) -> None:
    for begin, end in spells:
        axes.axvspan(begin, end, color=GREY, alpha=0.18, lw=0.0)


def one_flight(run: FilterRun) -> Figure:
    """Errors of position, and three sigma."""
    figure = new_figure(
        "Errors of position through outages of GNSS, and three sigma",
        "One flight, truth drawn from the filter's model; barometer and altimeter all along. Shaded: no satellites.",
        height=7.0,
    )
    t = np.arange(len(run.errors))
    for axes, error, sd, name in zip(
        figure.subplots(3, 1, sharex=True), run.errors.T, run.sds.T, ("north", "east", "down"), strict=True
    ):
        _shade(axes, OUTAGES_S)
        axes.fill_between(t, -3.0 * sd, 3.0 * sd, color=SKY, alpha=0.35, lw=0.0)
        axes.plot(t, error, color=BLUE)
        label_axes(axes, x="time [s]" if name == "down" else "", y=f"{name} [m]")
    return figure


def consistency(cases: list[list[FilterRun]]) -> Figure:
    """NEES over its n at the instants, by case."""
    figure = new_figure(
        "Normalised error squared over its number of states: 1 is a consistent filter",
        f"Mean of {len(cases[0])} flights of each case at ten instants; the band is 0.85 to 1.15.",
    )
    axes = figure.subplots()
    axes.axhspan(0.85, 1.15, color=GREY, alpha=0.2, lw=0.0)
    for case, runs, colour in zip(CASES, cases, COLOURS, strict=True):
        axes.plot(INSTANTS_S, np.mean([run.nees for run in runs], axis=0), "o-", color=colour, label=case.name)
    label_axes(axes, x="time [s]", y="NEES / n")
    add_legend(axes)
    return figure
