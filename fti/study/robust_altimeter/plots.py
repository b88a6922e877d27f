"""Pictures of the study of the vertical channel (source 001, fig. 2 to 7), and a flight of its live form."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fti.nav.vertical.error_model import HEIGHT
from fti.nav.vertical.kalman_filter import GATE
from fti.plot_style import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILION, add_legend, label_axes, new_figure
from fti.study.robust_altimeter import channel
from fti.study.robust_altimeter.experiment import jumps
from fti.study.robust_altimeter.flights import LOST_S, VerticalCase, VerticalFlight, fly

#: Runs of the plot of the jumps.
PLOT_RUNS = 500


def one_run(variant: channel.ChannelVariant, seed: int, gate: float, *, faulted: bool) -> Figure:
    """Fig. 2 and 3, 4 and 5, or 6 and 7: one run."""
    truth = channel.simulate(variant, 1, np.random.default_rng([seed, 9]), drawn=False, faulted=faulted)
    found = channel.estimate(variant, truth.z, gate)
    what = "every measurement counts" if math.isinf(gate) else f"refusal beyond {gate:g} sigma"
    figure = new_figure(
        f"INS and radio altimeter: {what}",
        f"One run, {variant.name}; " + ("noise a hundredfold at four iterations." if faulted else "no faults."),
        height=7.0,
    )
    heights, errors = figure.subplots(2, 1, sharex=True)
    t, ins = channel.DT_S * np.arange(channel.ITERATIONS + 1), truth.x[:, 0, HEIGHT]
    estimated, sd = found.x[:, 0, HEIGHT], found.sd[:, 0, HEIGHT]
    for values, colour, name in ((ins, BLACK, "INS error"), (estimated, BLUE, "estimated INS error")):
        heights.plot(t, values, color=colour, label=name)
    errors.fill_between(t, -sd, sd, color=SKY, alpha=0.4, lw=0.0, label="one sigma")
    errors.plot(t, estimated - ins, color=VERMILION, label="error of the integrated height")
    if faulted:
        _mark_faults(heights, errors)
    label_axes(heights, y="[m]", title="Height")
    label_axes(errors, x="time [s]", y="[m]", title="Integrated")
    add_legend(heights)
    add_legend(errors)
    return figure


def _mark_faults(*all_axes: Axes) -> None:
    for axes in all_axes:
        for k in channel.FAULT_STEPS:
            axes.axvline(channel.DT_S * k, color=GREY, lw=0.7, ls=":")


def jumps_at_faults(seed: int) -> Figure:
    """Jumps of all faults of many runs, with and without refusal: their distribution."""
    figure = new_figure(
        "Effect of a fault on the channel.estimate",
        f"Change of the estimated INS error at the faulted iterations; {PLOT_RUNS} runs of four faults each.",
        width=10.0,
        height=4.6,
    )
    for axes, variant in zip(figure.subplots(1, 2, sharey=True), (channel.PRINTED, channel.PHYSICAL), strict=True):
        truth = channel.simulate(variant, PLOT_RUNS, np.random.default_rng([seed, 9]), drawn=False, faulted=True)
        for gate, colour, name in ((math.inf, VERMILION, "every one counts"), (GATE, BLUE, "refusal")):
            found = np.sort(jumps(channel.estimate(variant, truth.z, gate)).ravel())
            axes.semilogx(found, np.linspace(0.0, 100.0, len(found)), color=colour, label=name)
        axes.axvline(1.0, color=GREY, ls=":", lw=1.0)
        label_axes(axes, x="jump [m]", title=variant.name.capitalize())
        add_legend(axes)
    figure.axes[0].set_ylabel("faults with a smaller one [%]")
    return figure


def flight(seed: int) -> Figure:
    """The live form, with an altimeter and without."""
    figure = new_figure(
        "Ten minutes, satellites for the first two",
        "Then an altimeter over known ground, one return in twenty is random; or the inertial channel alone.",
        height=7.0,
    )
    aided, alone = figure.subplots(2, 1, sharex=True)
    for axes, altimeter, title in ((aided, True, "With an altimeter"), (alone, False, "Inertial alone")):
        _draw_flight(axes, fly(VerticalCase(seed, 0, altimeter=altimeter)))
        label_axes(axes, y="height minus truth [m]", title=title)
        add_legend(axes)
    alone.set_xlabel("time [s]")
    return figure


def _draw_flight(axes: Axes, flight: VerticalFlight) -> None:
    axes.fill_between(flight.t, -flight.sd, flight.sd, color=SKY, alpha=0.4, lw=0.0, label="one sigma")
    error = flight.found - flight.alt
    axes.plot(flight.t, error, color=ORANGE, lw=0.8, label="not valid")
    axes.plot(flight.t, np.where(flight.valid, error, np.nan), color=GREEN, label="valid")
    axes.axvline(LOST_S, color=GREY, ls=":", lw=1.0)
