"""Pictures of the study of trajectories (source 003, fig. 7.2 to 7.4)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fti.geodesy.local import LocalFrame
from fti.hil.flight.smoothing import FlightFit
from fti.hil.flight.trajectory import FlightState
from fti.plot_style import BLACK, BLUE, GREEN, ORANGE, VERMILION, add_legend, label_axes, new_figure
from fti.study.trajectory.experiment import Closure

FINE_S = 0.1
#: Part of the flight in the small plot [s]: the steps of the recorder.
PART_S = (100.0, 104.0)
FILTERED, SPLINE = VERMILION, BLUE
MINUTE = 1.0 / 60.0


def flight(fit: FlightFit) -> Figure:
    """Position and attitude: the recording and its spline."""
    figure = new_figure(
        "A recorded flight and its spline",
        "Recorded in radians of single precision, 10 Hz; filtered over 2 s, one knot in 0.5 s.",
        width=10.0,
        height=8.0,
    )
    position, attitude, close_up = figure.subplots(3, 1, height_ratios=(1.0, 1.0, 1.0))
    t = np.arange(0.0, fit.flight.end, FINE_S)
    state = fit.flight.state(t)
    frame = LocalFrame(float(state.lat[0]), float(state.lon[0]), float(state.alt[0]))
    _draw_position(position, frame, state)
    _draw_attitude(attitude, state)
    _draw_steps(close_up, frame, fit)
    return figure


def _draw_position(axes: Axes, frame: LocalFrame, state: FlightState) -> None:
    east, north, _ = frame.to_local(state.lat, state.lon, state.alt).T / 1e3
    for values, colour, name in ((east, BLUE, "east"), (north, ORANGE, "north")):
        axes.plot(state.t, values, color=colour, label=name)
    axes.plot(state.t, (state.alt - state.alt[0]) / 100.0, color=GREEN, label="height / 100 m")
    label_axes(axes, y="from the start [km]", title="Position")
    add_legend(axes)


def _draw_attitude(axes: Axes, state: FlightState) -> None:
    turned = np.unwrap(state.heading) - state.heading[0]
    for values, colour, name in (
        (state.roll, BLUE, "roll"),
        (state.pitch, ORANGE, "pitch"),
        (turned / 10, GREEN, "turned / 10"),
    ):
        axes.plot(state.t, np.rad2deg(values), color=colour, label=name)
    label_axes(axes, x="time [s]", y="[deg]", title="Attitude")
    add_legend(axes)


def _draw_steps(axes: Axes, frame: LocalFrame, fit: FlightFit) -> None:
    """A few seconds: cross-track offset of the recorded positions from the spline."""
    t = fit.filtered_samples.t[(fit.filtered_samples.t >= PART_S[0]) & (fit.filtered_samples.t < PART_S[1])]
    rows, state = np.searchsorted(fit.filtered_samples.t, t), fit.flight.state(t)
    spline_l = frame.to_local(state.lat, state.lon, state.alt)
    for samples, colour, name, style in (
        (fit.recorded_samples, BLACK, "recorded", "."),
        (fit.filtered_samples, FILTERED, "filtered", "-"),
    ):
        offset = frame.to_local(samples.lat, samples.lon, samples.alt)[rows] - spline_l
        axes.plot(t, offset[:, 0], style, color=colour, label=f"{name}, east")
        axes.plot(t, offset[:, 1], style, color=colour, alpha=0.4, label=f"{name}, north")
    label_axes(axes, x="time [s]", y="from the spline [m]", title="Four seconds of it")
    add_legend(axes)


def fit_errors(fit: FlightFit) -> Figure:
    """Both steps of the fit, position and attitude."""
    figure = new_figure(
        "Errors of the fit", "The filter removes the steps of the recorder; the spline follows it closely."
    )  # fmt: skip
    position, attitude = figure.subplots(2, 1, sharex=True)
    t = fit.filtered_samples.t
    for axes, floor, filtered_samples, splined in (
        (position, 1e-6, fit.filter_m, fit.spline_m),
        (attitude, 1e-7, np.rad2deg(fit.filter_rad), np.rad2deg(fit.spline_rad)),
    ):
        axes.semilogy(t, filtered_samples, color=FILTERED, lw=0.8, label="filtered minus recorded")
        axes.semilogy(fit.intermediate_t, splined, color=SPLINE, lw=0.8, label="spline minus filtered")
        axes.set_ylim(bottom=floor)
    label_axes(position, y="[m]", title="Position")
    label_axes(attitude, x="time [s]", y="[deg]", title="Attitude")
    add_legend(position)
    return figure


def closure(found: Closure) -> Figure:
    """Free inertial navigation minus the flight."""
    figure = new_figure(
        "An hour of free inertial navigation at 100 Hz, minus the true flight",
        "The vertical channel is unstable, an error of height grows 280-fold; the horizontal ones swing with Schuler.",
        height=7.0,
    )
    position, velocity, attitude = figure.subplots(3, 1, sharex=True)
    t = MINUTE * found.t
    for axes, values, scale in ((position, found.pos_n, 1e6), (velocity, found.vel_n, 1e9)):
        for column, colour, name in zip(values.T, (BLUE, ORANGE, GREEN), ("north", "east", "down"), strict=True):
            axes.plot(t, scale * column, color=colour, label=name)
    attitude.plot(t, np.rad2deg(found.angle) * 1e12, color=BLACK)
    label_axes(position, y="[um]", title="Position")
    label_axes(velocity, y="[nm/s]", title="Velocity")
    label_axes(attitude, x="time [min]", y="[1e-12 deg]", title="Attitude")
    add_legend(position)
    return figure
