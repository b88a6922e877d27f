"""Plot of the planned flight: ground track, height and clearance, airspeed, bank."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fti.arrays import Array
from fti.hil.environment import Environment, calibrated_airspeed, impact_pressure
from fti.hil.flight.trajectory import FlightState
from fti.plot_style import BLUE, GREY, GROUND, VERMILION, label_axes, new_figure

SAMPLES = 2000
#: Points across the map, and its margin around the track [m].
MAP_POINTS, MAP_MARGIN_M = 300, 800.0
#: The glide path is drawn where the flight is within this distance of its track [m].
TRACK_TOLERANCE_M = 150.0
#: Interval of the time marks on the track [s].
MARK_PERIOD_S = 60.0


def draw_flight(world: Environment) -> Figure:
    """The flight of a scenario."""
    scenario, air = world.scenario, world.scenario.air
    state = world.state(np.linspace(0.0, world.duration, SAMPLES))
    wind = f"wind {air.wind_mps:g} m/s from {air.wind_from_deg:g} deg" if air.wind_mps else "no wind"
    subtitle = f"{world.duration:.0f} s, {wind}, QNH {air.qnh_hpa:g} hPa, seed {scenario.seed}"
    figure = new_figure(scenario.title, subtitle, width=11.5, height=7.0)
    grid = figure.add_gridspec(3, 2, width_ratios=(1.15, 1.0))
    _map(figure.add_subplot(grid[:, 0]), world, state)
    panels = [figure.add_subplot(grid[i, 1]) for i in range(3)]
    _heights(panels[0], world, state)
    _airspeed(panels[1], world, state)
    panels[2].plot(state.t, np.rad2deg(state.roll), color=BLUE)
    label_axes(panels[2], "time [s]", "[deg]", "bank, right wing down")
    return figure


def _map(axes: Axes, world: Environment, state: FlightState) -> None:
    frame = world.terrain.frame
    track = frame.to_local(state.lat, state.lon, state.alt)[:, :2]
    middle, half = 0.5 * (track.min(axis=0) + track.max(axis=0)), 0.5 * np.ptp(track, axis=0).max() + MAP_MARGIN_M
    low, high = middle - half, middle + half
    east, north = (np.linspace(low[i], high[i], MAP_POINTS) for i in range(2))
    ground = world.terrain.up(*np.meshgrid(east, north)) + frame.alt0
    extent = tuple(value / 1000.0 for value in (low[0], high[0], low[1], high[1]))
    image = axes.imshow(ground, origin="lower", extent=extent, alpha=0.75)
    axes.figure.colorbar(image, ax=axes, label="ground above the ellipsoid [m]", location="bottom", shrink=0.7)
    axes.plot(*(track.T / 1000.0), color=VERMILION, linewidth=1.8)
    for t in np.arange(0.0, world.duration, MARK_PERIOD_S):
        position = _at(t, state.t, track[:, 0]), _at(t, state.t, track[:, 1])
        axes.plot(*position, marker="o", color=VERMILION, markersize=4)
        axes.annotate(f"{t:.0f} s", position, xytext=(5, 4), textcoords="offset points", fontsize=8)
    axes.set_aspect("equal")
    axes.grid(visible=False)
    label_axes(axes, "east of the threshold [km]", "north [km]", "track")


def _at(t: float, times: Array, metres: Array) -> float:
    """Value of a coordinate [m] at t, in km."""
    return float(np.interp(t, times, metres)) / 1000.0


def _heights(axes: Axes, world: Environment, state: FlightState) -> None:
    ground = world.ground(state)
    clearance = state.alt - ground
    axes.fill_between(state.t, ground, np.nanmin(ground) - 20.0, color=GROUND, linewidth=0.0)
    axes.plot(state.t, state.alt, color=BLUE)
    s, y = world.path.to_path(state.lat, state.lon)
    glide = np.where((s > 0.0) & (np.abs(y) < TRACK_TOLERANCE_M), world.path.alt_path(s), np.nan)
    axes.plot(state.t, glide, color=GREY, linestyle="--", label="published glide path")
    if np.isfinite(glide).any():
        axes.legend(loc="upper center")
    label_axes(axes, "", "[m]", f"height above the ellipsoid; lowest {np.nanmin(clearance):.0f} m above the ground")


def _airspeed(axes: Axes, world: Environment, state: FlightState) -> None:
    alt_msl = state.alt - world.undulation
    p_static, temperature = world.atmosphere.p_static(alt_msl), world.atmosphere.temperature(alt_msl)
    axes.plot(state.t, calibrated_airspeed(impact_pressure(state.tas, p_static, temperature)), color=BLUE)
    label_axes(axes, "", "[m/s]", "calibrated airspeed")
