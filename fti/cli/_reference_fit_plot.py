"""The picture of a fit: measured minus predicted, as configured and as fitted, over time and over the range."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from fti.figures import BLUE, VERMILION, label, legend_above, sheet, write
from fti.hil.references.fitted_receiver import FittedReceiver


def write_plot(found: FittedReceiver, sensor: str, file: Path) -> None:
    """Draw into a new file.  Raises what ``fti.figures.write`` raises."""
    write(lambda: _draw(found, sensor), file)


def _draw(found: FittedReceiver, sensor: str) -> Figure:
    parameters = ", ".join(f"{name} {value:.4g}" for name, value, _, _ in found.rows())
    figure = sheet(f"Receiver of {sensor}", f"{found.model}: {parameters}")
    by_time, by_range = figure.subplots(2, 1)
    steps = range(len(found.samples))
    shown = (found.before, VERMILION, "as configured"), (found.fit.residuals, BLUE, "as fitted")
    for residuals, colour, name in shown:
        by_time.plot(steps, residuals, ".", color=colour, markersize=2.5, label=name)
        by_range.plot(found.samples.value, residuals, ".", color=colour, markersize=2.5)
    label(by_time, "sample", "measured - predicted [m]")
    label(by_range, "measured [m]", "measured - predicted [m]")
    legend_above(by_time)
    return figure
