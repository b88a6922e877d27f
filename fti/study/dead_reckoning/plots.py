"""Figures of the study ``dead-reckoning``."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from fti.plot_style import label_axes
from fti.study.dead_reckoning.experiment import fly
from fti.study.dead_reckoning.flight import CLEARANCE_M, IMAGER, PATHS, SPEED_MPS


def errors(seed: int) -> Figure:
    """Horizontal error of the first flights without satellites, with looks and without (figures 7.39, 7.40)."""
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    for number, (axes, path) in enumerate(zip(figure.subplots(2, 1), PATHS, strict=True)):
        for aid, name in (("none", "inertial and barometer"), ("looks", "with looks")):
            track = fly(path, "tactical", aid, seed, number)
            axes.plot(track.t, np.maximum(np.hypot(*track.error.T), 0.1), label=name)
        axes.set_yscale("log")
        axes.legend()
        label_axes(
            axes, x="time without satellites [s]" if number else "", y="error [m]", title=f"tactical unit, {path}"
        )
    return figure


def overlap() -> Figure:
    """Ground in common, and its product with the interval: figure 7.37."""
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    length, width = (float(size) for size in IMAGER.footprint(CLEARANCE_M))
    interval = np.linspace(0.0, length / SPEED_MPS, 200)
    area = np.maximum(length - SPEED_MPS * interval, 0.0) * width / 1e4
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.plot(interval, area)
    lower.plot(interval, area * interval)
    lower.axvline(length / (2.0 * SPEED_MPS), color="0.5", linestyle="--")
    label_axes(upper, x="", y="overlap [ha]", title="two images, 300 m above level ground, 170 m/s, 60 deg")
    label_axes(lower, x="interval [s]", y="overlap x interval [ha s]", title="")
    return figure
