"""Plots of the samples that validity accepts (source 003, fig. 7.56 to 7.61)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fti.messages.reasons import Reason
from fti.plot_style import BLACK, BLUE, CANOPY, GROUND, ORANGE, SKY, VERMILION, add_legend, label_axes, new_figure
from fti.study.compensation.low_level import EVERY_S, Knowledge, Mix, orbit
from fti.study.validity import experiment

#: Number of countries for the shares of the reasons.
COUNTRIES = 4


def flight(seed: int, name: str) -> Figure:
    """A flight: heights; error of valid and refused measurements; attitude."""
    mix = orbit(seed)
    refused = np.array(
        [bool(reasons) for reasons in experiment.reasons_by_variant(mix, Knowledge.PLACE_ERROR, seed)[name]]
    )
    error = mix.measured[name] - mix.nadir
    before, after = (float(np.sqrt(np.mean(e**2))) for e in (error, error[~refused]))
    figure = new_figure(
        f"Validity of a {name} altimeter over woods and buildings",
        f"RMS error {before:.1f} m, of valid samples {after:.1f} m, {100.0 * np.mean(refused):.0f} % excluded. "
        "Place known within 10 m, height within 2 m (one sigma).",
        width=9.0,
        height=7.0,
    )
    high, wrong, attitude = figure.subplots(3, 1, sharex=True, height_ratios=(1.1, 1.3, 1.0))
    _draw_heights(high, mix)
    _draw_errors(wrong, error, refused)
    _draw_attitude(attitude, mix, name)
    figure.align_ylabels()
    return figure


def _seconds(mix: Mix) -> np.ndarray:
    return EVERY_S * np.arange(len(mix))


def _draw_heights(axes: Axes, mix: Mix) -> None:
    t, (east, north, up) = _seconds(mix), mix.points_l.T
    bare, top = mix.country.ground.up(east, north), mix.country.surface.up(east, north)
    floor = float(np.min(bare)) - 5.0
    axes.fill_between(t, floor, bare, color=GROUND, lw=0.0, label="bare ground")
    axes.fill_between(t, bare, top, color=CANOPY, lw=0.0, label="trees, houses")
    axes.plot(t, up, color=BLACK, label="aircraft")
    axes.set_ylim(floor, None)
    add_legend(axes)
    label_axes(axes, y="height [m]")


def _draw_errors(axes: Axes, error: np.ndarray, refused: np.ndarray) -> None:
    t = EVERY_S * np.arange(len(error))
    axes.plot(t, error, color="#C8C8C8", lw=0.8, zorder=1)
    axes.plot(t[refused], error[refused], "x", color=VERMILION, ms=4, label="refused")
    axes.plot(t[~refused], error[~refused], ".", color=BLUE, ms=5, label="valid")
    axes.set_yscale("symlog", linthresh=10.0)
    axes.set_yticks([-20, -10, -5, 0, 5, 10, 20, 50, 100], ["-20", "-10", "-5", "0", "5", "10", "20", "50", "100"])
    low, high = float(np.min(error)), float(np.max(error))
    axes.set_ylim(1.2 * min(low, -10.0), 1.2 * max(high, 10.0))
    add_legend(axes)
    label_axes(axes, y="measured - true height [m]")


def _draw_attitude(axes: Axes, mix: Mix, name: str) -> None:
    t, limit = _seconds(mix), experiment.VARIANTS[name].limits.max_roll_deg
    axes.axhspan(-limit, limit, color=SKY, alpha=0.2, lw=0.0, label="roll that is valid")
    axes.plot(t, np.degrees(mix.roll), color=BLUE, label="roll")
    axes.plot(t, np.degrees(mix.pitch), color=ORANGE, label="pitch")
    add_legend(axes)
    label_axes(axes, "time [s]", "[deg]")


def reasons(seed: int) -> Figure:
    """How many samples of the mix each reason refuses."""
    runs = [experiment.run(seed + k) for k in range(COUNTRIES)]
    figure = new_figure(
        "Reasons of refused samples",
        f"Share of the samples of the mix, {COUNTRIES} countries; a sample may have several reasons.",
        width=9.0,
        height=4.2,
    )
    for axes, name in zip(figure.subplots(1, 2, sharex=True), ("laser", "radar"), strict=True):
        _draw_reasons(axes, runs, name)
    return figure


def _draw_reasons(axes: Axes, runs: list[experiment.Run], name: str) -> None:
    shown = [Reason.ROLL, Reason.PITCH, Reason.DEVIATION, Reason.NOT_NADIR, Reason.DISPERSION, Reason.INCIDENCE]
    place = np.arange(len(shown))[::-1]
    for k, (known, colour) in enumerate(zip(Knowledge, (BLUE, VERMILION, ORANGE), strict=True)):
        shares = [float(np.mean([run[known, name].share(reason) for run in runs])) for reason in shown]
        axes.barh(place + 0.25 * (1 - k), 100.0 * np.array(shares), height=0.25, color=colour, label=str(known))
    axes.set_yticks(place, [reason.value.replace("_", " ") for reason in shown])
    if name == "radar":
        axes.legend(loc="upper right")
    label_axes(axes, "refused [%]", title=f"{name} altimeter")
