"""Pictures of the study of weighted dilution of precision (source 004, fig. 3 to 8)."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from matplotlib.figure import Figure

from fti.plot_style import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILION, add_legend, label_axes, new_figure
from fti.study.wdop.experiment import DME_SD, EPOCH_S, HOUR_S, STATIONS, WORDS, Geometry, Heights, fly_hour, rms

#: Runs of the plots.
RUNS = 200
COLOURS = {"ranges": BLUE, "altimeter": ORANGE, "fused": VERMILION}
MINUTES = np.arange(0.0, HOUR_S + EPOCH_S, EPOCH_S) / 60.0


@lru_cache(maxsize=1)
def _fly_hour(seed: int) -> list[Heights]:
    return fly_hour(RUNS, seed, lambda share: None)


def satellites() -> Figure:
    """Fig. 2 to 4: height, stations and track, satellites."""
    epochs = Geometry().epochs()
    figure = new_figure(
        "The flight of the study",
        f"Five invented DME stations (sigma {DME_SD:.0f} m); 24 GPS satellites, high ones only.",
        height=7.0,
    )
    plan, height, number = figure.subplots(3, 1, height_ratios=(2.0, 1.0, 1.0))
    bearing, distance, _ = np.array(STATIONS).T
    east, north = (distance / 1e3 * f(np.radians(bearing)) for f in (np.sin, np.cos))
    plan.plot(east, north, "^", color=BLACK, label="DME")
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    plan.plot(15.0 * np.sin(turn), 15.0 * np.cos(turn), color=BLUE, label="track")
    plan.set_aspect("equal")
    minutes = [epoch.t / 60.0 for epoch in epochs]
    height.plot(minutes, [epoch.agl for epoch in epochs], color=GREEN)
    number.step(minutes, [len(epoch.satellites_e) for epoch in epochs], color=BLACK, where="post")
    number.set_ylim(0.0, 6.0)
    label_axes(plan, x="east [km]", y="north [km]")
    label_axes(height, y="[m]", title="Height above ground")
    label_axes(number, x="time [min]", y="", title="Satellites used")
    add_legend(plan)
    return figure


def predicted(seed: int) -> Figure:
    """Fig. 5 and 6: RMS of both heights and predicted sigma."""
    found = _fly_hour(seed)
    figure = new_figure("Height: RMS error and predicted sigma", f"{RUNS} runs.", height=6.5)
    for axes, name in zip(figure.subplots(2, 1, sharex=True), ("ranges", "altimeter"), strict=True):
        axes.semilogy(MINUTES, rms(found, name), color=COLOURS[name], lw=1.0, label="RMS error")
        axes.semilogy(MINUTES, rms(found, f"{name}_sd"), "--", color=BLACK, lw=1.0, label="predicted sigma")
        label_axes(axes, y="[m]", title=WORDS[name][0].upper() + WORDS[name][1:])
        add_legend(axes)
    figure.axes[-1].set_xlabel("time [min]")
    return figure


def choice(seed: int) -> Figure:
    """Fig. 7 and 8: the selected height and its error."""
    found = _fly_hour(seed)
    figure = new_figure("Selected height and its error", f"{RUNS} runs.", height=6.5)
    errors, chosen = figure.subplots(2, 1, sharex=True, height_ratios=(3.0, 1.0))
    for name, colour in COLOURS.items():
        errors.semilogy(MINUTES, rms(found, name), color=colour, lw=2.2 if name == "fused" else 1.0, label=WORDS[name])
    errors.semilogy(MINUTES, rms(found, "combined"), ":", color=GREY, lw=1.2, label="all in one least squares")
    chosen.fill_between(MINUTES, [h.from_altimeter.mean() for h in found], color=SKY, step="post", lw=0.0)
    label_axes(errors, y="RMS error [m]")
    label_axes(chosen, x="time [min]", y="share", title="Runs that take the altimeter's")
    add_legend(errors)
    return figure
