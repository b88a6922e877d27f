"""Pictures of approaches under the integrity monitor (source 003, figures 7.12, 7.13 and 7.16)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.hil.approach_reference.approaches import SimulatedApproach, run_monitor, simulate, track_of
from fti.messages.outputs import ClearanceIntegrity, IntegrityState
from fti.nav.integrity.monitor import ClearanceMonitor
from fti.plot_style import BLACK, BLUE, GREEN, GREY, GROUND, ORANGE, SKY, VERMILION, add_legend, label_axes, new_figure
from fti.study.clearance import experiment
from fti.study.clearance.faults import fly_with_fault
from fti.study.clearance.ground import path, ray_traced_ground, reference

#: Colour and label of each state.
COLOURS = {
    IntegrityState.OK: GREEN,
    IntegrityState.MONITOR: SKY,
    IntegrityState.CAUTION: ORANGE,
    IntegrityState.ALERT: VERMILION,
    IntegrityState.ACQUIRE: GREY,
    IntegrityState.UNAVAILABLE: BLACK,
}
RATIOS = (("t1_ratio", "T1 match", BLUE), ("t2_ratio", "T2 shift", SKY), ("t3_ratio", "T3 height", GREY),
          ("t4_ratio", "T4 obstacle", VERMILION))  # fmt: skip


def nominal(seed: int) -> Figure:
    """A nominal approach."""
    flight = simulate(ray_traced_ground(), 5000.0, np.random.default_rng([seed, 0]))
    return _picture(flight, "A nominal approach", "5 m off track and path, vegetation 15 % off its survey")


def joined_late(seed: int) -> Figure:
    """An approach that joins the published track 2200 m before the threshold."""
    return _picture(experiment.late_flight(seed, 0), "The track is joined 2200 m before the threshold", "At 30 deg")


def obstacle(seed: int) -> Figure:
    """150 m high, 3000 m before the threshold, and not in the reference."""
    flight, *_ = fly_with_fault("obstacle_150", seed, 4)
    return _picture(flight, "An unexpected obstacle of 150 m", "3000 m before the threshold")


def _picture(flight: SimulatedApproach, title: str, subtitle: str) -> Figure:
    outputs = run_monitor(ClearanceMonitor(reference(), experiment.SETTINGS), flight)
    figure = new_figure(title, subtitle, width=9.0, height=6.5)
    heights, ratios, states = figure.subplots(3, 1, sharex=True, height_ratios=(1.4, 1.0, 0.25))
    _heights(heights, flight)
    _ratios(ratios, outputs)
    _states(states, flight, outputs)
    states.invert_xaxis()
    return figure


def _heights(axes: Axes, flight: SimulatedApproach) -> None:
    s = reference().s
    expected = path().alt_path(s) - reference().z_ref
    axes.plot(_distance_before(s), expected, color=GROUND, lw=2.5, label="height above ground as published")
    axes.plot(_distance_before(flight.nav_s), flight.agl, color=BLUE, lw=1.0, label="altimeter")
    axes.set(xlim=(float(_distance_before(flight.s[-1])), float(_distance_before(flight.s[0]))))
    label_axes(axes, y="height above ground [m]")
    add_legend(axes)


def _ratios(axes: Axes, outputs: Sequence[ClearanceIntegrity]) -> None:
    windows = [output for output in outputs if output.t1_ratio is not None]
    s = _distance_before([output.s_end or 0.0 for output in windows])
    for name, text, colour in RATIOS:
        values = [getattr(output, name) for output in windows]
        axes.plot(s, [np.nan if value is None else max(value, 1e-2) for value in values], color=colour, label=text)
    axes.axhline(1.0, color=BLACK, lw=0.8, ls="--")
    axes.set(yscale="log")
    label_axes(axes, y="statistic / limit")
    add_legend(axes)


def _states(axes: Axes, flight: SimulatedApproach, outputs: Sequence[ClearanceIntegrity]) -> None:
    """State of each output, at the position of its time."""
    track = track_of(flight)
    for state, colour in COLOURS.items():
        t_ns = [output.t_ns for output in outputs if output.state is state]
        s = _distance_before(np.interp(t_ns, track.t_ns, track.s))
        axes.plot(s, np.zeros(len(s)), "|", color=colour, ms=16, mew=2.0, label=state.value)
    axes.set(yticks=[])
    label_axes(axes, x="distance to the threshold [m]")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -1.2), ncols=len(COLOURS), frameon=False)


def _distance_before(s: ArrayLike) -> Array:
    """Distance before the threshold [m]."""
    return np.asarray(s, dtype=np.float64) - path().x_gpi
