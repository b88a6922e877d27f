"""Plot of a fit: measured minus predicted, as configured and as fitted, over time and over the range."""

from __future__ import annotations

from matplotlib.figure import Figure

from fti.hil.approach_reference.fitted_receiver import FittedReceiver
from fti.plot_style import BLUE, VERMILION, add_legend, label_axes, new_figure


def draw_fit(receiver: FittedReceiver, sensor: str) -> Figure:
    """The whole figure."""
    parameters = ", ".join(f"{name} {value:.4g}" for name, value, _, _ in receiver.rows())
    figure = new_figure(f"Receiver of {sensor}", f"{receiver.model}: {parameters}")
    by_time, by_range = figure.subplots(2, 1)
    steps = range(len(receiver.samples))
    shown = (receiver.configured_residuals, VERMILION, "as configured"), (receiver.fit.residuals, BLUE, "as fitted")
    for residuals, colour, name in shown:
        by_time.plot(steps, residuals, ".", color=colour, markersize=2.5, label=name)
        by_range.plot(receiver.samples.value, residuals, ".", color=colour, markersize=2.5)
    label_axes(by_time, "sample", "measured - predicted [m]")
    label_axes(by_range, "measured [m]", "measured - predicted [m]")
    add_legend(by_time)
    return figure
