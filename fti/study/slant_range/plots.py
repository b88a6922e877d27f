"""Pictures of the flights of the slant-range study (source 003, fig. 2.54 to 2.59)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LightSource
from matplotlib.figure import Figure

from fti.arrays import Array
from fti.plot_style import BLACK, BLUE, GREY, GROUND, ORANGE, VERMILION, add_legend, label_axes, new_figure
from fti.study.slant_range.experiment import FINE, AltimeterFlight, fly
from fti.study.slant_range.scenarios import RangingScenario

COLOURS = {"pencil": VERMILION, "narrow": ORANGE, "wide": BLUE}
NAMES = {"pencil": "laser (pencil beam)", "narrow": "radar, narrow beam", "wide": "radar, wide beam"}
TITLES = {"approach": "Approach", "low_level": "Low-level flight"}
KM, MARGIN_M = 1e-3, 2000.0
GROUNDS = {"flat": "level ground", "rough": "rough ground"}
#: Limits of plotted errors [m]; plotted heights over the maximum nadir height.
LIMITS = {"flat": (-20.0, 130.0), "rough": (-80.0, 130.0)}
HEADROOM = {"approach": 1.1, "low_level": 1.7}
SUBTITLES = {
    ("approach", "flat"): "The pencil beam reads long in each turn; both radars are right in the first and the last, "
    "only the wide one the second.",
    (
        "approach",
        "rough",
    ): "Radars read the nearest hill and come out short; the laser follows the attitude.",
    (
        "low_level",
        "flat",
    ): "Banks of 35 to 75 deg: the wide beam keeps the nadir where the narrow one loses it.",
    ("low_level", "rough"): "The first return is short wings level, and long where the nadir is outside the beam.",
}


def situation(scenario: RangingScenario, ground: str) -> Figure:
    """Height profile, height above ground, error and attitude over time."""
    record = fly(scenario.flight, scenario.ground(ground), FINE)
    title = f"{TITLES[scenario.name]} over {GROUNDS[ground]}"
    figure = new_figure(title, SUBTITLES[scenario.name, ground], width=10.0, height=9.0)
    profile, height, error, attitude = figure.subplots(4, 1, sharex=True, height_ratios=(1.0, 1.2, 1.5, 0.9))
    _draw_profile(profile, record)
    _draw_heights(height, record, HEADROOM[scenario.name])
    _draw_errors(error, record, LIMITS[ground])
    _draw_attitude(attitude, record)
    profile.set_xlim(record.flight.t[0], record.flight.t[-1])
    figure.align_ylabels()
    return figure


def _draw_profile(axes: Axes, record: AltimeterFlight) -> None:
    t, up = record.flight.t, record.flight.origins_l[:, 2]
    ground = up - record.nadir
    floor = min(0.0, float(np.min(ground))) - 0.1 * float(np.ptp(up) + 100.0)
    axes.fill_between(t, floor, ground, color=GROUND, lw=0.0, label="ground below")
    axes.plot(t, up, color=BLACK, label="aircraft")
    axes.set_ylim(floor, None)
    label_axes(axes, y="height [m]")
    add_legend(axes)


def _draw_heights(axes: Axes, record: AltimeterFlight, headroom: float) -> None:
    axes.plot(record.flight.t, record.nadir, color=BLACK, lw=2.4, label="nadir (truth)")
    for name, colour in COLOURS.items():
        axes.plot(record.flight.t, record.measured[name], color=colour, lw=1.0, label=NAMES[name])
    axes.set_ylim(0.0, headroom * float(np.max(record.nadir)))
    label_axes(axes, y="height above\nground [m]")
    add_legend(axes)


def _draw_errors(axes: Axes, record: AltimeterFlight, limits: tuple[float, float]) -> None:
    for name, colour in COLOURS.items():
        axes.plot(record.flight.t, record.error(name), color=colour, lw=1.1)
    axes.axhline(0.0, color=BLACK, lw=0.8)
    axes.set_ylim(limits)
    label_axes(axes, y="error against\nnadir [m]")


def _draw_attitude(axes: Axes, record: AltimeterFlight) -> None:
    axes.plot(record.flight.t, np.degrees(record.flight.roll), color=BLACK, label="roll")
    axes.plot(record.flight.t, np.degrees(record.flight.pitch), color=GREY, label="pitch")
    label_axes(axes, "time [s]", "attitude [deg]")
    add_legend(axes)


def track(scenario: RangingScenario) -> Figure:
    """Fig. 2.54 and 2.57: the flight over the rough ground, from above."""
    flight = scenario.flight
    low, high = flight.origins_l[:, :2].min(axis=0) - MARGIN_M, flight.origins_l[:, :2].max(axis=0) + MARGIN_M
    wide, tall = (high - low) / np.max(high - low)
    figure = new_figure(f"{TITLES[scenario.name]}: the ground track", width=2.2 + 7.8 * wide, height=1.1 + 7.8 * tall)
    axes = figure.subplots()
    extent = (low[0] * KM, high[0] * KM, low[1] * KM, high[1] * KM)
    axes.imshow(_shaded_relief(scenario, low, high), extent=extent, origin="lower", cmap="gray", vmin=-0.6, vmax=1.1)
    points = flight.origins_l[:, :2] * KM
    pieces = np.stack((points[:-1], points[1:]), axis=1)
    axes.plot(*points.T, color="white", lw=6.5, solid_capstyle="round")
    line = LineCollection(list(pieces), array=flight.origins_l[:-1, 2], cmap="plasma", lw=4.0, capstyle="round")
    axes.add_collection(line)
    figure.colorbar(line, ax=axes, shrink=0.8, label="height of the aircraft [m]")
    _mark(axes, flight.t, points)
    axes.set(xlim=extent[:2], ylim=extent[2:], aspect="equal")
    axes.grid(visible=False)
    label_axes(axes, "east [km]", "north [km]")
    return figure


def _shaded_relief(scenario: RangingScenario, low: Array, high: Array) -> Array:
    """The rough ground between two corners [m], lit from the north-west."""
    step = scenario.rough.finest.cell_m
    east, north = (np.arange(low[k], high[k], step) for k in (0, 1))
    ground = scenario.rough.up(*np.meshgrid(east, north))
    return np.asarray(LightSource(315.0, 40.0).hillshade(ground, dx=step, dy=step, vert_exag=2.0), dtype=np.float64)


def _mark(axes: Axes, t: Array, points: Array) -> None:
    """Time marks along the track."""
    for moment in np.arange(0.0, t[-1], 60.0 if t[-1] > 300.0 else 20.0):
        x, y = points[np.searchsorted(t, moment)]
        axes.plot(x, y, "o", ms=4.5, color="white", mec=BLACK, mew=0.9)
        axes.annotate(
            f"{moment:.0f} s", (x, y), xytext=(7, 7), textcoords="offset points", fontsize=8.0,
            bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.85},
        )  # fmt: skip
